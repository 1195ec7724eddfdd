# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The least speed that a machine holds without a sensor, as `fluxlock motor info` states it."""

from __future__ import annotations

import pytest

from fluxlock.base.paths import ROOT
from fluxlock.config import load_motor
from fluxlock.config.info import derived_values
from fluxlock.config.least_speed import BLIND_SHARE, RESISTANCE_IN_DOUBT, least_six_step_rpm, least_vector_rpm
from fluxlock.config.motor import RPM_PER_RAD_S

MOTOR = load_motor(ROOT / "motors" / "outrunner-7pp.toml")


def test_least_speeds_keep_their_rules() -> None:
    """Six-step: a sector lasts as long as the run-up; vector: doubtful share of R I over the share of the EMF.

    Verifies: POP-02
    """
    stated = {d.key: d.value for d in derived_values(MOTOR)}
    six_step, vector = least_six_step_rpm(MOTOR), least_vector_rpm(MOTOR)
    assert stated["least_six_step_rpm"] == six_step and stated["least_vector_rpm"] == vector
    sector_s = 1.0 / (6 * MOTOR.electrical_hz(six_step))
    assert MOTOR.max_speed_rpm / stated["rated_accel_rpm_per_s"] == pytest.approx(sector_s)
    drop_v = MOTOR.resistance_ohm[0] * MOTOR.rated_current_a
    emf_v = MOTOR.psi_vs[0] * MOTOR.pole_pairs * vector / RPM_PER_RAD_S
    assert RESISTANCE_IN_DOUBT * drop_v == pytest.approx(BLIND_SHARE * emf_v)
