# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Speed loop, torque split, field weakening and the I/f start of the vector firmware, block by block."""

from __future__ import annotations

import cmath
import math
from random import Random

import pytest

from fluxlock.firmware.binding import new
from fluxlock.firmware.block import gain
from fluxlock.firmware.vector_formats import Complex, from_complex, to_complex
from fluxlock.headers import CData
from tests.firmware.vector_float import Subspace

SEED = 23
Q30 = 2**30
Q32 = 2**32
FULL = 2**25


def test_torque_split_has_the_most_torque(lib: CData) -> None:
    """For random saliencies of either sign the split is the best of a fine grid, and its length the amplitude.

    Verifies: VC-10
    """
    rng = Random(SEED)
    for _ in range(300):
        ratio = rng.choice([-1, 1]) * 10 ** rng.uniform(-1, 1.5)
        amplitude = rng.choice([-1, 1]) * rng.uniform(0.05, 1.0)
        got = to_complex(lib.mtpa_current_i_q25(round(amplitude * FULL), round(ratio * FULL)), FULL)
        assert abs(got) == pytest.approx(abs(amplitude), abs=1e-7)

        def torque(i: complex, k: float = ratio) -> float:
            """Torque in units of psi, for L_q - L_d = 1 / k."""
            return i.imag * (1 - i.real / k)

        best = max(
            math.copysign(1, amplitude) * torque(cmath.rect(amplitude, math.pi / 2 + 2 * math.pi * n / 3600))
            for n in range(-900, 901)
        )
        assert math.copysign(1, amplitude) * torque(got) > best * (1 - 1e-6), (SEED, ratio, amplitude)
    assert to_complex(lib.mtpa_current_i_q25(-12345, 0)) == -12345j
    assert to_complex(lib.mtpa_current_i_q25(0, 99)) == 0


def test_field_weakening_settles_at_the_wanted_voltage(lib: CData) -> None:
    """Above the base speed i_d settles where |u| is the wanted one; below it returns to the highest i_d; limits hold.

    Verifies: VC-11
    """
    m = Subspace(full_scale_a=120.0)
    unit_a, unit_v, wanted_v = FULL / m.full_scale_a, FULL / m.full_scale_v, 10.0
    for sign in (1, -1):
        settings = new(
            "field_weakening_settings_t",
            ki=gain(0.02 * 32 * unit_a / unit_v / 0.1),
            wanted_v_q25=round(wanted_v * unit_v),
            lowest_i_q25=round(-60.0 * unit_a),
        )
        state = new("field_weakening_t")
        for omega, weak in ((2 * math.pi * 1000, False), (2 * math.pi * 1700, True), (2 * math.pi * 1000, False)):
            i_d = 0.0
            for _ in range(4000):
                i = i_d + 5j * sign
                u = (m.resistance_ohm + 1j * sign * omega * m.inductance_h) * i + 1j * sign * omega * m.psi_vs
                i_d = lib.field_weakening_step(state, settings, from_complex(u, unit_v), 0) / unit_a
            if weak:
                assert abs(u) == pytest.approx(wanted_v, abs=1e-3)
                assert -60.0 < i_d < 0.0
            else:
                assert i_d == 0.0
        for _ in range(4000):
            i_d = lib.field_weakening_step(state, settings, from_complex(25.0, unit_v), 0) / unit_a
        assert i_d == pytest.approx(-60.0, abs=1e-4)
        top = lib.field_weakening_step(state, settings, Complex(0, 0), round(-60.5 * unit_a))
        assert top / unit_a == pytest.approx(-60.5, abs=1e-4)


def test_current_that_is_left(lib: CData) -> None:
    """The rest beside i_d is the floor of the root, zero where i_d takes all.

    Verifies: VC-12
    """
    rng = Random(SEED)
    for _ in range(2000):
        most, other = rng.getrandbits(26), rng.choice([-1, 1]) * rng.getrandbits(26)
        wanted = math.isqrt(max(most**2 - other**2, 0))
        assert lib.current_rest_i_q25(most, other) == wanted, (SEED, most, other)


