# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""EMF observer and phase-locked loop against floating point, and closed over the exact discrete plant."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass, replace
from random import Random

import pytest

from fluxlock.firmware.binding import new
from fluxlock.firmware.vector_formats import (
    Complex,
    from_complex,
    model_at,
    observer_gains,
    pll_gains,
    regulator_design,
    to_complex,
)
from fluxlock.headers import CData
from tests.firmware.vector_float import EXACT, GAMMA, HELD, C, Subspace, float_model

SEED = 22
Q30 = 2**30
Q32 = 2**32
MOTOR_1 = Subspace()
# Delay of the plant, delay in the observer, error theta^ - theta in degrees at 750 and 1500 Hz, forward.
WRONG_DELAYS = (
    (0.25, 0.0, 4.63, 9.06),
    (0.5, 0.0, 9.24, 18.11),
    (0.75, 0.0, 13.76, 26.66),
    (0.75, 1.0, -4.69, -8.86),
    (0.5, 1.0, -9.53, -18.68),
    (0.25, 1.0, -14.44, -28.96),
)


def angle_error_deg(estimate_q32: int, exact_turn: float) -> float:
    """Estimate less exact angle, -180..180 degrees."""
    return ((estimate_q32 / Q32 - exact_turn + 0.5) % 1.0 - 0.5) * 360.0


def test_observer_follows_its_float_model(lib: CData) -> None:
    """Random inputs, speeds, drifts, delays and poles: both states within 2e-6 of full scale over 200 samples.

    Verifies: VC-07
    """
    rng = Random(SEED)
    worst = 0.0
    for _ in range(60):
        size = 10 ** rng.uniform(-0.7, 1.3)  # admittances 0.09 to 9
        m = replace(
            MOTOR_1,
            resistance_ohm=MOTOR_1.resistance_ohm * size,
            inductance_h=MOTOR_1.inductance_h * size,
            delay=rng.choice([0.0, 1.0, rng.random()]),
            park=rng.choice([HELD, EXACT]),
        )
        most_v = round(min(size, 1.0) * 2**24)
        speed = m.speed_turn_q36(rng.uniform(-0.2, 0.2))
        p1, p2 = rng.uniform(0.3, 0.9), rng.uniform(0.3, 0.9)
        gains, exact = observer_gains(lib, m.machine(), speed, p1, p2), float_model(m, m.omega(speed))
        g1, g2 = 1 + exact.phi - p1 - p2, (1 - p1) * (1 - p2) / exact.gamma_e
        unit_a, unit_v = 2**25 / m.full_scale_a, 2**25 / m.full_scale_v
        observer = new("emf_observer_t")
        i_hat, e_hat, u_before = 0j, 0j, 0j
        for _ in range(200):
            i17 = Complex(rng.randint(-60_000, 60_000), rng.randint(-60_000, 60_000))
            u25 = Complex(rng.randint(-most_v, most_v), rng.randint(-most_v, most_v))
            i, u = to_complex(i17, unit_a / 256), to_complex(u25, unit_v)
            drift = rng.uniform(-1 / 16, 1 / 16)
            lib.emf_observer_step(observer, gains, i17, round(drift * Q32))
            lib.emf_observer_voltage(observer, gains, u25)
            error = i - i_hat
            i_hat, e_hat = exact.step(i_hat, u, u_before, e_hat) + g1 * error, e_hat + g2 * error
            i_hat -= 1j * drift * exact.phi * i
            u_before = u
            worst = max(
                worst,
                abs(to_complex(observer.current_i_q25, unit_a) - i_hat) / m.full_scale_a,
                abs(to_complex(observer.emf_v_q25, unit_v) - e_hat) / m.full_scale_v,
            )
    print(f"seed {SEED}: worst {worst:.2e} of full scale")
    assert worst < 2e-6


