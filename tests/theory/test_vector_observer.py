# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""EMF observer, phase-locked loop and the sensorless current loop."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from fluxlock.theory.vector.model import PARKS, Park, Sampling, coefficients, emf, steady_voltage
from fluxlock.theory.vector.observer import POLES, Observer, detected_angle, observer_gains, steady_state
from fluxlock.theory.vector.parameters import (
    CHANGES,
    SINGLE,
    Change,
    error_map,
    is_stable,
    lowest_speed_hz,
    on_machine,
    simulated_error,
    worst_case,
)
from fluxlock.theory.vector.pll import (
    ORDERS,
    Order,
    PllGains,
    acceleration_error_rad,
    error_poles,
    pll_gains,
)
from fluxlock.theory.vector.sensorless import (
    Drive,
    bandwidth_limit_hz,
    eigenvalues,
    rest,
    rest_state,
    simulate,
    steady_start,
    step,
)
from tests.theory.vector_machines import FS_HZ, MOTOR_1

# Specification: error theta^ - theta (deg) at i_q = 10 A; columns (T_d, T'_d) over T_s.
PAIRS = ((0.25, 0.0), (0.5, 0.0), (0.75, 0.0), (0.75, 1.0), (0.5, 1.0), (0.25, 1.0))
PRINTED = {
    750.0: (4.63, 9.24, 13.76, -4.69, -9.53, -14.44),
    1500.0: (9.06, 18.11, 26.66, -8.86, -18.68, -28.96),
}
BANDWIDTH_HZ = 100.0
SETTLED = 800  # samples


def drive_at(delay: float, current: complex, park: Park = "held", **changes: object) -> Drive:
    """Motor-I at 15 kHz."""
    made = Drive.usual(MOTOR_1, Sampling.at(FS_HZ, delay, park), current, BANDWIDTH_HZ)
    return replace(made, **changes)  # type: ignore[arg-type]


@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize("speed_hz", PRINTED)
@pytest.mark.parametrize("park", PARKS)
def test_wrong_delay(speed_hz: float, direction: int, park: Park) -> None:
    """The twelve cells within 0.1 deg, in closed form and simulated; backwards mirrored, with either inverse Park.

    Verifies: VTHEORY-09
    """
    omega = direction * 2 * math.pi * speed_hz
    for (delay, believed), printed in zip(PAIRS, PRINTED[speed_hz], strict=True):
        drive = drive_at(delay, direction * 10j, park, believed_delay=believed)
        closed = float(rest(drive, omega, drive.current).error_deg)
        course = simulate(drive, omega, SETTLED)
        assert abs(direction * closed - printed) < 0.1, (delay, believed)
        assert abs(course.error_deg[-1] - closed) < 1e-3, (delay, believed)
        assert np.abs(eigenvalues(drive, omega)).max() < 1.0


@pytest.mark.parametrize("delay", [0.0, 0.25, 0.5, 0.75, 1.0])
def test_right_delay(delay: float) -> None:
    """Without a wrong delay there is no error, at any load and in either direction, generating too.

    Verifies: VTHEORY-09
    """
    for omega in (2 * math.pi * 750, -2 * math.pi * 1500):
        for current in (10j, -10j, -5 + 20j, 0j):
            drive = drive_at(delay, current)
            assert abs(float(rest(drive, omega, current).error_deg)) < 1e-9
            start = steady_start(drive, omega)
            start.error_rad = math.radians(20)
            assert abs(simulate(drive, omega, SETTLED, start=start).error_deg[-1]) < 1e-3


