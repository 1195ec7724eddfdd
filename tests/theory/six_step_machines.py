# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Machines of the six-step tests."""

from __future__ import annotations

from dataclasses import replace

from fluxlock.base.paths import ROOT
from fluxlock.config import Motor, load_motor
from fluxlock.theory.six_step.machine import Machine

SUPPLY_V = 25.0
CARRIER_HZ = 40e3
MOTOR_1: Motor = load_motor(ROOT / "motors" / "motor-1.toml")
SINUSOIDAL = Machine.from_motor(MOTOR_1)
TRAPEZOIDAL = replace(SINUSOIDAL, emf="trapezoidal", line_flux_vs=2e-3)
MOTOR_1_TRAPEZOIDAL: Motor = MOTOR_1.model_copy(update={"emf": "trapezoidal"})