def test_observer_poles_are_the_chosen_ones(lib: CData) -> None:
    """From a wrong EMF the error falls as p^n (1 + n (1-p)/p), a double pole, at any signed speed.

    Verifies: VC-07
    """
    for turns in (-0.1, -0.05, 0.0, 0.05, 0.1):
        for pole in (0.7, 0.9):
            m = replace(MOTOR_1, delay=0.25)
            speed = m.speed_turn_q36(turns)
            gains = observer_gains(lib, m.machine(), speed, pole, pole)
            observer, plant = new("emf_observer_t"), float_model(m, m.omega(speed))
            emf, i = 3.0 + 4.0j, 0j
            for n in range(40):
                left = abs(to_complex(observer.emf_v_q25, 2**25 / m.full_scale_v) - emf) / abs(emf)
                assert left == pytest.approx(pole**n * (1 + n * (1 - pole) / pole), abs=2e-4), (turns, pole, n)
                i17 = from_complex(i, 2**17 / m.full_scale_a)
                lib.emf_observer_step(observer, gains, i17, 0)
                i = plant.step(i, 0j, 0j, emf)


def test_pll_error_is_the_normalised_sine(lib: CData) -> None:
    """For both directions sin(theta - theta^), held at its sign beyond 90 degrees; zero for too small an EMF.

    Verifies: VC-08
    """
    rng = Random(SEED)
    for _ in range(3000):
        backward, delta = rng.random() < 0.5, rng.uniform(-math.pi, math.pi)
        sign = -1 if backward else 1
        emf = from_complex(1j * sign * 10 ** rng.uniform(4, 8) * cmath.exp(1j * delta))
        got = lib.pll_error_q30(emf, sign * rng.randint(1, 10**6), 100) / Q30
        exact = math.sin(delta) if abs(delta) < math.pi / 2 else math.copysign(1.0, delta)
        assert abs(got - exact) < 2e-4, (SEED, backward, delta)
    assert lib.pll_error_q30(Complex(60, 60), 5, 100) == 0
    assert lib.pll_error_q30(Complex(0, 0), 5, 1) == 0
    assert abs(lib.pll_error_q30(Complex(0, -5000), 5, 1)) == Q30


def test_pll_error_with_a_kept_reciprocal(lib: CData) -> None:
    """EMFs that creep and jump in length, by powers of two too: as near to the sine as with a division each time.

    Verifies: VC-08
    """
    rng = Random(SEED)
    reciprocal, length = new("uint32_t"), 1e6
    for k in range(5000):
        length *= rng.choice((0.5, 2.0, 3.0, 1 / 3)) if k % 50 == 49 else 1 + rng.uniform(-0.01, 0.01)
        length = min(max(length, 2e4), 2e8)
        delta = rng.uniform(-0.19, 0.19)
        got = lib.pll_error_from_q30(from_complex(1j * length * cmath.exp(1j * delta)), 1, 100, reciprocal)
        assert abs(got / Q30 - math.sin(delta)) < 2e-4, (SEED, k)


def run_pll(
    lib: CData, gains: CData, start_turn: float, turns: float, rise: float, steps: int, known: float = 1.0
) -> list[float]:
    """Angle errors in degrees of a loop started at angle 0 and `known` of the speed; the rotor makes turns + k rise."""
    period = MOTOR_1.period_cycles
    pll, exact, found = new("pll_t"), start_turn, []
    lib.pll_preset(pll, 0, MOTOR_1.speed_turn_q36(known * turns))
    for k in range(steps):
        angle = lib.pll_angle_turn_q32(pll)
        found.append(angle_error_deg(angle, exact))
        sign = 1 if turns + k * rise >= 0 else -1
        emf = from_complex(1j * sign * 1e7 * cmath.exp(2j * math.pi * (exact - angle / Q32)))
        error = lib.pll_error_q30(emf, lib.pll_speed_turn_q36(pll), 1000)
        lib.pll_step(pll, gains, period, error)
        exact += turns + k * rise
    return found