def test_speed_loop_settles_and_leaves_its_limit(lib: CData) -> None:
    """On an inertia with a load the loop settles without error both ways, within the limit, and does not wind up.

    Verifies: VC-12
    """
    clock, period, bandwidth, per_amp = 50e6, 2500, 2 * math.pi * 20.0, 1.5e-3 / 5e-7  # rad/s^2 an ampere
    unit_speed, unit_a = 2**36 / clock / (2 * math.pi), FULL / 50.0
    ts = period / clock
    kp = bandwidth / per_amp * unit_a / unit_speed
    gains = new("pi_gains_t", gain(kp), gain(kp * bandwidth / 4 * ts * 32))
    limit = round(20.0 * unit_a)
    for sign in (1, -1):
        state, omega, largest = new("pi_state_t"), 0.0, 0.0
        target, load = sign * 4000.0, sign * 5.0
        for _ in range(6000):
            result = lib.vector_speed_step(
                state, gains, round(target * unit_speed), round(omega * unit_speed), 0, limit
            )
            assert abs(result.output) <= limit
            omega += (result.output / unit_a - load) * per_amp * ts
            largest = max(largest, sign * omega)
        assert omega == pytest.approx(target, abs=0.5)
        assert largest < 4000 * 1.1
        lib.vector_speed_preset(state, gains, round(4000 * unit_speed), round(3900 * unit_speed), 77_777)
        first = lib.vector_speed_step(state, gains, round(4000 * unit_speed), round(3900 * unit_speed), 0, limit)
        assert first.output == pytest.approx(77_777, abs=1)


def test_speed_loop_leaves_its_limit_without_an_integral_to_undo(lib: CData) -> None:
    """A reference far away, either way, with unequal limits and a load: at the limit, then there as from a small step.

    Verifies: VC-12
    """
    clock, period, bandwidth, per_amp = 50e6, 10_000, 2 * math.pi * 20.0, 4000.0  # rad/s^2 an ampere
    unit_speed, unit_a = 2**36 / clock / (2 * math.pi), FULL / 50.0
    ts = period / clock
    kp = bandwidth / per_amp * unit_a / unit_speed
    gains = new("pi_gains_t", gain(kp), gain(kp * bandwidth / 4 * ts * 32))
    low, high = round(-10.0 * unit_a), round(20.0 * unit_a)
    for begin, end, load, ahead in ((1500.0, 50.0, 3.0, -10.0), (50.0, 1500.0, 3.0, 20.0), (1500.0, 50.0, 0.0, 0.0)):
        state, omega, target = new("pi_state_t"), begin, begin
        speeds, currents = [], []
        for step in range(4000):
            if step == 1000:
                target = end
            far = step >= 1000 and abs(omega - end) > 600.0
            result = lib.vector_speed_between(
                state, gains, round((target - omega) * unit_speed), round((ahead if far else 0.0) * unit_a), low, high
            )
            assert low <= result.output <= high
            currents.append(result.output / unit_a)
            omega += (result.output / unit_a - load) * per_amp * ts
            speeds.append(omega)
        assert currents[1005] == pytest.approx(20.0 if end > begin else -10.0, abs=0.01)
        assert speeds[-1] == pytest.approx(end, abs=0.5)
        beyond = max((s - end) * (1 if end > begin else -1) for s in speeds[1000:])
        assert beyond < 0.1 * abs(end - begin), beyond


def test_fade(lib: CData) -> None:
    """One step at a time, exactly to the end, also across the whole range.

    Verifies: VC-13
    """
    assert [lib.fade(a, b, 10) for a, b in ((0, 25), (20, 25), (25, 25), (0, -25), (-20, -25))] == [
        10,
        25,
        25,
        -10,
        -25,
    ]
    assert lib.fade(-(2**31), 2**31 - 1, 1) == -(2**31) + 1
    assert lib.fade(2**31 - 1, -(2**31), 2**31 - 1) == 0


def test_forced_start_aligns_then_accelerates(lib: CData) -> None:
    """Current first, then the pause, then the ramp at its slope, to either sign and through zero.

    Verifies: VC-13
    """
    settings = new(
        "if_settings_t",
        current_i_q25=1000,
        rise_i_q25=10,
        align_ticks=50,
        acceleration_turn_q44=123_456,
        minimum_v_q25=1,
        tolerance_turn_q32=1,
        steady_ticks=1,
    )
    state = new("if_start_t")
    lib.if_begin(state)
    target = 10_000
    for tick in range(1, 150):
        assert not lib.if_step(state, settings, target)
        assert state.current_i_q25 == min(10 * tick, 1000)
        assert lib.if_speed_turn_q36(state) == 0
    for wanted in (target, -target):
        start, ticks = state.speed_turn_q44, 0
        while not lib.if_step(state, settings, wanted):
            ticks += 1
            slope = 123_456 if wanted > 0 else -123_456
            assert state.speed_turn_q44 == start + ticks * slope
        assert lib.if_speed_turn_q36(state) == wanted


