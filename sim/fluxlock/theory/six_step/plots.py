# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Figures of the theory as PNG, in the look of a run's plot pages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from fluxlock.results.plots import COMMUTATION_COLOUR, CROSSING_COLOUR, DPI, LATE_COLOUR, PHASE_COLOURS
from fluxlock.results.rundata import FloatArray, IntArray
from fluxlock.theory.six_step.patterns import SECTORS, Chopping, GateSequence
from fluxlock.theory.six_step.soa import SAMPLED_DEG, VISIBLE_DEG, SafeMap
from fluxlock.theory.six_step.soa_study import Study
from fluxlock.theory.six_step.spectrum import Lines
from fluxlock.theory.six_step.spectrum_study import AlignmentSpectrum

BLUE, ORANGE, GREEN = PHASE_COLOURS
GREY = "#888888"
CHOPPING_COLOURS: dict[Chopping, str] = {
    "ON-PWM": BLUE,
    "PWM-ON": ORANGE,
    "H_PWM-L_ON": GREEN,
    "H_ON-L_PWM": LATE_COLOUR,
}
SMALL = 9
LINE_FLOOR = 1e-4  # of Vdc: lines below are not drawn
ORDER_MARGIN = 1.03  # of the highest order: its line stands clear of the frame


def save(figure: Figure, path: Path) -> None:
    """Write a figure; the same figure gives the same bytes."""
    FigureCanvasAgg(figure)
    figure.savefig(path, dpi=DPI, metadata={"Software": None})


def finish(axes: Axes, x: str, y: str) -> None:
    """Labels and grid."""
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.grid(True, alpha=0.3)


def _legend_below(axes: Axes, columns: int) -> None:
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.12), ncols=columns, fontsize=SMALL)


def soa_figure(study: Study) -> Figure:
    """Map of the bound with limits; freewheel angle along the load; torque limits. Empty parts are left out."""
    loaded = bool(study.lines.get("ON-PWM")) and bool(np.any(study.load_nm > 0.0))
    panels = 1 + loaded + bool(study.limits)
    figure = Figure(figsize=(6.5 * panels + 1, 7), layout="constrained")
    carrier_khz = study.settings.carrier_hz / 1e3
    figure.suptitle(
        f"{study.machine.name}, {study.supply_v:g} V, {carrier_khz:g} kHz: freewheeling, safe operating area"
    )
    axes = figure.subplots(1, panels, squeeze=False)[0]
    _map(axes[0], figure, study.bound, study.supply_a, study.simulated)
    if loaded:
        _load_line(axes[1], study)
    if study.limits:
        _torque(axes[-1], study)
    return figure


def _map(
    axes: Axes, figure: Figure, bound: SafeMap, supply_a: FloatArray, simulated: Mapping[Chopping, SafeMap]
) -> None:
    speed, current = bound.speed_rpm / 1e3, bound.current_a
    shown = np.clip(bound.angle_deg, 0.0, 60.0)
    filled = axes.contourf(speed, current, shown, levels=np.arange(0.0, 61.0, 5.0), cmap="viridis", alpha=0.75)
    figure.colorbar(filled, ax=axes, label="upper bound of the freewheel angle / deg el.")
    styles = ((SAMPLED_DEG, "--", "bound 25°"), (VISIBLE_DEG, "-", "bound 30°"))
    for angle, style, label in styles:
        _limit(axes, speed, bound.current_limit_a(angle), style, color="white", linewidth=2, label=label)
    usable = bound.current_limit_a(bound.usable_deg)
    _limit(axes, speed, usable, "-", color=LATE_COLOUR, linewidth=2, label="bound, crossing computed back")
    for chopping, safe in simulated.items():
        limit = safe.current_limit_a(VISIBLE_DEG)
        label = f"switched circuit 30°, {chopping}"
        colour = CHOPPING_COLOURS[chopping]
        _limit(axes, safe.speed_rpm / 1e3, limit, "o-", color=colour, markeredgecolor="white", label=label)
    axes.plot(speed, supply_a, ":", color=COMMUTATION_COLOUR, linewidth=2, label="supply (duty 1)")
    axes.set_ylim(0.0, current[-1])
    axes.set_xlim(speed[0], speed[-1])
    finish(axes, "speed / (1000 r/min)", "current at the commutation / A")
    axes.set_title("safe operating area", fontsize=10, loc="left")
    legend = axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.12), ncols=2, fontsize=SMALL)
    legend.get_frame().set_facecolor("#bbbbbb")


def _limit(axes: Axes, speed: FloatArray, limit: FloatArray, style: str, **look: Any) -> None:  # noqa: ANN401
    """A limit's line, in the legend only where it has a point: a limit that no current reaches is NaN everywhere."""
    if np.isfinite(limit).any():
        axes.plot(speed, limit, style, **look)