@pytest.mark.parametrize("order", [2, 3])
def test_pll_locks_from_any_angle_in_both_directions(lib: CData, order: int) -> None:
    """From every 15 degrees, 180 included, and 3 % wrong speed: below 0.01 degrees in 400 samples and it stays there.

    Verifies: VC-08
    """
    for turns in (-0.1, -0.02, 0.02, 0.1):
        for start in range(24):
            gains = pll_gains(0.9, MOTOR_1.period_cycles, order)
            errors = run_pll(lib, gains, start / 24, turns, 0.0, 2000, 0.97)
            assert max(map(abs, errors[400:])) < 0.01, (turns, start)


@pytest.mark.parametrize("known", [0.0, -1.0])
def test_pll_finds_an_unknown_direction(lib: CData, known: float) -> None:
    """From no speed and from the opposite one, at any angle: below 0.01 degrees in 1500 samples.

    Verifies: VC-08
    """
    for turns in (-0.02, 0.02):
        for start in range(24):
            errors = run_pll(lib, pll_gains(0.9, MOTOR_1.period_cycles, 3), start / 24, turns, 0.0, 2000, known)
            assert max(map(abs, errors[1500:])) < 0.01, (turns, start)


def test_third_order_follows_an_acceleration(lib: CData) -> None:
    """Under a constant acceleration a, away from standstill, order 2 lags by a / k_i, order 3 does not.

    Verifies: VC-08
    """
    pole, rise = 0.9, 2e-5
    for sign in (1, -1):
        for order in (2, 3):
            gains = pll_gains(pole, MOTOR_1.period_cycles, order)
            errors = run_pll(lib, gains, 0.0, sign * 0.02, sign * rise, 1000)
            lag = -360.0 * rise / (1 - pole) ** 2 * sign if order == 2 else 0.0
            assert errors[-1] == pytest.approx(lag, abs=0.01), (sign, order)


def test_pll_speed_stays_within_its_limit(lib: CData) -> None:
    """A constant error drives the speed to its limit, not beyond, and the loop leaves it again at once.

    Verifies: VC-08
    """
    gains = pll_gains(0.8, MOTOR_1.period_cycles, 3)
    pll = new("pll_t")
    for sign in (1, -1):
        for _ in range(500):
            lib.pll_step(pll, gains, MOTOR_1.period_cycles, sign * Q30)
        assert lib.pll_speed_turn_q36(pll) == sign * gains.speed_max_turn_q36
        lib.pll_step(pll, gains, MOTOR_1.period_cycles, -sign * Q30)
        assert abs(lib.pll_speed_turn_q36(pll)) < gains.speed_max_turn_q36


def test_angle_step_is_that_of_the_accumulator(lib: CData) -> None:
    """Without error the angle advances as 36 bits that add the speed every clock.

    Verifies: VC-08
    """
    rng = Random(SEED)
    gains = pll_gains(0.9, 1000)
    for _ in range(200):
        start, speed, period = rng.getrandbits(32), rng.randint(-(2**29), 2**29), rng.randint(1, 65535)
        gains.speed_max_turn_q36 = 2**31 - 1
        pll = new("pll_t")
        lib.pll_preset(pll, start, speed)
        for k in range(1, 6):
            lib.pll_step(pll, gains, period, 0)
            assert lib.pll_angle_turn_q32(pll) == ((start * 16 + k * speed * period) % 2**36) >> 4, SEED


@dataclass
class Sensorless:
    """C regulators, observer and loop on the exact plant at constant speed: angle errors and currents by sample."""

    errors_deg: list[float]
    currents: list[complex]


