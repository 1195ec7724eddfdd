# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What the six-step cases share."""

from __future__ import annotations

import math

import numpy as np

from fluxlock.cosim.outcome import Run

LOCKED_RMS_DEG = 1.0


def highest_hz(run: Run) -> float:
    """Highest electrical frequency that the rotor reached under control, before the first trip."""
    records = run.data.records
    trips = run.result["trips"]
    end = trips[0]["time_s"] * run.data.clock_hz if trips else math.inf
    return float(np.max(records["omega_e"][records["t_cycle"] < end])) / (2 * math.pi)


def locked(run: Run) -> bool:
    """Whether the crossings carry the machine at the end: forward, commutations within 1 degree rms, no trip."""
    window = run.metrics["locked"]
    rms_deg = window["commutation_error_deg"]["rms"]
    forward = window["speed_rpm"]["min"] > 0
    return not run.result["trips"] and forward and rms_deg is not None and rms_deg < LOCKED_RMS_DEG
