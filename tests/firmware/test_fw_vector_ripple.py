# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The speed regulator against harmonics of the EMF: the filter alone, then whole drives of the population."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fluxlock.clock import CLOCK_HZ
from fluxlock.firmware.binding import new
from fluxlock.headers import CData
from fluxlock.population.draw import Draw
from fluxlock.population.judge import judge
from fluxlock.population.life import life_of
from fluxlock.population.run import play

Q36 = 2.0**36
CYCLES = 20_000  # clocks between two steps


class FloatNotch:
    """h_n in the frame of n theta, in floating point: docs/theory/vector.md, Harmonics of the EMF."""

    def __init__(self, harmonics: tuple[int, ...]) -> None:
        self.theta = 0.0
        self.speed = 0.0
        self.h = dict.fromkeys(harmonics, 0.0 + 0.0j)

    def step(self, error_hz: float, speed_hz: float) -> float:
        """What is left of the error."""
        turn = self.speed * CYCLES / CLOCK_HZ
        self.theta += turn
        left = error_hz
        for n, h in self.h.items():
            c = np.exp(2j * math.pi * n * self.theta)
            left -= (h * c).real
            mu = 0.1 * 2 * math.pi * n * abs(turn)
            self.h[n] = h + mu * np.conj(c) * left
            left *= 1 - mu / 2
        self.speed = speed_hz + error_hz - left
        return left


def swinging(hz: float, second: float, fourth: float, sixth: float, steps: int) -> tuple[np.ndarray, np.ndarray]:
    """Time and observed speed of a rotor of constant speed whose observed angle swings."""
    t = np.arange(steps) * CYCLES / CLOCK_HZ
    w = 2 * math.pi * hz * t
    return t, hz * (1 + second * np.cos(2 * w + 0.4) + fourth * np.cos(4 * w) + sixth * np.cos(6 * w - 1.0))


@pytest.mark.parametrize("harmonics", [(2, 4, 6), (2, 6)])
@pytest.mark.parametrize("hz", [-20.0, 14.0, 60.0, 85.0])
def test_harmonics_leave_the_error_and_its_mean_stays(lib: CData, hz: float, harmonics: tuple[int, ...]) -> None:
    """4 % of second and 20 % of sixth harmonic: below 1/40 after twenty periods, mean within 0.1 %; as in float.

    Verifies: VC-44
    """
    model, state = FloatNotch(harmonics), new("ripple_t")
    wanted = 1.01 * hz
    steps = round(20 * CLOCK_HZ / CYCLES / abs(hz)) * 2
    _, speeds = swinging(hz, 0.04, 0.1 if 4 in harmonics else 0.0, 0.2, steps)
    which = lib.RIPPLE_ALL if 4 in harmonics else lib.RIPPLE_SECOND_AND_SIXTH
    unit = Q36 / CLOCK_HZ
    left, expected = [], []
    for speed in speeds:
        error = wanted - speed
        left.append(lib.ripple_step(state, round(error * unit), round(speed * unit), CYCLES, which) / unit)
        expected.append(model.step(error, speed))
    late = np.array(left[steps // 2 :])
    assert abs(late.mean() - 0.01 * hz) < 0.001 * abs(hz)
    assert np.std(late) < 0.24 / 40 * abs(hz)
    assert np.max(np.abs(late - expected[steps // 2 :])) < 0.002 * abs(hz)


def test_what_is_slower_passes(lib: CData) -> None:
    """An error at 0.4 of the second harmonic keeps its size within 3 %, its phase by the three notches.

    Verifies: VC-44
    """
    state, hz, unit = new("ripple_t"), 50.0, Q36 / CLOCK_HZ
    t = np.arange(20_000) * CYCLES / CLOCK_HZ
    errors = np.exp(2j * math.pi * 0.4 * 2 * hz * t)
    left = [lib.ripple_step(state, round(e.real * unit), round((hz - e.real) * unit), CYCLES, 3) / unit for e in errors]
    half = len(left) // 2
    gain = 2 * np.mean(np.array(left[half:]) * np.conj(errors[half:]))
    assert abs(abs(gain) - 1.0) < 0.03
    late = sum(math.atan(0.1 * r / (1 - r * r)) for r in (0.4, 0.2, 0.4 / 3))
    assert abs(np.angle(gain)) < 1.15 * late


def test_a_harmonic_beyond_the_steps_fades(lib: CData) -> None:
    """Where a step is more than a quarter of its turn a harmonic is left in the error.

    Verifies: VC-44
    """
    state, unit = new("ripple_t"), Q36 / CLOCK_HZ
    hz = 0.3 / 2 * CLOCK_HZ / CYCLES
    errors = [math.cos(2 * math.pi * 0.3 * k) for k in range(200)]
    left = [lib.ripple_step(state, round(e * unit), round((hz - e) * unit), CYCLES, 3) / unit for e in errors]
    assert left[100:] == pytest.approx(errors[100:], abs=1 / unit)


@pytest.mark.parametrize("index", [1, 27, 45, 66, 68])
def test_lives_are_without_ripple_and_overshoot(index: int) -> None:
    """Swung by phases and trapezoids by 5 to 17 %; overshot by 6 %; swung by dead time; salient and lost at low speed.

    Verifies: VC-45
    """
    life = life_of(Draw.of(1, index), "vector")
    judgement = judge(play(life), life)
    assert not judgement.reasons, judgement.reasons