def test_steady_state_by_definition() -> None:
    """The rest put into the equations: observer and machine stand still, and the EMF lies on sgn(omega) j.

    Verifies: VTHEORY-09
    """
    believed_machine = MOTOR_1.changed(r=1.3, l=0.8)
    for omega in (4000.0, -7000.0):
        current = 2 + 12j
        true = coefficients(MOTOR_1, omega, Sampling.at(FS_HZ, 0.4))
        believed = coefficients(believed_machine, omega, Sampling.at(FS_HZ, 0.9))
        found = steady_state(MOTOR_1, true, believed, omega, current)
        back = complex(emf(MOTOR_1, omega)) * np.exp(-1j * math.radians(float(found.error_deg)))
        u = complex(steady_voltage(true, current, back))
        observer = Observer(current, complex(found.emf), u)
        observer.step(believed, observer_gains(believed), current, u)
        assert observer.i == pytest.approx(current, abs=1e-9) and observer.e == pytest.approx(complex(found.emf))
        assert abs(observer.e.real) < 1e-9 and observer.e.imag * omega > 0


def test_poles_of_the_observer() -> None:
    """Its error decays as the poles say: with p1, p2 the recurrence e[k+2] = (p1 + p2) e[k+1] - p1 p2 e[k].

    Verifies: VTHEORY-10
    """
    for omega, poles in ((4000.0, (0.7, 0.7)), (-9000.0, (0.9, 0.9)), (100.0, (0.5 + 0.2j, 0.5 - 0.2j))):
        model = coefficients(MOTOR_1, omega, Sampling.at(FS_HZ, 0.25))
        chosen = observer_gains(model, poles)
        current, back = 10j, complex(emf(MOTOR_1, omega))
        u = complex(steady_voltage(model, current, back))
        observer, errors = Observer(3 + 1j, back * 0.5 + 2, u), []
        for _ in range(12):
            errors.append(observer.i - current)
            observer.step(model, chosen, current, u)
        e, (p1, p2) = np.array(errors), poles
        assert np.abs(e[2:] - (p1 + p2) * e[1:-1] + p1 * p2 * e[:-2]).max() < 1e-9
        assert abs(e[0]) > 5
    with pytest.raises(ValueError, match="inside the unit circle"):
        observer_gains(coefficients(MOTOR_1, 1.0, Sampling.at(FS_HZ, 0.0)), (0.7, 1.0))


def test_detector() -> None:
    """Near lock the detector is theta - theta^ in both directions; without an EMF it is silent.

    Verifies: VTHEORY-10
    """
    for omega in (500.0, -500.0):
        for error in (0.05, -0.1):
            seen = complex(emf(MOTOR_1, omega)) * np.exp(-1j * error)
            assert detected_angle(complex(seen), omega) == pytest.approx(-math.sin(error))
    assert detected_angle(0j, 1.0) == 0.0


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("damping", [0.7, 1.0])
def test_bandwidth_of_the_loop(order: Order, damping: float) -> None:
    """A slow loop's answer to a sinusoid of the angle is -3 dB at the bandwidth; the poles are those of the gains.

    Verifies: VTHEORY-11
    """
    ts, bandwidth = 1 / FS_HZ, 100.0
    gains = pll_gains(order, bandwidth, ts, damping)
    assert np.all(np.abs(error_poles(gains, ts)) < 1.0)
    angle = speed = accel = 0.0
    per_period = round(FS_HZ / bandwidth)
    wave = np.sin(2 * np.pi * np.arange(20 * per_period) / per_period)
    followed = []
    for value in wave:
        followed.append(angle)
        eps = value - angle
        angle, speed, accel = (
            angle + ts * speed + gains.a * eps,
            speed + ts * accel + gains.b * eps,
            accel + gains.c * eps,
        )
    last = np.array(followed[-per_period:])
    amplitude = abs(last @ np.exp(-2j * np.pi * np.arange(per_period) / per_period)) * 2 / per_period
    assert amplitude == pytest.approx(math.sqrt(0.5), rel=0.03)


