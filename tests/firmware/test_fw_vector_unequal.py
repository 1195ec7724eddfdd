# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The twin's machine with unequal phases, saliency and a trapezoidal EMF, against equations of the three phases."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fluxlock.config import Motor
from fluxlock.native import vector_kernel as kernel
from fluxlock.native.vector_chip import set_machine

AXES = 2 * np.pi / 3 * np.arange(3)


def motor(**changes: object) -> Motor:
    keys: dict[str, object] = {
        "name": "x",
        "pole_pairs": 3,
        "resistance_ohm": (0.95, 1.0, 1.06),
        "inductance_h": (0.97e-3, 1.0e-3, 1.04e-3),
        "psi_vs": (0.0103, 0.0100, 0.0096),
        "emf": "sinusoidal",
        "inertia_kgm2": 1e-5,
        "rated_current_a": 5.0,
        "max_speed_rpm": 10_000.0,
    }
    return Motor.model_validate(keys | changes)


def shape(m: Motor, x: np.ndarray) -> np.ndarray:
    """EMF of phases over flux and speed, positive torque for positive current where it is positive."""
    if m.emf == "sinusoidal":
        return -np.sin(x)
    ramp = math.radians(180.0 - m.flat_top_deg) / 2
    return -np.interp(
        x % (2 * np.pi), [0, ramp, np.pi - ramp, np.pi + ramp, 2 * np.pi - ramp, 2 * np.pi], [0, 1, 1, -1, -1, 0]
    )


def phases_of(m: Motor, theta: float) -> tuple[np.ndarray, np.ndarray]:
    """Inductance matrix of the phases and its slope over the angle."""
    if m.inductance_q_h is None:
        matrix = np.diag(m.self_inductance_h)
        for k, henry in enumerate(m.mutual_h):
            matrix[k, (k + 1) % 3] = matrix[(k + 1) % 3, k] = henry
        return matrix, np.zeros((3, 3))
    swing = (m.inductance_h[0] - m.inductance_q_h) / 3
    angle = 2 * theta - np.add.outer(AXES, AXES)
    return m.mean_inductance_h * np.eye(3) + swing * np.cos(angle), -2 * swing * np.sin(angle)


def reference(m: Motor, u: complex, theta: float, omega: float, i: np.ndarray, time_s: float) -> np.ndarray:
    """Phase currents after a time: three loop equations with a star point that floats."""
    volts = (u * np.exp(-1j * AXES)).real

    def slope(t: float, now: np.ndarray) -> np.ndarray:
        angle = theta + omega * t
        matrix, change = phases_of(m, angle)
        emf = np.array(m.psi_vs) * omega * shape(m, angle - AXES)
        drop = volts - np.array(m.resistance_ohm) * now - omega * change @ now - emf
        # Unknown: three slopes and the star point's voltage.
        system = np.block([[matrix, np.ones((3, 1))], [np.ones((1, 3)), np.zeros((1, 1))]])
        return np.linalg.solve(system, np.append(drop, 0.0))[:3]

    found = solve_ivp(slope, (0.0, time_s), i, rtol=1e-9, atol=1e-9, max_step=time_s / 50)
    return np.asarray(found.y[:, -1])


MOTORS = {
    "equal": motor(resistance_ohm=(1.0,) * 3, inductance_h=(1e-3,) * 3, psi_vs=(0.01,) * 3),
    "unequal": motor(),
    "mutual": motor(mutual_h=(-0.1e-3, -0.15e-3, -0.2e-3)),
    "salient": motor(inductance_h=(0.8e-3,) * 3, inductance_q_h=1.5e-3),
    "trapezoidal": motor(emf="trapezoidal"),
    "salient-trapezoidal": motor(emf="trapezoidal", inductance_h=(0.8e-3,) * 3, inductance_q_h=1.5e-3),
}


@pytest.mark.parametrize("name", MOTORS)
def test_machine_against_its_phases(name: str) -> None:
    """Currents over 25 us at many angles within 1e-4 A, torque equal to power over speed and reluctance.

    Verifies: POP-03
    """
    m, rng = MOTORS[name], np.random.default_rng(1)
    state = np.zeros(1, kernel.STATE).view(np.recarray)
    plant = np.zeros(1, kernel.MACHINE).view(np.recarray)
    set_machine(plant, m, switch_ohm=0.0)
    plain = (state.view(np.ndarray), plant.view(np.ndarray))
    for theta in rng.uniform(0, 2 * np.pi, 12):
        omega = float(rng.uniform(-3000, 3000))
        u, rotor_a = (complex(*rng.uniform(-10, 10, 2)) for _ in range(2))
        i = (rotor_a * np.exp(1j * (theta - AXES))).real
        state.theta, state.omega, state.i = theta, omega, rotor_a
        torque = kernel.torque_of(*plain)
        change = phases_of(m, theta)[1]
        per_speed = np.array(m.psi_vs) * shape(m, theta - AXES)
        assert torque == pytest.approx(m.pole_pairs * (i @ per_speed + i @ change @ i / 2), abs=1e-9)
        kernel.electric(*plain, u, theta, 25e-6)
        # The state's current is in the frame that the rotor had at the begin of the step.
        after = (complex(state.i[0]) * np.exp(1j * (theta + omega * 25e-6 - AXES))).real
        assert after == pytest.approx(reference(m, u, theta, omega, i, 25e-6), abs=1e-4)
