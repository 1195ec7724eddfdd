# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Exact discrete model against an integration of the machine in phase variables with latched phase voltages."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from fluxlock.theory.vector.model import (
    PARKS,
    Park,
    SalientMachine,
    Sampling,
    SmoothMachine,
    coefficients,
    emf,
    matrix_coefficients,
    steady_voltage,
)
from fluxlock.theory.vector.transforms import HARMONICS, to_dq, to_phases
from tests.theory.vector_machines import DELAYS, FIVE, FS_HZ, MOTOR_1, THREE, PhaseMachine, subspace

SAMPLES = 6
THETA_0 = 0.7


def followed(machine: PhaseMachine, omega: float, sampling: Sampling, u: dict[int, np.ndarray]) -> dict[int, list]:
    """Dq currents at the samples; every sample's phase voltages are held until the next update."""
    m, lead = machine.phases, omega * (sampling.td_s + sampling.ts_s / 2) if sampling.park == "exact" else 0.0
    theta = lambda k: THETA_0 + omega * k * sampling.ts_s  # noqa: E731
    volts = [sum(to_phases(u[h][k], theta(k - 1) + lead, m, h) for h in u) for k in range(SAMPLES + 1)]
    current = np.zeros(m)
    found: dict[int, list] = {h: [to_dq(current, theta(0), h)] for h in u}
    for k in range(SAMPLES):
        # volts[k]: of the sample before, until the update.
        current = machine.advance(current, volts[k], theta(k), omega, sampling.td_s)
        rest = sampling.ts_s - sampling.td_s
        current = machine.advance(current, volts[k + 1], theta(k) + omega * sampling.td_s, omega, rest)
        for h in u:
            found[h].append(to_dq(current, theta(k + 1), h))
    return found


@pytest.mark.parametrize("park", PARKS)
@pytest.mark.parametrize("delay", DELAYS)
@pytest.mark.parametrize(
    ("machine", "fs_hz", "fe_hz"), [(THREE, FS_HZ, 1500.0), (THREE, FS_HZ, -750.0), (FIVE, 10e3, 300.0)]
)
def test_recurrence_is_the_machine(machine: PhaseMachine, fs_hz: float, fe_hz: float, delay: float, park: Park) -> None:
    """Random voltages: currents of every subspace agree within 1e-9 of the largest, both directions.

    Verifies: VTHEORY-01
    """
    omega, sampling = 2 * math.pi * fe_hz, Sampling.at(fs_hz, delay, park)
    rng = np.random.default_rng(7)
    scale = 10.0 * machine.r_ohm + machine.psi_vs[1] * abs(omega)
    u = {
        h: scale * (rng.uniform(-1, 1, SAMPLES + 1) + 1j * rng.uniform(-1, 1, SAMPLES + 1))
        for h in HARMONICS[machine.phases]
    }
    found = followed(machine, omega, sampling, u)
    for h in u:
        own, speed = subspace(machine, h), h * omega
        model, back = coefficients(own, speed, sampling), emf(own, speed)
        current = [0j]
        for k in range(SAMPLES):
            step = model.gamma1 * u[h][k + 1] + model.gamma2 * u[h][k] + model.gamma_e * back
            current.append(complex(model.phi * current[-1] + step))
        largest = np.abs(current).max()
        assert largest > 0.01
        assert np.abs(np.array(found[h]) - current).max() < 1e-9 * largest, (h, largest)