@pytest.mark.parametrize("order", ORDERS)
def test_loop_in_reverse(order: Order) -> None:
    """With the sign of the speed both directions are alike; without it the loop runs away from lock in reverse.

    Verifies: VTHEORY-11
    """
    ts = 1 / FS_HZ
    gains = pll_gains(order, BANDWIDTH_HZ, ts)
    assert np.abs(error_poles(gains, ts, sign=-1.0)).max() > 1.0
    omega = -2 * math.pi * 750
    for signed in (True, False):
        drive = drive_at(0.5, -10j, pll=gains, signed=signed)
        start = steady_start(drive, omega)
        largest = np.abs(eigenvalues(drive, omega)).max()
        start.error_rad = math.radians(2)
        course = simulate(drive, omega, 600, start=start)
        if signed:
            assert largest < 1.0 and abs(course.error_deg[-1]) < 0.05
        else:
            assert largest > 1.0 and np.abs(course.error_deg).max() > 60


@pytest.mark.parametrize("order", ORDERS)
def test_slow_loop_is_alone(order: Order) -> None:
    """The slowest pole of the whole loop is that of a slow phase-locked loop alone.

    Verifies: VTHEORY-11
    """
    ts, omega = 1 / FS_HZ, -2 * math.pi * 750
    gains = pll_gains(order, 5.0, ts, 0.7)
    drive = drive_at(0.5, -10j, pll=gains)
    slowest = 1 - np.abs(eigenvalues(drive, omega)).max()
    assert slowest == pytest.approx(1 - np.abs(error_poles(gains, ts)).max(), rel=0.05)


def test_fastest_loop() -> None:
    """The largest bandwidth is the boundary: a little offset fades below it and grows above; slower poles allow less.

    Verifies: VTHEORY-11
    """
    omega, limits = 2 * math.pi * 750, []
    for pole in (0.7, 0.9):
        drive = drive_at(0.5, 10j, poles=(pole, pole))
        limits.append(bandwidth_limit_hz(drive, omega, 3))
        for factor, fades in ((0.9, True), (1.1, False)):
            run = replace(drive, pll=pll_gains(3, factor * limits[-1], 1 / FS_HZ))
            start = steady_start(run, omega)
            start.error_rad = 1e-3
            error = np.abs(simulate(run, omega, 1000, start=start).error_deg)
            grown = error[-100:].max() / error[0]
            assert grown < 0.5 if fades else grown > 2.0, (pole, factor)
    print("largest bandwidth (Hz), poles 0.7 and 0.9:", limits)
    assert limits[1] < limits[0] / 2
    assert bandwidth_limit_hz(drive_at(0.5, 10j), omega, 2) == math.inf


def test_acceleration() -> None:
    """Steady acceleration: lag of the second order as the closed form says, none in the third.

    Verifies: VTHEORY-11
    """
    ts, rate = 1 / FS_HZ, 2e3
    found = {}
    for order in ORDERS:
        gains = pll_gains(order, BANDWIDTH_HZ, ts)
        course = simulate(drive_at(0.5, 10j, pll=gains), 3000.0, 1500, accel=lambda _: rate)
        found[order] = course.error_deg[-1], math.degrees(acceleration_error_rad(gains, ts, rate, POLES))
    print("error (deg) at 2e3 rad/s^2, simulated and closed form:", found)
    assert found[2][0] == pytest.approx(found[2][1], abs=0.003) and found[2][1] < -1.0
    assert abs(found[3][0]) < 0.003 and found[3][1] == 0.0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((4, 100.0, 1e-4), "order = 4"),
        ((2, 0.0, 1e-4), "bandwidth_hz = 0: must be above 0, at most 2000"),
        ((3, 3e3, 1e-4), "bandwidth_hz = 3000"),
        ((2, 100.0, 1e-4, 0.1), "damping = 0.1"),
    ],
)
def test_bad_loop(arguments: tuple, message: str) -> None:
    """A loop that cannot be is refused with name and range.

    Verifies: VTHEORY-11
    """
    with pytest.raises(ValueError, match=message):
        pll_gains(*arguments)
    assert PllGains(0.1, 2.0).c == 0.0


SPEEDS_HZ = np.concatenate([np.linspace(75, 1575, 21), -np.linspace(75, 1575, 21)])
LOAD_A = np.linspace(0.0, 30.0, 7)


