# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Closed forms of the injection against independent calculations and the specification's numbers."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fluxlock.base.paths import ROOT
from fluxlock.config import load_motor
from fluxlock.config.motor import machine_params
from fluxlock.plant.magnetics import FluxMap
from fluxlock.theory.injection.chain import SEQUENCES, AnalyticHfCurrent, HfMachine, settled_error
from fluxlock.theory.injection.theory import (
    acceleration_lag,
    amplification,
    amplitude,
    cross_coupling_shift,
    dead_time_voltage,
    lag_error,
    largest_delta,
    loop_noise,
    noise_error,
    normalisation,
    reference_phase_error,
    sequence_error,
    sequence_slope,
    sign_grid_phase,
    with_third_plane,
)
from fluxlock.theory.vector.transforms import to_dq

TIAN = HfMachine(r_ohm=1.3, ld_h=6.54e-3, lq_h=8.32e-3)
YU = HfMachine(r_ohm=0.5, ld_h=11.8e-3, lq_h=13.7e-3)
YU_PERIOD_S = 4 * 125e-6


def rest_by_search(machine: HfMachine, lag: float) -> float:
    """Angle of Park, of those near zero, where the current of a voltage that acts `lag` late has no q part."""

    def q(x: float) -> float:
        a = x - lag
        return -math.sin(x) * math.cos(a) / machine.ld_h + math.cos(x) * math.sin(a) / machine.lq_h

    low, high = -math.pi / 4 + lag / 2, math.pi / 4 + lag / 2
    assert q(low) * q(high) < 0
    for _ in range(80):
        middle = (low + high) / 2
        low, high = (middle, high) if q(low) * q(middle) > 0 else (low, middle)
    return low


@pytest.mark.parametrize("machine", [TIAN, YU])
@pytest.mark.parametrize("lag", [-0.03, 1e-4, 0.02, 0.05])
def test_lag(machine: HfMachine, lag: float) -> None:
    """The zero of the q current, found by bisection; amplification is its slope.

    Verifies: INJT-03
    """
    assert lag_error(machine, lag) == pytest.approx(rest_by_search(machine, lag), abs=1e-12)
    if lag == 1e-4:
        assert lag_error(machine, lag) == pytest.approx(-amplification(machine) * lag, rel=1e-4)


def test_specification() -> None:
    """3.7 for Tian's machine; Yu: 2.1 omega T_s held, largest speed 1266 r/min, 0.053 rad at 300 r/min half-step.

    Verifies: INJT-03
    """
    assert amplification(TIAN) == pytest.approx(3.7, abs=0.05)
    assert sequence_slope(TIAN, "held-tian") == pytest.approx(-1.5 * amplification(TIAN))
    assert sequence_slope(YU, "held") == pytest.approx(1.25 - 0.25 * YU.sum_h / YU.difference_h)
    assert sequence_slope(YU, "held") == pytest.approx(-2.1, abs=0.01)
    rpm = largest_delta(YU, "held") / 125e-6 / 9 * 30 / math.pi
    assert rpm == pytest.approx(1266, abs=0.5)
    assert math.isinf(largest_delta(YU, "exact"))
    assert sequence_error(YU, 300 * math.pi / 30 * 9 * 125e-6, "half-step") == pytest.approx(0.053, abs=1e-4)
    assert math.degrees(sign_grid_phase(40)) == 4.5
    assert acceleration_lag(1455.0, 3306.0) == pytest.approx(-0.44, abs=0.001)
    assert dead_time_voltage(200.0, 2e-6, 10_300.0) == pytest.approx(4.12)
    with pytest.raises(ValueError, match="no rest"):
        sequence_error(YU, 0.2, "held")


@pytest.mark.parametrize("delta", [-0.05, 0.006, 0.07])
def test_sequences(delta: float) -> None:
    """Equal to the closed forms in the papers' sign.

    Verifies: INJT-03
    """
    for sequence in SEQUENCES:
        assert sequence_error(YU, delta, sequence) == pytest.approx(-settled_error(YU, delta, sequence), abs=1e-12)


