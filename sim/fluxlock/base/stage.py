# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""How far a run is, as those who run it tell those who show it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

BUILDING = "building"  # what the phases before a simulation begin with, followed by what is built
SIMULATING = "simulating"
PLOTTING = "plotting"  # the one after it


@dataclass(frozen=True)
class ProgressInfo:
    """State of a running simulation, for the progress bar."""

    t_s: float
    duration_s: float
    speed_rpm: float
    rate_cycles_per_s: float
    phase: str


Progress = Callable[[ProgressInfo], None]


def tell_building(progress: Progress | None, duration_s: float, what: str) -> None:
    """Say what is built before a simulation of this length."""
    if progress is not None:
        progress(ProgressInfo(0.0, duration_s, 0.0, 0.0, f"{BUILDING} {what}"))