def _load_line(axes: Axes, study: Study) -> None:
    shift = -0.004
    for chopping, states in study.lines.items():
        speed = np.array([state.speed_rpm for state in states]) / 1e3 * (1.0 + shift)
        shift = -shift
        low = np.array([state.freewheel_deg.min() for state in states])
        high = np.array([state.freewheel_deg.max() for state in states])
        colour = CHOPPING_COLOURS[chopping]
        axes.errorbar(speed, low, yerr=[np.zeros(low.size), high - low], fmt="none", ecolor=colour, capsize=4)
        axes.plot(speed, high, "-", color=colour, linewidth=1, label=f"switched circuit, {chopping}")
    states = study.lines["ON-PWM"]
    speed = np.array([state.speed_rpm for state in states]) / 1e3
    axes.plot(speed, study.line_bound_deg(), "--", color=COMMUTATION_COLOUR, label="upper bound")
    axes.axhline(VISIBLE_DEG, color="red", linewidth=1, label="30°")
    axes.set_ylim(bottom=0.0)
    currents = axes.twinx()
    currents.plot(speed, [state.current_a.mean() for state in states], color=GREY, linewidth=1)
    currents.set_ylabel("current at the commutation / A", color=GREY)
    currents.set_ylim(bottom=0.0)
    finish(axes, "speed / (1000 r/min)", "freewheel angle / deg el.")
    axes.plot([], [], color=GREY, linewidth=1, label="current (right)")
    axes.set_title("at the load of the motor file; bars: range over the carrier phase", fontsize=10, loc="left")
    _legend_below(axes, 3)


def _torque(axes: Axes, study: Study) -> None:
    for chopping, limit in study.limits.items():
        speed, colour = limit.speed_rpm / 1e3, CHOPPING_COLOURS[chopping]
        for torque, style, label in (
            (limit.visible_nm, "-", "30°"),
            (limit.recovered_nm, "--", "computed back"),
            (limit.supply_nm, ":", "largest"),
        ):
            _limit(axes, speed, torque * 1e3, style, color=colour, label=f"{chopping}, {label}")
    if np.any(study.load_nm > 0.0):
        axes.plot(study.coarse_rpm / 1e3, study.load_nm * 1e3, color=GREY, label="load of the motor file")
    # The limits fall with the speed by more than a decade.
    axes.set_yscale("log")
    finish(axes, "speed / (1000 r/min)", "mean torque / (mN m)")
    axes.set_title("largest torque, periodic state of the switched circuit", fontsize=10, loc="left")
    _legend_below(axes, 3)


def stability_figure(
    n: FloatArray,
    found: Mapping[str, FloatArray],
    closed: Mapping[str, FloatArray],
    examples: Mapping[str, FloatArray],
) -> Figure:
    """Boundaries over N (found by the map, closed form), and examples of the error over the sectors."""
    figure = Figure(figsize=(13, 6), layout="constrained")
    figure.suptitle("ZCD loop: largest freewheel angle with bounded commutation error")
    left, right = figure.subplots(1, 2, width_ratios=(1.6, 1.0))
    colours = dict(zip(found, (BLUE, LATE_COLOUR, GREEN, ORANGE), strict=False))
    for name, boundary in found.items():
        left.plot(n, boundary, ".", markersize=3, color=colours[name], label=f"{name}, map")
        left.plot(n, closed[name], "-", linewidth=0.8, color=COMMUTATION_COLOUR)
    left.plot([], [], "-", color=COMMUTATION_COLOUR, linewidth=0.8, label="closed form")
    finish(left, "carriers a sector N", "freewheel angle / deg el.")
    left.set_ylim(0.0, 65.0)
    left.legend(loc="lower right", fontsize=SMALL)
    for (name, error), colour in zip(examples.items(), (ORANGE, LATE_COLOUR, BLUE, GREEN), strict=False):
        right.plot(np.arange(1, error.size + 1), error, ".-", color=colour, linewidth=0.8, label=name)
    finish(right, "commutation", "lateness / deg el.")
    # A loop that runs away leaves the page; the bounded ones stay readable.
    right.set_ylim(-2.0, 90.0)
    right.legend(loc="upper left", fontsize=SMALL)
    return figure