def test_reference_phase() -> None:
    """From phasors: q current of the machine without resistance against a reference turned by phi.

    Verifies: INJT-03
    """
    omega, omega_h, phi = 42.0, 2 * math.pi * 257.5, 0.2
    machine = HfMachine(0.0, TIAN.ld_h, TIAN.lq_h)

    def product(error: float) -> float:
        d, q = machine.phasors(omega, omega_h, error)
        seen_d, seen_q = d * math.cos(error) + q * math.sin(error), q * math.cos(error) - d * math.sin(error)
        reference = seen_d / abs(seen_d) * np.exp(1j * phi)
        return float((seen_q * np.conj(reference)).real)

    low, high = -0.2, 0.2
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if product(low) * product(middle) > 0 else (low, middle)
    assert low == pytest.approx(reference_phase_error(machine, omega, omega_h, phi), rel=0.03)


@pytest.mark.parametrize("error", [-0.2, 0.0, 0.1, 0.6])
def test_amplitude(error: float) -> None:
    """Yu's amplitudes are those of the analytic current; K_norm turns q into the angle.

    Verifies: INJT-03
    """
    current = AnalyticHfCurrent(YU, 0.0, 125e-6)
    angle = 1.0 + error  # of the estimate; the rotor stands at 1
    current.step(60.0, angle, 1.0)
    seen = current.step(60.0, angle, 1.0) * np.exp(-1j * error)
    found = amplitude(YU, 60.0, YU_PERIOD_S, error)
    assert (found.d, found.q) == pytest.approx((seen.real, seen.imag), abs=1e-12)
    assert normalisation(YU, 60.0, YU_PERIOD_S) * found.q == pytest.approx(-math.sin(2 * error) / 2)


def test_noise() -> None:
    """Random phase currents through Park, peak and zeros; then a loop that is stepped.

    Verifies: INJT-03
    """
    rng = np.random.default_rng(1)
    currents = 4.9e-3 * rng.standard_normal((4000, 3, 5))
    planes = to_dq(currents, 0.3)
    angle = normalisation(YU, 60.0, YU_PERIOD_S) * (planes[:, 1] - 0.5 * (planes[:, 0] + planes[:, 2])).imag
    expected = noise_error(YU, 60.0, YU_PERIOD_S, 4.9e-3, 5)
    assert float(angle.std()) == pytest.approx(expected, rel=0.05)
    assert expected == pytest.approx(0.043, abs=0.001)
    kp, ki, rate = 115.0, 3306.0, 4000.0
    theta = speed = total = 0.0
    count = 200_000
    for x in expected * rng.standard_normal(count):
        error = x - theta
        speed += ki / rate * error
        theta += speed / rate + kp / rate * error
        total += theta * theta
    assert math.sqrt(total / count) == pytest.approx(loop_noise(expected, rate, kp, ki), rel=0.1)


@pytest.mark.parametrize("i_q", [-5.0, 0.0, 2.0, 5.0])
def test_cross_coupling(i_q: float) -> None:
    """Least inductance of the plant's incremental matrix; the motor file's curve takes it off; 0.30 rad at 5 A.

    Verifies: INJT-03
    """
    motor = load_motor(ROOT / "motors" / "five-phase-yu.toml")
    assert motor.saturation is not None
    matrix = FluxMap(machine_params(motor)).inductance([0.0, i_q, 0.0, 0.0])[:2, :2]
    _, vectors = np.linalg.eigh(matrix)
    direction = math.atan(vectors[1, 0] / vectors[0, 0])
    shift = cross_coupling_shift(YU, matrix[0, 1])
    assert shift == pytest.approx(direction, abs=1e-9)
    c0, c1, c2, c3 = motor.saturation.angle_rad
    assert shift + c0 + c1 * i_q + c2 * i_q**2 + c3 * i_q**3 == pytest.approx(0.0, abs=1e-5)
    if i_q == 5.0:
        assert shift == pytest.approx(0.30, abs=0.01)


def test_third_plane() -> None:
    """Inverse of the inverse: what an axis shows while plane 3 has no HF voltage.

    Verifies: INJT-03
    """
    found = with_third_plane(TIAN, 0.3e-3, 1.34e-3, 2.06e-3)
    for own, third, shown in ((6.54e-3, 1.34e-3, found.ld_h), (8.32e-3, 2.06e-3, found.lq_h)):
        inverse = np.linalg.inv(np.array([[own, 0.3e-3], [0.3e-3, third]]))
        assert shown == pytest.approx(1 / inverse[0, 0], rel=1e-12)
