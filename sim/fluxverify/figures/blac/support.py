# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What the figures of vector control share. Runs of the chip are drawn beside the exact model by the same functions."""

from __future__ import annotations

from functools import cache

import numpy as np

from fluxlock.base.paths import ROOT
from fluxlock.config import load_motor
from fluxlock.results.plots import PHASE_COLOURS
from fluxlock.theory.vector.controllers import Kind
from fluxlock.theory.vector.model import Coefficients, SmoothMachine
from fluxlock.theory.vector.study import Bench
from fluxverify.regression.vector.sines import Excited

FAMILY = "blac"
MOTOR_1 = ROOT / "motors" / "motor-1.toml"
FS_HZ = 15e3
CURRENT_A = 10.0
CONTROLLER_COLOURS: dict[Kind, str] = dict(zip(("A", "B", "C"), PHASE_COLOURS, strict=True))
# Ends the condition of a figure without a run of the chip.
ANALYTIC = "Only the analytic curve: exact discrete model, no run of the chip."
THETA = "The thesis shows θ − θ̂, here θ̂ − θ"


@cache
def bench() -> Bench:
    """Motor-I at 15 kHz."""
    return Bench(SmoothMachine.from_motor(load_motor(MOTOR_1)), FS_HZ)


def identified(seen: Excited) -> Coefficients:
    """Phi, Gamma1 and Gamma2 by least squares from currents and voltages that begin from rest."""
    i, u = seen.current, seen.voltage
    before = np.concatenate(([0.0], u[:-1]))
    found = np.linalg.lstsq(np.column_stack([i[:-1], u[:-1], before[:-1]]), i[1:], rcond=None)[0]
    phi, gamma1, gamma2 = (np.asarray(value) for value in found)
    return Coefficients(phi, gamma1, gamma2, np.asarray(np.nan))


def percent(speed: float) -> str:
    """`f_e = 0.05 f_s (750 Hz)`."""
    return f"$f_e$ = {speed:g} $f_s$ ({speed * FS_HZ:g} Hz)"
