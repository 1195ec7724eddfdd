# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Open phases from the phase currents: none where all are sound, each one within an electrical turn."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from random import Random

import pytest

from fluxlock.firmware.binding import new
from fluxlock.headers import CData

SEED = 57
TURN = 2 * math.pi
FULL_Q17 = 2**17
LIMIT_RAD = math.radians(60)
Currents = Callable[[float], list[float]]


@cache
def settings() -> CData:
    """What counts as open: a share of the expected current, above a least one, over an angle."""
    return new(
        "open_phase_settings_t",
        share_q16=round(0.15 * 2**16),
        minimum_i_q17=round(0.05 * FULL_Q17),
        turn_q32=round(LIMIT_RAD / TURN * 2**32),
    )


def sound(phases: int, amplitude: float, third: float, lead: float) -> Currents:
    """Fundamental and a share of the third harmonic at an angle ahead of the rotor."""
    step = TURN / phases
    return lambda theta: [
        amplitude * (math.cos(theta + lead - k * step) + third * math.cos(3 * (theta + lead - k * step)))
        for k in range(phases)
    ]


def without(currents: Currents, lost: int) -> Currents:
    """The same fundamental with phase `lost` open: subspace 3 along its axis takes its current away."""

    def found(theta: float) -> list[float]:
        i = currents(theta)
        step = TURN / len(i)
        return [x - i[lost] * math.cos(3 * (lost - k) * step) for k, x in enumerate(i)]

    return found


def opened(currents: list[float], lost: int, before: int = -1) -> list[float]:
    """A phase opens, after another one or none: the others take its current over, in equal parts."""
    left = [k for k in range(len(currents)) if k not in (lost, before)]
    return [x + currents[lost] / len(left) if k in left else 0.0 for k, x in enumerate(currents)]


def sample(lib: CData, state: CData, rng: Random, currents: list[float], amplitude: float, theta: float) -> int:
    """One step with noise of the converter."""
    codes = [round(x * FULL_Q17 + rng.gauss(0, 64)) for x in currents]
    values = [*codes, *[0] * (5 - len(codes))]
    angle = round(theta / TURN * 2**32) % 2**32
    return int(lib.open_phase_step(state, settings(), values, len(codes), round(abs(amplitude) * FULL_Q17), angle))


@pytest.mark.parametrize("phases", [3, 5])
def test_sound_phases(lib: CData, phases: int) -> None:
    """Random speeds both ways, currents and third harmonics; through zero and at a standstill nothing is found.

    Verifies: INJC-13
    """
    rng = Random(SEED)
    for _ in range(150):
        state = new("open_phase_t")
        lib.open_phase_begin(state)
        step = rng.choice((0.0, 0.001, 0.1, 0.3, 0.7)) * rng.choice((-1, 1))
        third, lead = rng.uniform(-0.2, 0.2) if phases == 5 else 0.0, rng.uniform(-math.pi, math.pi)
        theta = rng.uniform(0, TURN)
        for n in range(400):
            amplitude = 0.6 * math.cos(n / 60)  # torque reversals
            theta += step
            assert sample(lib, state, rng, sound(phases, amplitude, third, lead)(theta), amplitude, theta) == 0, SEED


def test_shaking_rotor(lib: CData) -> None:
    """An angle that swings by up to 20 degrees about that at which a sound phase has no current tells nothing.

    Verifies: INJC-13
    """
    rng = Random(SEED)
    for _ in range(20):
        state = new("open_phase_t")
        lib.open_phase_begin(state)
        for _ in range(2000):
            theta = 0.3 + math.radians(rng.uniform(-10, 10))
            currents = sound(5, 0.5, 0.0, math.pi / 2)(0.0)
            assert sample(lib, state, rng, currents, 0.5, theta) == 0, SEED