def test_parameter_errors() -> None:
    """R +-50 %, L +-30 %, psi -10 %: L turns by dL i / psi, R hardly, psi not; an angle everywhere; mirrored backwards.

    Verifies: VTHEORY-12
    """
    drive = drive_at(0.5, 0j)
    for change in SINGLE:
        error = error_map(drive, change, SPEEDS_HZ, LOAD_A)
        half = SPEEDS_HZ.size // 2
        assert np.abs(error[:half] + error[half:]).max() < 1e-9
        if change.l != 1.0:
            expected = np.degrees((change.l - 1.0) * MOTOR_1.l_h * LOAD_A / MOTOR_1.psi_vs)
            assert np.abs(error[:half] - expected).max() < 0.02 * np.abs(expected).max()
        elif change.r != 1.0:
            assert 0.01 < np.abs(error).max() < 1.5
        else:
            assert np.abs(error).max() < 1e-9
    worst = worst_case(drive, CHANGES, SPEEDS_HZ, LOAD_A)
    print("worst:", worst)
    assert worst.lost == 0 and worst.change.l != 1.0 and worst.change.psi == 0.9 and worst.load_a == 30.0


@pytest.mark.parametrize(
    "change", [Change(1.5), Change(0.5), Change(1, 1.3), Change(1, 0.7), Change(1.5, 0.7, 0.9), Change(0.5, 1.3, 0.9)]
)
def test_parameter_errors_simulated(change: Change) -> None:
    """The loop, followed in time, rests where the closed form says, and is stable there.

    Verifies: VTHEORY-12
    """
    drive = drive_at(0.5, 0j)
    for speed_hz, load_a in ((150.0, 30.0), (1575.0, 30.0), (-750.0, 10.0)):
        closed = float(error_map(drive, change, np.array([speed_hz]), np.array([load_a]))[0, 0])
        simulated = simulated_error(drive, change, speed_hz, load_a, 1200)
        assert simulated == pytest.approx(closed, abs=1e-3), (speed_hz, load_a)
        assert is_stable(drive, change, speed_hz, load_a)


def test_lowest_speed() -> None:
    """A resistance believed too high takes EMF away: below a speed the loop swings, far below it has no rest.

    Verifies: VTHEORY-12
    """
    drive, change = drive_at(0.5, 0j), Change(0.5, 1.3, 0.9)
    lowest = lowest_speed_hz(drive, change, 30.0, 1575.0)
    print(f"stable from {lowest:.1f} Hz; right parameters: {lowest_speed_hz(drive, Change(), 30.0, 1575.0):.1f} Hz")
    assert 60 < lowest < 150
    for factor, rests in ((1.1, True), (0.9, False)):
        run = on_machine(drive, change, factor * lowest, 30.0)
        omega = 2 * math.pi * factor * lowest
        start = rest_state(run, omega)
        start.error_rad += math.radians(0.1)
        off = np.abs(simulate(run, omega, 4000, start=start).error_deg - float(rest(run, omega, run.current).error_deg))
        assert (off[-200:].max() < 0.01) == rests, off[-200:].max()
    # Far below, the voltage lost is more than the EMF: no rest at all.
    assert not is_stable(drive, change, 30.0, 30.0)
    with pytest.raises(ValueError, match="no rest"):
        rest_state(on_machine(drive, change, 30.0, 30.0), 2 * math.pi * 30.0)


@pytest.mark.parametrize("park", PARKS)
def test_rest_is_a_fixed_point(park: Park) -> None:
    """The state at rest steps onto itself, with a wrong delay and wrong parameters.

    Verifies: VTHEORY-09
    """
    for omega in (3000.0, -8000.0):
        drive = drive_at(0.4, 3 + 12j, park, believed_delay=0.8, believed=MOTOR_1.changed(r=1.2, l=0.9))
        state = rest_state(drive, omega)
        assert step(drive, state, omega).vector() == pytest.approx(state.vector(), abs=1e-9)