def stems(axes: Axes, lines: Lines, max_order: float) -> None:
    """Lines as bars on a logarithmic scale, orders 1 + 6 k and others in two colours."""
    size = np.abs(lines.amplitude)
    own = np.abs((lines.order - 1.0) / SECTORS - np.round((lines.order - 1.0) / SECTORS)) < 1e-9
    for some, colour, label in ((own, BLUE, "orders 1 + 6 k"), (~own, ORANGE, "other orders")):
        drawn = some & (size > LINE_FLOOR)
        axes.vlines(lines.order[drawn], LINE_FLOOR, size[drawn], color=colour, linewidth=1.5, label=label)
    axes.set_yscale("log")
    axes.set_ylim(LINE_FLOOR, 5.0)  # room for the legend
    axes.set_xlim(-ORDER_MARGIN * max_order, ORDER_MARGIN * max_order)
    finish(axes, "order (frequency / fundamental)", "line / Vdc")
    axes.legend(loc="upper right", fontsize=SMALL)


def spectrum_figure(title: str, spectra: Sequence[AlignmentSpectrum], max_order: float, start_deg: float) -> Figure:
    """One row per commutation alignment: lines (bars: series, crosses: gates) and gates."""
    figure = Figure(figsize=(13, 3.6 * len(spectra)), layout="constrained")
    figure.suptitle(title)
    grid = figure.subplots(len(spectra), 2, squeeze=False, width_ratios=(1.7, 1.0))
    for (left, right), one in zip(grid, spectra, strict=True):
        stems(left, one.lines, max_order)
        size = np.abs(one.gates.amplitude)
        drawn = (size > LINE_FLOOR) & (np.abs(one.gates.order) <= max_order)
        left.plot(one.gates.order[drawn], size[drawn], "x", color=COMMUTATION_COLOUR, markersize=4, label="gates")
        left.legend(loc="upper right", fontsize=SMALL, ncols=3)
        left.set_title(f"{one.commutation}: weighted distortion {one.distortion:.3f}", fontsize=10, loc="left")
        _pulses(right, one.sequence, start_deg)
    return figure


def draw_gates(axes: Axes, at: FloatArray, gates: IntArray) -> None:
    """Six lanes, filled while on: gates[k] holds from at[k] to at[k + 1]."""
    for switch in range(SECTORS):
        state = (gates >> switch & 1).astype(np.float64)
        lane = SECTORS - 1 - switch
        level = lane + 0.8 * np.append(state, state[-1:])
        axes.fill_between(at, lane, level, step="post", color=PHASE_COLOURS[switch // 2], alpha=0.75, linewidth=0)
    labels = [f"{leg} {side}" for leg in "ABC" for side in ("upper", "lower")]
    axes.set_yticks([SECTORS - 1 - s + 0.4 for s in range(SECTORS)], labels, fontsize=8)


def _pulses(axes: Axes, sequence: GateSequence, start_deg: float) -> None:
    """Gates of the first two turns as lanes; vertical lines: ideal commutations."""
    shown = min(2.0, sequence.length)
    draw_gates(axes, 360.0 * np.append(sequence.at, sequence.length), sequence.gates)
    for angle in np.arange(60.0 - start_deg % 60.0, 360.0 * shown, 60.0):
        axes.axvline(angle, color=GREY, linewidth=0.6, linestyle=":")
    axes.set_xlim(0.0, 360.0 * shown)
    axes.set_xlabel("angle / deg el.; dotted: ideal commutations")


def recorded_figure(title: str, lines: Lines, max_order: float, torque: Lines) -> Figure:
    """Lines of recorded gates, and of the torque below six times the fundamental."""
    figure = Figure(figsize=(13, 8), layout="constrained")
    figure.suptitle(title)
    axes, below = figure.subplots(2, 1)
    stems(axes, lines, max_order)
    below.vlines(torque.order, 0.0, 1e3 * np.abs(torque.amplitude), color=BLUE, linewidth=1.2)
    below.set_ylim(bottom=0.0)
    finish(below, "order", "torque ripple, peak / (mN·m)")
    return figure


def linearity_figure(
    mean: FloatArray, outputs: Mapping[str, FloatArray], errors: Mapping[str, tuple[FloatArray, FloatArray]]
) -> Figure:
    """Output over wanted mean without compensation, and errors over the wanted mean (lowest and highest over N)."""
    figure = Figure(figsize=(13, 5.5), layout="constrained")
    figure.suptitle("CSC: mean of the output against the wanted mean")
    left, right = figure.subplots(1, 2)
    left.plot(mean, mean, color=GREY, linewidth=1, label="wanted")
    colours = (BLUE, ORANGE, GREEN, LATE_COLOUR, CROSSING_COLOUR)
    for (name, output), colour in zip(outputs.items(), colours, strict=False):
        left.plot(mean, output, color=colour, label=name)
    finish(left, "wanted mean", "mean of the output, no compensation")
    _legend_below(left, 3)
    for (name, (low, high)), colour in zip(errors.items(), colours, strict=False):
        right.fill_between(mean, low, high, color=colour, alpha=0.35, label=name)
    finish(right, "wanted mean", "error of the mean, range over N")
    _legend_below(right, 2)
    return figure