@pytest.mark.parametrize("phases", [3, 5])
def test_open_phase_is_found(lib: CData, phases: int) -> None:
    """Any phase, from any angle: found within 0.75 of a turn, alone, and kept; with five phases a second one too.

    Verifies: INJC-13
    """
    rng = Random(SEED)
    largest = 0.0
    for _ in range(200):
        state = new("open_phase_t")
        lib.open_phase_begin(state)
        step, amplitude = rng.choice((0.02, 0.2, 0.6)) * rng.choice((-1, 1)), rng.uniform(0.1, 0.6)
        lost, theta = rng.randrange(phases), rng.uniform(0, TURN)
        whole = sound(phases, amplitude, 0.0, rng.uniform(-math.pi, math.pi))
        broken = without(whole, lost) if phases == 5 else whole
        for _ in range(rng.randrange(5, 40)):
            theta += step
            assert sample(lib, state, rng, whole(theta), amplitude, theta) == 0, SEED
        begun = theta
        mask = 0
        while mask == 0:
            theta += step
            mask = sample(lib, state, rng, opened(broken(theta), lost), amplitude, theta)
            assert abs(theta - begun) < 0.75 * TURN, SEED
        largest = max(largest, abs(theta - begun))
        assert mask == 1 << lost, SEED
        if phases == 3:
            continue
        for _ in range(round(3 * TURN / abs(step))):
            theta += step
            assert sample(lib, state, rng, broken(theta), amplitude, theta) == 1 << lost, SEED
        second = (lost + rng.randrange(1, phases)) % phases
        begun = theta
        while mask == 1 << lost:
            theta += step
            mask = sample(lib, state, rng, opened(broken(theta), second, lost), amplitude, theta)
            assert abs(theta - begun) < 0.75 * TURN, SEED
        assert mask == 1 << lost | 1 << second, SEED
    print(f"seed {SEED}: found within {math.degrees(largest):.0f} degrees")


def by_rest(phases: int, ratio: float, axis: float, amplitude: float, lost: int | None) -> list[list[float]]:
    """Amplitudes of the phase currents under waves at 0 and an eighth turn; ratio: of the axes' inductances."""
    step = TURN / phases

    def conductance(x: float, y: float) -> float:
        return math.cos(x - axis) * math.cos(y - axis) + math.sin(x - axis) * math.sin(y - axis) / ratio

    found = []
    for wave in (0.0, TURN / 8):
        i = [amplitude * conductance(wave, k * step) for k in range(phases)]
        if lost is not None:
            # Its terminal goes along until no current is left.
            push = i[lost] / conductance(lost * step, lost * step)
            i = [x - push * conductance(lost * step, k * step) for k, x in enumerate(i)]
        found.append(i)
    return found


@pytest.mark.parametrize("phases", [3, 5])
def test_phases_of_a_rotor_at_rest(lib: CData, phases: int) -> None:
    """Two waves, a machine with axes of 1 to 4 anywhere, sensors off by up to an LSB: none, or the one that is open.

    The currents of both axes are at least 20 times the noise.

    Verifies: INJC-20
    """
    rng = Random(SEED)
    print(f"seed {SEED}")
    for life in range(400):
        lost = None if life % 2 else rng.randrange(phases)
        ratio, axis, amplitude = rng.uniform(1.0, 4.0), rng.uniform(0.0, TURN / 2), rng.uniform(0.01, 0.08)
        state = new("open_phase_t")
        for wave, i in enumerate(by_rest(phases, ratio, axis, ratio * amplitude, lost)):
            for sign in (1, -1) * 60:
                codes = [round((sign * x + 0.0001 * k) * FULL_Q17 + rng.gauss(0, 64)) for k, x in enumerate(i)]
                lib.open_phase_note(state, [*codes, *[0] * (5 - phases)], phases, wave)
        found = lib.open_phase_judge(state, phases)
        assert found == (0 if lost is None else 1 << lost), (life, lost, ratio, math.degrees(axis), amplitude)


@pytest.mark.parametrize("phases", [3, 5])
def test_stuck_channel_is_no_open_phase(lib: CData, phases: int) -> None:
    """A channel that shows nothing while its phase carries current: the sum tells, and no phase is called open.

    Verifies: INJC-13
    """
    rng = Random(SEED)
    for _ in range(100):
        state = new("open_phase_t")
        lib.open_phase_begin(state)
        step, amplitude = rng.choice((0.02, 0.2, 0.6)) * rng.choice((-1, 1)), rng.uniform(0.1, 0.6)
        stuck, theta = rng.randrange(phases), rng.uniform(0, TURN)
        currents = sound(phases, amplitude, 0.0, rng.uniform(-math.pi, math.pi))
        for _ in range(round(3 * TURN / abs(step))):
            theta += step
            i = currents(theta)
            i[stuck] = 0.0
            assert sample(lib, state, rng, i, amplitude, theta) == 0, SEED
