# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Figures of the vector theory."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from fluxlock.results.rundata import FloatArray
from fluxlock.theory.six_step.plots import finish

COLUMNS = 4


def parameter_figure(title: str, speeds_hz: FloatArray, load_a: FloatArray, maps: Mapping[str, FloatArray]) -> Figure:
    """Maps of the angle error [speeds, loads] (deg), one panel a change, on one scale; white: no angle."""
    rows = -(-len(maps) // COLUMNS)
    figure = Figure(figsize=(3.4 * COLUMNS + 1, 2.9 * rows), layout="constrained")
    figure.suptitle(f"Angle error of the observer: {title}", fontsize=11)
    grid = figure.subplots(rows, COLUMNS, squeeze=False, sharex=True, sharey=True)
    largest = float(np.ceil(max(float(np.nanmax(np.abs(error))) for error in maps.values())))
    levels = np.linspace(-largest, largest, 22)  # a band of its own around 0
    for axes, (name, error) in zip(grid.flat, maps.items(), strict=False):
        drawn = axes.contourf(speeds_hz, load_a, error.T, levels=levels, cmap="RdBu_r")
        axes.set_title(name, fontsize=9, loc="left")
        finish(axes, "f_e / Hz", "i_q / A")
    for axes in grid.flat[len(maps) :]:
        axes.set_axis_off()
    figure.colorbar(drawn, ax=list(grid.flat), format="%.1f", label="estimate less truth / deg el.")
    return figure
