"""What several six-step cases measure."""

from __future__ import annotations

import math

import numpy as np

from fluxlock.cosim.outcome import Outcome


def highest_hz(run: Outcome) -> float:
    """Highest electrical frequency that the rotor reached under control, before the first trip."""
    records = run.data.records
    trips = run.result["trips"]
    end = trips[0]["time_s"] * run.data.clock_hz if trips else math.inf
    return float(np.max(records["omega_e"][records["t_cycle"] < end])) / (2 * math.pi)