def run_sensorless(
    lib: CData, m: Subspace, observed: Subspace, turns: float, current_a: complex, start_deg: float = 0.0
) -> Sensorless:
    """Run 600 samples with `observed` as the observer's machine; the estimate starts start_deg ahead."""
    speed = m.speed_turn_q36(turns)
    plant, emf = float_model(m, m.omega(speed)), 1j * m.psi_vs * m.omega(speed)
    unit_a, unit_v = 2**17 / m.full_scale_a, 2**25 / m.full_scale_v
    regulator_gains = new("regulator_gains_t")
    design = regulator_design(C, gamma=GAMMA)
    machine, machine_observed = m.machine(), observed.machine()
    assert lib.regulator_design(regulator_gains, design, machine, model_at(lib, machine, speed))
    u = -plant.gamma_e * emf / (plant.gamma1 + plant.gamma2)
    regulator, observer, pll = new("complex_regulator_t"), new("emf_observer_t"), new("pll_t")
    lib.complex_regulator_preset(regulator, from_complex(u, unit_v), Complex(0, 0))
    lib.emf_observer_preset(observer, Complex(0, 0), from_complex(emf, unit_v), from_complex(u, unit_v))
    lib.pll_preset(pll, round(start_deg / 360 * Q32) % Q32, speed)
    loop = pll_gains(0.95, m.period_cycles)
    reference = from_complex(current_a, unit_a)
    exact, i, result = 0.0, 0j, Sensorless([], [])
    for _ in range(600):
        estimate = lib.pll_angle_turn_q32(pll)
        result.errors_deg.append(angle_error_deg(estimate, exact))
        result.currents.append(i)
        turn = cmath.exp(2j * math.pi * (estimate / Q32 - exact))
        measured = from_complex(i / turn, unit_a)
        lib.complex_regulator_step(regulator, regulator_gains, reference, measured, 2**17 - 1)
        gains = observer_gains(lib, machine_observed, lib.pll_speed_turn_q36(pll))
        lib.emf_observer_step(observer, gains, measured, 0)
        lib.emf_observer_voltage(observer, gains, regulator.voltage_v_q25)
        error = lib.pll_error_q30(observer.emf_v_q25, lib.pll_speed_turn_q36(pll), 10_000)
        lib.pll_step(pll, loop, m.period_cycles, error)
        before, u = u, to_complex(regulator.voltage_v_q25, unit_v) * turn
        i = plant.step(i, u, before, emf)
        exact = (exact + speed * m.period_cycles / 2**36) % 1.0
    return result


@pytest.mark.parametrize("case", WRONG_DELAYS)
def test_a_wrong_delay_in_the_observer(lib: CData, case: tuple[float, float, float, float]) -> None:
    """Motoring with 10 A the specification's angle errors within 0.1 degrees, in reverse (i_q < 0) of opposite sign.

    Verifies: VC-09
    """
    delay, assumed, *wanted = case
    m = replace(MOTOR_1, delay=delay)
    for turns, angle in zip((0.05, 0.10), wanted, strict=True):
        for direction in (1, -1):
            run = run_sensorless(lib, m, replace(m, delay=assumed), direction * turns, direction * 10j)
            tail = run.errors_deg[-50:]
            print(f"{delay} -> {assumed}, {direction * turns:+.2f} turn: {tail[-1]:+.3f} deg ({angle})")
            assert max(tail) - min(tail) < 0.02
            assert abs(direction * tail[-1] - angle) < 0.1, (turns, direction)


@pytest.mark.parametrize("park", [HELD, EXACT])
def test_the_right_delay_leaves_no_error(lib: CData, park: str) -> None:
    """At four delays, both speeds and directions, from 60 degrees off: below 0.02 degrees at the end.

    Verifies: VC-09
    """
    for delay in (0.25, 0.5, 0.75, 1.0):
        for turns in (0.05, 0.10, -0.05, -0.10):
            m = replace(MOTOR_1, delay=delay, park=park)
            run = run_sensorless(lib, m, m, turns, 10j, start_deg=60.0)
            assert max(map(abs, run.errors_deg[-50:])) < 0.02, (delay, turns)
            assert abs(run.currents[-1] - 10j) < 0.02
