# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The turns of a first start as a plot."""

from __future__ import annotations

from matplotlib.figure import Figure

from fluxlock.first_start.turn import Record
from fluxlock.theory.six_step.plots import finish


def turns_figure(record: Record, limit_a: float, title: str) -> Figure:
    """Speed beside its target (r/min) and current beside its limit (A), over time (s)."""
    page = Figure(figsize=(9, 5.5), layout="constrained")
    page.suptitle(f"{title}: first turn and step of the speed, as the console tells them", fontsize=11)
    speed, current = page.subplots(2, 1, sharex=True)
    speed.step(record.time_s, record.target_rpm, where="post", label="target", linewidth=1)
    speed.plot(record.time_s, record.speed_rpm, label="measured")
    speed.legend(fontsize=8)
    finish(speed, "", "speed / r/min")
    current.plot(record.time_s, record.current_a, label="current of the machine")
    current.axhline(limit_a, color="tab:red", linewidth=1, linestyle="--", label="limit")
    current.legend(fontsize=8)
    finish(current, "time / s", "current / A")
    return page
