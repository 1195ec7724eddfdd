"""Angle error of the observer when the machine differs from its file: resistance, inductance, flux.

Current on the q axis only: an error of R lies along the EMF and turns it little, an error of L lies across it and turns
it by (L - L') i / psi at every speed (L' of the file). psi is not in the observer; a weaker flux asks for more current.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fluxlock.analysis.rundata import FloatArray
from fluxlock.analysis.vector.sensorless import Drive, eigenvalues, rest, simulate

SETTLED_BANDWIDTHS = 8.0  # of the loop's bandwidth, in periods: what is left is below 1e-6 deg


@dataclass(frozen=True)
class Change:
    """Factors of the machine on its file's R, L and psi."""

    r: float = 1.0
    l: float = 1.0  # noqa: E741
    psi: float = 1.0

    @property
    def text(self) -> str:
        """`R +50 %, L -30 %`, or `none`."""
        parts = (("R", self.r), ("L", self.l), ("psi", self.psi))
        return ", ".join(f"{name} {100 * (f - 1):+.0f} %" for name, f in parts if f != 1.0) or "none"


R_FACTORS, L_FACTORS, PSI_FACTORS = (0.5, 1.0, 1.5), (0.7, 1.0, 1.3), (0.9, 1.0)
CHANGES = tuple(Change(*factors) for factors in itertools.product(R_FACTORS, L_FACTORS, PSI_FACTORS))
SINGLE = tuple(c for c in CHANGES if (c.r != 1.0) + (c.l != 1.0) + (c.psi != 1.0) == 1)


def changed(drive: Drive, change: Change) -> Drive:
    """A drive designed for its machine, on the changed machine; the current that the same torque needs."""
    return replace(
        drive,
        machine=drive.model_of.changed(change.r, change.l, change.psi),
        believed=drive.model_of,
        current=drive.current / change.psi,
    )


def error_map(drive: Drive, change: Change, speeds_hz: FloatArray, load_a: FloatArray) -> FloatArray:
    """Angle error (deg) [speeds, loads] in closed form; nan where the loop finds no angle.

    speeds_hz: electrical, signed; load_a: q current of the torque with the file's flux, along the motion if positive.
    """
    run = changed(drive, change)
    omega = 2.0 * math.pi * speeds_hz[:, np.newaxis]
    current = 1j * np.sign(omega) * load_a / change.psi
    return rest(run, omega, current).error_deg


@dataclass(frozen=True)
class Checked:
    """One point followed in time: closed form and simulated error (deg), largest eigenvalue of the step."""

    closed_deg: float
    simulated_deg: float
    eigenvalue: float


def check_point(drive: Drive, change: Change, speed_hz: float, load_a: float, bandwidth_hz: float) -> Checked:
    """Follow the loop from the file's own angle until it rests; bandwidth_hz: of the drive's loop."""
    omega = 2.0 * math.pi * speed_hz
    run = changed(replace(drive, current=1j * math.copysign(load_a, speed_hz)), change)
    samples = math.ceil(SETTLED_BANDWIDTHS / bandwidth_hz / drive.sampling.ts_s)
    course = simulate(run, omega, samples)
    return Checked(
        float(error_map(drive, change, np.array([speed_hz]), np.array([load_a]))[0, 0]),
        float(course.error_deg[-1]),
        float(np.abs(eigenvalues(run, omega, course.last)).max()),
    )


@dataclass(frozen=True)
class Worst:
    """The largest error of a set of maps and where it is."""

    error_deg: float
    change: Change
    speed_hz: float
    load_a: float
    lost: int  # points without an angle


def worst_case(drive: Drive, changes: Sequence[Change], speeds_hz: FloatArray, load_a: FloatArray) -> Worst:
    """Largest error over changes, speeds (Hz) and loads (A)."""
    maps = np.stack([error_map(drive, change, speeds_hz, load_a) for change in changes])
    c, s, k = np.unravel_index(int(np.nanargmax(np.abs(maps))), maps.shape)
    return Worst(
        float(maps[c, s, k]), changes[int(c)], float(speeds_hz[s]), float(load_a[k]), int(np.isnan(maps).sum())
    )