def test_ready_only_when_steady_and_within_reach(lib: CData) -> None:
    """The rotor's angle in the frame from the EMF, both directions; small EMF, movement and 90 degrees begin anew.

    Verifies: VC-13
    """
    none = (0, 31)
    tolerance = round(0.01 * Q32)
    settings = new(
        "if_settings_t",
        damping=none,
        smooth_q16=65536,
        minimum_v_q25=10_000,
        tolerance_turn_q32=tolerance,
        steady_ticks=5,
    )
    for sign in (1, -1):
        state = new("if_start_t", speed_turn_q44=sign * 10**6)

        def ready(degrees: float, length: float = 1e6, state: CData = state, sign: int = sign) -> bool:
            """One tick with the rotor so many degrees ahead of the frame."""
            emf = from_complex(1j * sign * length * cmath.exp(1j * math.radians(degrees)))
            lib.if_current_i_q25(state, settings, emf, 0)
            return bool(lib.if_ready(state, settings))

        assert [ready(-40.0 * sign) for _ in range(6)] == [False] * 5 + [True]
        assert state.turn_q32 / Q32 * 360 == pytest.approx(-40.0 * sign, abs=1e-3)
        assert not ready(-60.0 * sign)
        assert [ready(-60.0 * sign) for _ in range(5)][-1]
        assert not ready(-64.0 * sign)
        assert not any(ready((-60.0 + creeping) * sign) for creeping in range(12))
        assert not ready(-60.0 * sign)
        assert [ready(-60.0 * sign) for _ in range(5)][-1]
        assert not ready(-60.0 * sign, length=5000.0)
        assert not any(ready(-100.0 * sign) for _ in range(10))


def test_swing_is_damped_by_the_emf_across_the_current(lib: CData) -> None:
    """Against the EMF beyond that of the frame's speed, at most 0.4 of the current; on -q when the alignment begins.

    Verifies: VC-50
    """
    settings = new("if_settings_t", damping=(2**30, 31), smooth_q16=2**14, align_ticks=100, turned_ticks=50)
    due, current = 40_000, 100_000
    state = new("if_start_t", current_i_q25=current, aligned_ticks=100)
    for emf, across in ((30_000, 5_000), (60_000, -10_000), (400_000, -40_000), (-400_000, 40_000)):
        for _ in range(100):
            wanted = lib.if_current_i_q25(state, settings, Complex(7_000, emf), due)
        assert wanted.re == current
        assert wanted.im == pytest.approx(across, abs=4)
        assert state.damping_i_q25 == wanted.im
    first = new("if_start_t", current_i_q25=current, aligned_ticks=49)
    assert lib.if_current_i_q25(first, settings, Complex(40_000, 9), 0).im == -current
    assert lib.if_current_i_q25(first, settings, Complex(40_000, 9), 0).re == pytest.approx(-8_750, abs=4)


def test_acceleration_is_what_the_load_angle_leaves(lib: CData) -> None:
    """Whole from cos x = 0.85 on, none below 0.5.

    Verifies: VC-50
    """
    for cosine, share in ((1.0, 1.0), (0.85, 1.0), (0.675, 0.5), (0.5, 0.0), (0.1, 0.0), (-1.0, 0.0)):
        assert lib.if_share_q16(round(cosine * 10**6), 10**6) / 65536 == pytest.approx(share, abs=1e-3)


def test_turning_the_frame_keeps_the_vectors(lib: CData) -> None:
    """Regulator and observer turned by an angle and back hold what they held, to two units.

    Verifies: VC-13
    """
    rng = Random(SEED)
    for _ in range(200):
        numbers = [rng.randint(-(2**24), 2**24) for _ in range(6)]
        regulator = new("complex_regulator_t", Complex(*numbers[:2]), Complex(numbers[2] >> 8, numbers[3] >> 8))
        observer = new("emf_observer_t", Complex(*numbers[:2]), Complex(*numbers[2:4]), Complex(*numbers[4:]))
        turn = rng.getrandbits(32)
        held = [to_complex(z) for z in (regulator.voltage_v_q25, observer.current_i_q25, observer.emf_v_q25)]
        lib.complex_regulator_turn(regulator, lib.cis_q30(-turn % Q32))
        lib.emf_observer_turn(observer, lib.cis_q30(-turn % Q32))
        rotation = cmath.exp(-2j * math.pi * turn / Q32)
        turned = [to_complex(z) for z in (regulator.voltage_v_q25, observer.current_i_q25, observer.emf_v_q25)]
        assert all(abs(a * rotation - b) < 2 for a, b in zip(held, turned, strict=True)), SEED
        before = to_complex(Complex(numbers[2] >> 8, numbers[3] >> 8)) * rotation
        assert abs(to_complex(regulator.error_i_q17) - before) < 2
        before = to_complex(Complex(*numbers[4:])) * rotation
        assert abs(to_complex(observer.voltage_v_q25) - before) < 2
    assert lib.if_turn_back_q32(Complex(0, -5)) == -(2**30)
