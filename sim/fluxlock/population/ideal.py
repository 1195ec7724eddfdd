# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The ripple of the speed that a machine has with an ideal drive, which knows the true angle and impresses currents."""

from __future__ import annotations

import math

import numpy as np

from fluxlock.config.motor import RPM_PER_RAD_S, Motor
from fluxlock.population.draw import Method
from fluxlock.results.rundata import FloatArray

POINTS = 720  # of an electrical turn
AXES = 2 * np.pi / 3 * np.arange(3)
# Phase that carries the current in and out in the sectors of a turn that begins at 330 degrees.
HIGH, LOW = (0, 0, 1, 1, 2, 2), (1, 2, 2, 0, 0, 1)


def torque_shape(motor: Motor, angle: FloatArray) -> FloatArray:
    """Torque per ampere of a phase over pole pairs and flux, by the phase's angle."""
    if motor.emf == "sinusoidal":
        return np.asarray(-np.sin(angle))
    ramp = math.radians(180.0 - motor.flat_top_deg) / 2
    corners = [0.0, ramp, math.pi - ramp, math.pi + ramp, 2 * math.pi - ramp, 2 * math.pi]
    return np.asarray(-np.interp(angle % (2 * math.pi), corners, [0.0, 1.0, 1.0, -1.0, -1.0, 0.0]))


def ideal_torque_nm(motor: Motor, method: Method, current: complex) -> FloatArray:
    """Torque over an electrical turn: sinusoidal phase currents (d + jq), or a constant current of the right pair."""
    theta = 2 * math.pi * np.arange(POINTS) / POINTS
    shapes = np.array([psi * torque_shape(motor, theta - axis) for psi, axis in zip(motor.psi_vs, AXES, strict=True)])
    if method == "vector":
        currents = np.array([(current * np.exp(1j * (theta - axis))).real for axis in AXES])
        saliency_h = motor.inductance_q_h - motor.inductance_h[0] if motor.inductance_q_h else 0.0
        reluctance = -1.5 * saliency_h * current.real * current.imag
        return np.asarray(motor.pole_pairs * ((currents * shapes).sum(axis=0) + reluctance))
    sector = (((theta + math.pi / 6) % (2 * math.pi)) / (math.pi / 3)).astype(np.int64) % 6
    # Sector k drives a field at 330 + 60 k degrees: it belongs to rotor angles from 210 + 60 k to 270 + 60 k.
    sector = (sector + 2) % 6
    index = np.arange(POINTS)
    pair = shapes[np.array(HIGH)[sector], index] - shapes[np.array(LOW)[sector], index]
    return np.asarray(motor.pole_pairs * abs(current) * pair)


def ideal_ripple_rpm(motor: Motor, method: Method, rpm: float, current: complex) -> float:
    """Speed from its least to its most (r/min, mechanical)."""
    torque = ideal_torque_nm(motor, method, current)
    step_s = 60.0 / (rpm * motor.pole_pairs) / POINTS
    gained = np.cumsum((torque - torque.mean()) / motor.inertia_kgm2 * step_s)
    return float(np.ptp(gained)) * RPM_PER_RAD_S