@pytest.mark.parametrize("delay", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("park", PARKS)
def test_salient(delay: float, park: Park) -> None:
    """Matrix form: a machine with L_d != L_q integrated in the rotor's frame; equal inductances give the complex form.

    Verifies: VTHEORY-01
    """
    machine, omega = SalientMachine(0.05, 30e-6, 75e-6, 2e-3), -2 * math.pi * 900
    sampling = Sampling.at(12e3, delay, park)
    model = matrix_coefficients(machine, omega, sampling)
    rng = np.random.default_rng(3)
    u, now = rng.uniform(-5, 5, (SAMPLES + 1, 2)), np.zeros(2)
    lead = omega * (sampling.td_s + sampling.ts_s / 2) if park == "exact" else 0.0
    back = np.array([0.0, omega * machine.psi_vs])
    exact = np.zeros(2)
    for k in range(SAMPLES):
        for dt, voltage, since in (
            (sampling.td_s, u[k], sampling.ts_s),
            (sampling.ts_s - sampling.td_s, u[k + 1], sampling.td_s),
        ):

            def slope(t: float, i: np.ndarray, v: np.ndarray = voltage, age: float = since) -> np.ndarray:
                latched = complex(*v) * np.exp(1j * (lead - omega * (age + t)))
                return np.array(
                    [
                        (latched.real - machine.r_ohm * i[0] + omega * machine.l_q_h * i[1]) / machine.l_d_h,
                        (latched.imag - machine.r_ohm * i[1] - omega * machine.l_d_h * i[0] - back[1]) / machine.l_q_h,
                    ]
                )

            if dt > 0:
                exact = solve_ivp(slope, (0.0, dt), exact, method="DOP853", rtol=1e-13, atol=1e-13).y[:, -1]
        now = model.phi @ now + model.gamma1 @ u[k + 1] + model.gamma2 @ u[k] + model.gamma_e @ back
        assert np.abs(now - exact).max() < 1e-9 * np.abs(now).max()
    same = matrix_coefficients(SalientMachine(0.05, 30e-6, 30e-6, 2e-3), omega, sampling)
    smooth = coefficients(SmoothMachine(0.05, 30e-6, 2e-3), omega, sampling)
    for name in ("phi", "gamma1", "gamma2", "gamma_e"):
        value = complex(getattr(smooth, name))
        expected = np.array([[value.real, -value.imag], [value.imag, value.real]])
        assert np.abs(getattr(same, name) - expected).max() < 1e-12 * max(abs(value), 1.0), name


def test_coefficients_are_those_of_the_thesis() -> None:
    """(7.17) as printed; T_d = T_s has no Gamma1, T_d = 0 no Gamma2; their sum over all delays turns by omega T_s.

    Verifies: VTHEORY-02
    """
    r, l_h, ts = MOTOR_1.r_ohm, MOTOR_1.l_h, 1 / FS_HZ
    for fe_hz in (750.0, -1500.0):
        omega = 2 * math.pi * fe_hz
        for delay in DELAYS:
            td = delay * ts
            model = coefficients(MOTOR_1, omega, Sampling.at(FS_HZ, delay))
            gamma1 = np.exp(-1j * omega * ts) * (1 - np.exp(-r / l_h * (ts - td))) / r
            gamma2 = np.exp(-2j * omega * ts) * (np.exp(-r / l_h * (ts - td)) - np.exp(-r / l_h * ts)) / r
            assert abs(model.gamma1 - gamma1) < 1e-12 * abs(gamma1 + gamma2)
            assert abs(model.gamma2 - gamma2) < 1e-12 * abs(gamma1 + gamma2)
            assert complex(model.phi) == pytest.approx(np.exp(-(r / l_h + 1j * omega) * ts), rel=1e-13)
            assert complex(model.gamma_e) == pytest.approx((complex(model.phi) - 1) / (r + 1j * omega * l_h), rel=1e-12)
    assert coefficients(MOTOR_1, 1.0, Sampling.at(FS_HZ, 1.0)).gamma1 == 0
    assert coefficients(MOTOR_1, 1.0, Sampling.at(FS_HZ, 0.0)).gamma2 == 0


def test_without_resistance_or_speed() -> None:
    """Limits at R = 0 and at standstill: the integrator T_s / L.

    Verifies: VTHEORY-02
    """
    sampling = Sampling.at(FS_HZ, 0.25)
    model = coefficients(SmoothMachine(0.0, 22e-6, 1e-3), [0.0, 1000.0], sampling)
    assert model.gamma1[0] == pytest.approx(0.75 / FS_HZ / 22e-6)
    assert model.gamma2[0] == pytest.approx(0.25 / FS_HZ / 22e-6)
    assert model.gamma_e[0] == pytest.approx(-1 / FS_HZ / 22e-6)
    assert np.abs(model.phi) == pytest.approx(1.0)
    near = coefficients(SmoothMachine(1e-9, 22e-6, 1e-3), [1e-9, 1000.0], sampling)
    for name in ("gamma1", "gamma2", "gamma_e"):
        assert np.abs(getattr(model, name) - getattr(near, name)).max() < 1e-6


@pytest.mark.parametrize("park", PARKS)
def test_steady_voltage(park: Park) -> None:
    """The voltage that holds a current holds it; with the exact Park it is R i + j omega L i + e but for the sinc.

    Verifies: VTHEORY-02
    """
    sampling, omega = Sampling.at(FS_HZ, 0.5, park), 2 * math.pi * 1500
    model, back = coefficients(MOTOR_1, omega, sampling), emf(MOTOR_1, omega)
    current = 3 + 10j
    u = steady_voltage(model, current, back)
    assert complex(model.phi * current + model.gamma * u + model.gamma_e * back) == pytest.approx(current, abs=1e-12)
    continuous = (MOTOR_1.r_ohm + 1j * omega * MOTOR_1.l_h) * current + complex(back)
    turn = np.angle(complex(u) / continuous)
    lead = omega * 1.0 / FS_HZ
    # What is left is the ripple between the samples: the current at them is not its mean.
    assert abs(turn - (0.0 if park == "exact" else lead)) < math.radians(1.0)


def test_transforms() -> None:
    """Length of a vector is the phases' peak; positive speed is the order A, B, C; subspaces do not see each other.

    Verifies: VTHEORY-03
    """
    theta = np.linspace(0, 2 * np.pi, 17)
    for m, harmonics in HARMONICS.items():
        axes = 2 * np.pi / m * np.arange(m)
        for h in harmonics:
            # lambda_A = psi cos(h theta): a vector on the d axis.
            flux = 0.4 * np.cos(h * (theta[:, np.newaxis] - axes))
            assert np.abs(to_dq(flux, theta, h) - 0.4).max() < 1e-15
            assert np.abs(to_phases(np.full(theta.shape, 0.4), theta, m, h) - flux).max() < 1e-15
            for other in harmonics:
                if other != h:
                    assert np.abs(to_dq(flux, theta, other)).max() < 1e-15
    # EMF of the conventions: e_A = -psi omega sin theta is + j psi omega.
    emf_abc = -np.sin(theta[:, np.newaxis] - 2 * np.pi / 3 * np.arange(3))
    assert np.abs(to_dq(emf_abc, theta) - 1j).max() < 1e-15
    for m, h in ((3, 3), (4, 1), (5, 2)):
        with pytest.raises(ValueError, match=f"{m} phases, subspace {h}"):
            to_dq(np.zeros(m), 0.0, h)


def test_exponential() -> None:
    """Matrix exponential against that of scipy, small and large.

    Verifies: VTHEORY-01
    """
    from fluxlock.theory.vector.model import _expm

    rng = np.random.default_rng(1)
    for size in (0.0, 1e-9, 0.3, 20.0):
        a = size * rng.uniform(-1, 1, (4, 4))
        assert np.abs(_expm(a) - expm(a)).max() < 1e-12 * np.abs(expm(a)).max()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: SmoothMachine(-1.0, 1e-6, 1e-3), "r_ohm = -1"),
        (lambda: SmoothMachine(0.1, 0.0, 1e-3), "l_h = 0: must be finite and above 0"),
        (lambda: SmoothMachine(0.1, math.nan, 1e-3), "l_h = nan"),
        (lambda: Sampling(1e-4, 1.1e-4), r"td_s = 0\.00011: must be in 0 \.\. ts_s"),
        (lambda: Sampling(0.0, 0.0), "ts_s = 0"),
        (lambda: Sampling(1e-4, 0.0, "late"), "park = 'late'"),  # type: ignore[arg-type]
    ],
)
def test_bad_values(make: object, message: str) -> None:
    """Values without meaning are refused with name and range.

    Verifies: VTHEORY-02
    """
    with pytest.raises(ValueError, match=message):
        make()  # type: ignore[operator]
