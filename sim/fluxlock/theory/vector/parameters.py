# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

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

from fluxlock.results.rundata import FloatArray
from fluxlock.theory.vector.sensorless import Drive, eigenvalues, rest, simulate

COARSE, FINE = 0.9, 1.01


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
SINGLE = (Change(r=0.5), Change(r=1.5), Change(l=0.7), Change(l=1.3), Change(psi=0.9))
# The corners that add: L and the current of a weak flux; R with the sign that helps.
WORST_PAIRS = (Change(1.5, 0.7, 0.9), Change(0.5, 1.3, 0.9))


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


def on_machine(drive: Drive, change: Change, speed_hz: float, load_a: float) -> Drive:
    """The drive on the changed machine at a signed speed (Hz) and a load (A, along the motion)."""
    return changed(replace(drive, current=1j * math.copysign(load_a, speed_hz)), change)


def simulated_error(drive: Drive, change: Change, speed_hz: float, load_a: float, samples: int) -> float:
    """Angle error (deg) after a number of samples, from the right angle on."""
    run = on_machine(drive, change, speed_hz, load_a)
    return float(simulate(run, 2.0 * math.pi * speed_hz, samples).error_deg[-1])


def is_stable(drive: Drive, change: Change, speed_hz: float, load_a: float) -> bool:
    """Whether the loop has a rest and small deviations from it fade."""
    run = on_machine(drive, change, speed_hz, load_a)
    try:
        return bool(np.abs(eigenvalues(run, 2.0 * math.pi * speed_hz)).max() < 1.0)
    except ValueError:
        return False


def lowest_speed_hz(drive: Drive, change: Change, load_a: float, highest_hz: float) -> float:
    """Speed (Hz, 1 % fine) from which on the loop is stable up to highest_hz; nan if it is not there.

    Followed down in steps of a tenth, to a thousandth of highest_hz.
    """
    stable = highest_hz
    if not is_stable(drive, change, stable, load_a):
        return math.nan
    below = stable * COARSE
    while is_stable(drive, change, below, load_a):
        stable, below = below, below * COARSE
        if stable < highest_hz / 1000.0:
            return stable
    while stable > FINE * below:
        middle = math.sqrt(stable * below)
        stable, below = (middle, below) if is_stable(drive, change, middle, load_a) else (stable, middle)
    return stable


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
