# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Unequal mutual inductances of a machine with isolated star point are unequal phase inductances at its terminals."""

from __future__ import annotations

import numpy as np
import pytest

from fluxlock.plant import Plant
from tests.plant.drives import STROBE_CYCLES, motor_1, six_step_gates

SELF_H = (16e-6, 17e-6, 15e-6)
MUTUAL_H = (-9e-6, -7e-6, -5e-6)  # AB, BC, CA
TURN_STROBES = 1000


def equivalent_h() -> tuple[float, float, float]:
    """Phase inductances without mutual ones: L_X' = L_X + M_YZ - M_XY - M_XZ."""
    ab, bc, ca = MUTUAL_H
    la, lb, lc = SELF_H
    return la + bc - ab - ca, lb + ca - ab - bc, lc + ab - bc - ca


def test_mutual_is_phase_inductance() -> None:
    """Currents, terminals and torque of both machines agree through two turns of six-step operation.

    Verifies: PLANT-17
    """
    machines = [
        Plant(motor_1(machine__l_h=l_h, machine__m_h=m_h), seed=1)
        for l_h, m_h in ((SELF_H, MUTUAL_H), (equivalent_h(), (0.0, 0.0, 0.0)))
    ]
    unlike = Plant(motor_1(machine__l_h=SELF_H), seed=1)
    largest = difference = 0.0
    for k in range(1, 2 * TURN_STROBES):
        t = k * STROBE_CYCLES
        for plant in (*machines, unlike):
            plant.step(t, six_step_gates(plant, t, 0.6), 1)
        first, second = machines
        assert first.currents_a == pytest.approx(second.currents_a, abs=1e-7)
        assert first.terminals_v == pytest.approx(second.terminals_v, abs=1e-6)
        assert first.theta_e_rad == pytest.approx(second.theta_e_rad, abs=1e-9)
        largest = max(largest, float(np.abs(first.currents_a).max()))
        difference = max(difference, float(np.abs(first.currents_a - unlike.currents_a).max()))
    assert largest > 5.0
    assert difference > 0.5, "another machine behaves otherwise"
