# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Frequency response of the current loop on the chip: references that are sums of sines, in whole periods."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fluxlock.results.rundata import FloatArray
from fluxlock.theory.vector.model import ComplexArray
from fluxverify.regression.runner import RunFailed, Runner
from fluxverify.regression.vector.current_bench import Ground, Played, Setting, play

PERIOD = 64  # samples
UNBOUND = 0.999  # of the voltage's circle
DRAWS = 200  # of the phases; the smallest peak is taken


@dataclass(frozen=True)
class Response:
    """Current over reference at frequencies over f_s, both signs; largest voltage (V), trips, amplitude (A)."""

    frequency: FloatArray
    h: ComplexArray
    voltage_v: float
    trips: int
    amplitude_a: float = 1.0

    def at(self, sign: int) -> tuple[FloatArray, ComplexArray]:
        """Of one sign of the frequency, by its size."""
        chosen = np.sign(self.frequency) == sign
        order = np.argsort(np.abs(self.frequency[chosen]))
        return np.abs(self.frequency[chosen])[order], self.h[chosen][order]


def sines(tones: Sequence[int], amplitude_a: float, real: bool = False) -> ComplexArray:
    """Two periods of the tones (turns a period, signed), each of the amplitude; always the same.

    real: the second half of the tones are the first ones backwards, and all of it lies on d.
    """
    rng, n = np.random.default_rng(7), np.arange(PERIOD)
    waves = np.exp(2j * np.pi * np.outer(tones, n) / PERIOD)
    angles = rng.random((DRAWS, len(tones)))
    if real:
        half = len(tones) // 2
        angles[:, half:] = -angles[:, :half]
    draws = np.exp(2j * np.pi * angles) @ waves
    best = min(draws, key=lambda wave: float(np.abs(wave).max()))
    return np.asarray(np.tile(amplitude_a * best, 2), dtype=np.complex128)


def _unbound(played: Played, setting: Setting) -> Played:
    """The same; RunFailed if the voltage reached its circle: then the response is not that of the linear loop."""
    most, limit = float(np.abs(played.voltage).max()), Ground.of(setting).limit_v
    if most >= UNBOUND * limit:
        raise RunFailed(f"{setting.name}: the regulators asked for {most:.2f} V of {limit:.2f} V and were bound")
    return played


def measure(runner: Runner, setting: Setting, tones: Sequence[int]) -> Response:
    """Play tones as large as `Ground.amplitude_a` allows; the second period less that of a run without reference."""
    amplitude_a = Ground.of(setting).amplitude_a(sines(tones, 1.0))
    reference = sines(tones, amplitude_a)
    played = _unbound(play(runner, setting, reference, "sines"), setting)
    rest = play(runner, setting, np.zeros_like(reference), "rest-long")
    span = slice(PERIOD - 1, 2 * PERIOD - 1)
    spectrum = np.fft.fft((played.current - rest.current)[span]) / np.fft.fft(reference[span])
    ordered = sorted(tones)
    return Response(
        np.array(ordered, dtype=np.float64) / PERIOD,
        np.asarray(spectrum[np.array(ordered) % PERIOD]),
        float(np.abs(played.voltage).max()),
        played.trips + rest.trips,
        amplitude_a,
    )


@dataclass(frozen=True)
class Excited:
    """Current and voltage at the samples from where the tones begin, less those without tones and the carrier's ripple.

    A, V. amplitude_a: of a tone.
    """

    current: ComplexArray
    voltage: ComplexArray
    amplitude_a: float


def excited(runner: Runner, setting: Setting, tones: Sequence[int]) -> Excited:
    """Play tones as large as `Ground.amplitude_a` allows, from rest, at any delay."""
    amplitude_a = Ground.of(setting).amplitude_a(sines(tones, 1.0))
    reference = sines(tones, amplitude_a)
    played = _unbound(play(runner, setting, reference, "excited", every_event=True), setting)
    rest = play(runner, setting, np.zeros_like(reference), "rest-excited", every_event=True)
    current = (played.current - played.ripple) - (rest.current - rest.ripple)
    return Excited(current, played.voltage - rest.voltage, amplitude_a)


@dataclass(frozen=True)
class Tracking:
    """P and Q of (7.32) at frequencies over f_s; trips; amplitude of a sine and the dead time's band (A)."""

    frequency: FloatArray
    p: ComplexArray
    q: ComplexArray
    trips: int
    amplitude_a: float
    band_a: float

    @property
    def bandwidth(self) -> float:
        """Frequency over f_s at which |P| falls to -3 dB."""
        return _crossing(self.frequency, np.abs(self.p), math.sqrt(0.5))


def tracking(runner: Runner, setting: Setting, tones: Sequence[int]) -> Tracking:
    """Play sines on i_d alone, as large as `Ground.amplitude_a` allows.

    For a delay at which the samples are free of ripple: no other run is taken off.
    """
    ground, both = Ground.of(setting), [*tones, *(-tone for tone in tones)]
    amplitude_a = ground.amplitude_a(sines(both, 0.5, real=True))
    reference = sines(both, amplitude_a / 2, real=True)
    played = _unbound(play(runner, setting, reference, "sines-d"), setting)
    span, bins = slice(PERIOD - 1, 2 * PERIOD - 1), np.array(tones)
    asked = np.fft.fft(reference.real[span])[bins]
    p, q = (np.asarray(np.fft.fft(part[span])[bins] / asked) for part in (played.current.real, played.current.imag))
    return Tracking(bins / PERIOD, p, q, played.trips, amplitude_a, ground.band_a)


def _crossing(x: FloatArray, y: FloatArray, level: float) -> float:
    """First x at which y falls through a level, between points linearly; nan without one."""
    below = np.flatnonzero(y < level)
    if not below.size or below[0] == 0:
        return math.nan
    k = int(below[0])
    return float(x[k - 1] + (x[k] - x[k - 1]) * (y[k - 1] - level) / (y[k - 1] - y[k]))


def phase_bandwidth(response: Response) -> float:
    """Frequency over f_s at which the current lags its reference by 90 degrees; the lower of both signs."""
    found = []
    for sign in (1, -1):
        f, h = response.at(sign)
        lag = np.degrees(np.unwrap(np.angle(h))) * sign
        found.append(_crossing(f, lag, -90.0))
    return min(found)


def phase_margin_deg(response: Response) -> float:
    """Distance of the open loop's phase from 180 degrees where its size is 1; the lesser of both signs (deg)."""
    found = []
    for sign in (1, -1):
        f, h = response.at(sign)
        opened = h / (1.0 - h)
        size, angle = np.log(np.abs(opened)), np.degrees(np.unwrap(np.angle(opened))) * sign
        at = _crossing(f, size, 0.0)
        found.append(180.0 + float(np.interp(at, f, angle)))
    return min(found)
