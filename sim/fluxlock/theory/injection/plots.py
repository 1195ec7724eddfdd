# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Figures of the injection's theory."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from fluxlock.results.rundata import FloatArray
from fluxlock.theory.injection.frequency import BoundMap, Choice, Feasible
from fluxlock.theory.six_step.plots import BLUE, GREEN, ORANGE, finish

COLOURS = (BLUE, ORANGE, GREEN, "#7a3fb0", "#888888")


def frequency_figure(title: str, found: Feasible, bounds: BoundMap) -> Figure:
    """The paper's Fig. 4 as a map, and the frequencies f_sw / n against both bounds."""
    figure = Figure(figsize=(12, 4.8), layout="constrained")
    figure.suptitle(title, fontsize=11)
    left, right = figure.subplots(1, 2)
    drawn = left.contourf(bounds.angle_deg, bounds.inductance_percent, bounds.bound_hz, levels=16, cmap="viridis")
    lines = left.contour(
        bounds.angle_deg, bounds.inductance_percent, bounds.bound_hz, levels=8, colors="white", linewidths=0.6
    )
    left.clabel(lines, fmt="%.0f", fontsize=8)
    left.set_title(f"least frequency at {found.speed_rpm:g} r/min, Hz", fontsize=9, loc="left")
    finish(left, "error of the angle / deg", "error of both inductances / %")
    figure.colorbar(drawn, ax=left)
    shown = [c for c in found.choices if c.hz <= 4 * found.strict_hz] or list(found.choices)
    groups: tuple[tuple[str, str, str, list[Choice]], ...] = (
        ("accepted by both", GREEN, "o", [c for c in shown if c.strict]),
        ("nominal only", ORANGE, "s", [c for c in shown if c.nominal and not c.strict]),
        ("rejected by both", "#888888", "x", [c for c in shown if not c.nominal]),
    )
    for label, colour, marker, choices in groups:
        if choices:
            right.plot([c.n for c in choices], [c.hz for c in choices], marker, color=colour, label=label, markersize=5)
    right.axhline(found.nominal_hz, color=BLUE, lw=1, label=f"nominal {found.nominal_hz:.0f} Hz")
    right.axhline(found.strict_hz, color=BLUE, lw=1, ls="--", label=f"strict {found.strict_hz:.0f} Hz")
    right.set_title(f"f_sw / n of {found.carrier_hz:g} Hz", fontsize=9, loc="left")
    finish(right, "n", "injection frequency / Hz")
    right.legend(fontsize=8)
    return figure


def curves_figure(title: str, curves: Mapping[str, tuple[FloatArray, FloatArray]], x: str, y: str) -> Figure:
    """Curves over one axis."""
    figure = Figure(figsize=(8, 4.8), layout="constrained")
    axes = figure.subplots()
    axes.set_title(title, fontsize=10, loc="left")
    for k, (label, (abscissa, ordinate)) in enumerate(curves.items()):
        style = "-" if abscissa.size > 40 else "o-"
        axes.plot(abscissa, ordinate, style, color=COLOURS[k % len(COLOURS)], label=label, lw=1.2, markersize=4)
    finish(axes, x, y)
    axes.legend(fontsize=8)
    return figure


def running_mean(values: FloatArray, count: int) -> FloatArray:
    """Mean over `count` values up to each."""
    total = np.cumsum(np.insert(values, 0, 0.0))
    index = np.arange(1, values.size + 1)
    begin = np.maximum(index - count, 0)
    return np.asarray((total[index] - total[begin]) / (index - begin))
