# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Draws the pages of a run as PNG: `overview.png` shows the whole run and a zoomed span, `zoom.png` the span alone."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from fluxlock.config.scenario import Scenario
from fluxlock.results.angles import FLOATING_PHASE, dq_current, phase_currents
from fluxlock.results.metrics import Analysis, Series
from fluxlock.results.rundata import FloatArray, LogKind, RecordArray

# Colours that stay distinct for colour-blind readers.
PHASE_COLOURS = ("#0072B2", "#D55E00", "#009E73")
LEG_COLOURS = (*PHASE_COLOURS, "#CC79A7", "#E69F00")
CROSSING_COLOUR, COMMUTATION_COLOUR, LATE_COLOUR = "#56B4E9", "#222222", "#CC79A7"
BEYOND_COLOUR = "#D55E00"
ANGLE_COLOUR, D_COLOUR, Q_COLOUR = "#222222", "#CC79A7", "#0072B2"
DPI = 110
LEGEND_ROOM = 0.18  # of the height of a panel
# Error axes show at least this range, and this much beyond the largest error inside a window.
ERROR_RANGE_DEG, ERROR_HEADROOM = 0.5, 1.5


class _Page:
    """What the panels of one page share."""

    def __init__(self, analysis: Analysis, scenario: Scenario) -> None:
        self.analysis = analysis
        self.scenario = scenario
        self.data = analysis.data
        self.clock = self.data.clock_hz
        self.from_s, self.to_s = scenario.zoom_window_s()

    def in_span(self, records: RecordArray) -> RecordArray:
        time = records["t_cycle"] / self.clock
        return records[(time >= self.from_s) & (time <= self.to_s)]

    @property
    def zoomed(self) -> RecordArray:
        """Event-wise records of the zoomed span, else the coarse ones."""
        fine = self.in_span(self.data.zoom) if self.data.zoom.size else self.data.zoom
        return fine if fine.size else self.in_span(self.data.records)

    def ms(self, records: RecordArray) -> FloatArray:
        """Time in ms."""
        return np.asarray(records["t_cycle"] / self.clock * 1e3, dtype=np.float64)

    def finish_zoomed(self, axes: Axes, label: str) -> None:
        axes.set_ylabel(label)
        axes.set_xlim(self.from_s * 1e3, self.to_s * 1e3)
        axes.ticklabel_format(axis="x", useOffset=False)
        axes.grid(True, alpha=0.3)


def _speed(axes: Axes, page: _Page) -> None:
    """Speed over the whole run with target, windows and trips."""
    data, scenario = page.data, page.scenario
    to_krpm = 30.0 / np.pi / data.pole_pairs / 1e3
    axes.plot(
        data.records["t_cycle"] / page.clock,
        data.records["omega_e"] * to_krpm,
        color="#0072B2",
        label="speed",
    )
    times = [0.0, *(t for t, _ in scenario.speed_targets()), data.duration_s]
    targets = [scenario.speed_target_at(t) / 1e3 for t in times]
    axes.step(times, targets, where="post", color="#888888", linestyle="--", label="target")
    for window in scenario.window:
        axes.axvspan(window.from_s, window.to_s, color="#009E73", alpha=0.15)
        middle = (window.from_s + window.to_s) / 2
        axes.annotate(window.name, (middle, 0.03), xycoords=("data", "axes fraction"), ha="center", fontsize=9)
    for row in data.rows(LogKind.TRIP):
        axes.axvline(row[0] / page.clock, color="red", linewidth=1, label="trip")
    axes.set_xlabel("time / s")
    axes.set_ylabel("speed / (1000 r/min)")
    _make_room(axes)
    axes.set_xlim(0, data.duration_s)
    axes.grid(True, alpha=0.3)
    handles, labels = axes.get_legend_handles_labels()
    unique = dict(zip(labels, handles, strict=True))
    axes.legend(unique.values(), unique.keys(), loc="upper right", ncols=3, fontsize=9)


def _error_limit(page: _Page, series: tuple[Series, ...]) -> float:
    """Half range of the error axis: what the windows need, else nearly all points."""
    errors = [
        s.between(w.from_s * page.clock, w.to_s * page.clock).error_deg for s in series for w in page.scenario.window
    ]
    inside = np.abs(np.concatenate([*errors, np.zeros(1)]))
    if inside.size == 1:
        everywhere = np.concatenate([np.abs(s.error_deg) for s in series] or [np.zeros(1)])
        everywhere = everywhere[np.isfinite(everywhere)]
        inside = np.percentile(everywhere, [95]) if everywhere.size else inside
    return max(ERROR_RANGE_DEG, ERROR_HEADROOM * float(inside.max()))


def _mark_beyond(axes: Axes, time_s: FloatArray, error_deg: FloatArray, limit: float) -> bool:
    """Crosses at the edge for what lies beyond the windows' range; whether there is any."""
    beyond = np.abs(error_deg) > limit
    if not beyond.any():
        return False
    edge, most = 0.97 * limit * np.sign(error_deg[beyond]), np.abs(error_deg[beyond]).max()
    label = f"beyond the axis, up to {most:.0f} deg"
    axes.plot(time_s[beyond], edge, "x", color=BEYOND_COLOUR, markersize=3, label=label, rasterized=True)
    return True


def _errors(axes: Axes, page: _Page) -> None:
    """Crossing and commutation error over the whole run."""
    crossings, commutations = page.analysis.crossings, page.analysis.commutations
    limit = _error_limit(page, (crossings, commutations))
    for series, colour, label in (
        (crossings, CROSSING_COLOUR, "zero crossing"),
        (commutations, COMMUTATION_COLOUR, "commutation"),
    ):
        axes.plot(series.cycle / page.clock, series.error_deg, ".", color=colour, markersize=2, label=label)
    late = crossings.late
    if late.any():
        axes.plot(
            crossings.cycle[late] / page.clock,
            crossings.error_deg[late],
            "x",
            color=LATE_COLOUR,
            markersize=4,
            label="late (overridden) crossing",
        )
    both = [np.concatenate([getattr(s, key) for s in (crossings, commutations)]) for key in ("cycle", "error_deg")]
    _mark_beyond(axes, both[0] / page.clock, both[1], limit)
    for window in page.scenario.window:
        axes.axvspan(window.from_s, window.to_s, color="#009E73", alpha=0.15)
    axes.axhline(0, color="#888888", linewidth=0.8)
    axes.set_ylim(-limit, limit)
    axes.set_xlim(0, page.data.duration_s)
    axes.set_xlabel("time / s")
    axes.set_ylabel("error / deg el. (+ = late)")
    axes.grid(True, alpha=0.3)
    axes.legend(loc="upper right", ncols=3, fontsize=9, markerscale=3)


def _angle_errors(axes: Axes, page: _Page) -> None:
    """Error of the estimated angle over the whole run."""
    angles = page.analysis.angles
    limit = _error_limit(page, (angles,))
    time_s = angles.cycle / page.clock
    axes.plot(time_s, angles.error_deg, ".", color=ANGLE_COLOUR, markersize=2, rasterized=True)
    if _mark_beyond(axes, time_s, angles.error_deg, limit):
        axes.legend(loc="upper right", fontsize=9)
    for window in page.scenario.window:
        axes.axvspan(window.from_s, window.to_s, color="#009E73", alpha=0.15)
    axes.axhline(0, color="#888888", linewidth=0.8)
    axes.set_ylim(-limit, limit)
    axes.set_xlim(0, page.data.duration_s)
    axes.set_xlabel("time / s")
    axes.set_ylabel("angle error / deg el. (+ = ahead)")
    axes.grid(True, alpha=0.3)


def _dq(axes: Axes, page: _Page, records: RecordArray, time: FloatArray) -> None:
    """Currents of the machine in the frame of its true angle."""
    current = dq_current(records)
    axes.plot(time, current.real, color=D_COLOUR, linewidth=0.8, label="d")
    axes.plot(time, current.imag, color=Q_COLOUR, linewidth=0.8, label="q")
    axes.set_ylabel("current / A, true frame")
    axes.grid(True, alpha=0.3)
    _make_room(axes)
    axes.legend(loc="upper right", ncols=2, fontsize=9)


def _dq_of_run(axes: Axes, page: _Page) -> None:
    records = page.data.records
    _dq(axes, page, records, np.asarray(records["t_cycle"] / page.clock, dtype=np.float64))
    axes.set_xlim(0, page.data.duration_s)
    axes.set_xlabel("time / s")


def _dq_zoomed(axes: Axes, page: _Page) -> None:
    _dq(axes, page, page.zoomed, page.ms(page.zoomed))
    page.finish_zoomed(axes, "current / A, true frame")


def _angle_errors_zoomed(axes: Axes, page: _Page) -> None:
    inside = page.analysis.angles.between(page.from_s * page.clock, page.to_s * page.clock)
    axes.plot(inside.cycle / page.clock * 1e3, inside.error_deg, ".-", color=ANGLE_COLOUR, markersize=4, linewidth=0.6)
    page.finish_zoomed(axes, "angle error / deg el.")


def _mark_commutations(axes: Axes, page: _Page) -> None:
    inside = page.analysis.commutations.between(page.from_s * page.clock, page.to_s * page.clock)
    for cycle in inside.cycle:
        axes.axvline(cycle / page.clock * 1e3, color="#888888", linewidth=0.6, linestyle=":")


def _voltages(axes: Axes, page: _Page, phases: tuple[int, ...] = (0, 1, 2)) -> None:
    """True terminal voltages with the crossings that the chip reported at half the DC-link voltage."""
    records = page.zoomed
    for phase in phases:
        name = "abc"[phase]
        axes.plot(
            page.ms(records),
            records[f"v{name}"],
            color=PHASE_COLOURS[phase],
            linewidth=0.8,
            label=f"phase {name.upper()}",
        )
    crossings = page.analysis.crossings.between(page.from_s * page.clock, page.to_s * page.clock)
    half_vdc = np.interp(crossings.cycle, page.data.records["t_cycle"], page.data.records["vdc"]) / 2
    for phase in phases:
        own = FLOATING_PHASE[crossings.sector] == phase
        axes.plot(
            crossings.cycle[own] / page.clock * 1e3,
            half_vdc[own],
            "o",
            color=PHASE_COLOURS[phase],
            markeredgecolor="black",
            markersize=6,
            zorder=5,
            label="_" if phase != phases[-1] else "zero crossing (chip)",
        )
    _mark_commutations(axes, page)
    page.finish_zoomed(axes, "terminal voltage / V")
    _make_room(axes)
    axes.legend(loc="upper right", ncols=4, fontsize=9)


def _make_room(axes: Axes) -> None:
    """Room for the legend above the curves."""
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + LEGEND_ROOM * (high - low))


def _currents(axes: Axes, page: _Page) -> None:
    records = page.zoomed
    names = phase_currents(records)
    for name, colour in zip(names, LEG_COLOURS, strict=False):
        axes.plot(page.ms(records), records[name], color=colour, linewidth=0.9, label=f"phase {name[1].upper()}")
    _mark_commutations(axes, page)
    page.finish_zoomed(axes, "phase current / A")
    _make_room(axes)
    axes.legend(loc="upper right", ncols=len(names), fontsize=9)


def _torque(axes: Axes, page: _Page) -> None:
    records = page.zoomed
    axes.plot(page.ms(records), records["torque_nm"] * 1e3, color="#222222", linewidth=0.9)
    _mark_commutations(axes, page)
    page.finish_zoomed(axes, "torque / (mN m)")


def _gates(axes: Axes, page: _Page) -> None:
    """The gates of three or five legs as lanes: filled while on."""
    labels = [f"{name[1].upper()} {side}" for name in phase_currents(page.zoomed) for side in ("upper", "lower")]
    rows = page.data.rows(LogKind.GATES)
    time = rows[:, 0] / page.clock
    first = max(int(np.searchsorted(time, page.from_s, side="right")) - 1, 0)
    last = int(np.searchsorted(time, page.to_s, side="right"))
    edges = np.concatenate((time[first:last], [page.to_s])) * 1e3
    for switch, label in enumerate(labels):
        state = (rows[first:last, 2] >> switch & 1).astype(np.float64)
        lane = len(labels) - 1 - switch
        level = lane + 0.8 * np.concatenate((state, state[-1:]))
        colour = LEG_COLOURS[switch // 2]
        if state.size:
            axes.fill_between(edges, lane, level, step="post", color=colour, alpha=0.75, linewidth=0, label=label)
        axes.axhline(lane, color="#bbbbbb", linewidth=0.5)
    _mark_commutations(axes, page)
    page.finish_zoomed(axes, "gates (filled = on)")
    axes.set_yticks([len(labels) - 1 - s + 0.4 for s in range(len(labels))], labels)
    axes.set_ylim(-0.2, len(labels))


def _title(page: _Page) -> str:
    drive, scenario = page.scenario.drive, page.scenario
    if drive.method == "vector":
        how = f"vector control, regulator {drive.vector.regulator}, {drive.vector.update} update"
    else:
        how = f"{drive.commutation}, {drive.pattern}"
    return (
        f"{scenario.name}: {scenario.motor.name}, {scenario.inverter.supply_v:g} V, {how}, "
        f"{drive.carrier_hz / 1e3:g} kHz, seed {page.data.seed}"
    )


def _save(figure: Figure, path: Path) -> None:
    FigureCanvasAgg(figure)
    # No date in the file: the same run gives the same bytes.
    figure.savefig(path, dpi=DPI, metadata={"Software": None})


def _draw(page: _Page, title: str, height: float, *panels: tuple[float, Callable[[Axes, _Page], None]]) -> Figure:
    """Panels with their relative heights above one another, over time."""
    figure = Figure(figsize=(13, height), layout="constrained")
    figure.suptitle(title)
    grid = figure.add_gridspec(len(panels), 1, height_ratios=[share for share, _ in panels])
    for i, (_, draw) in enumerate(panels):
        draw(figure.add_subplot(grid[i]), page)
    figure.axes[-1].set_xlabel("time / ms")
    return figure


def overview_page(analysis: Analysis, scenario: Scenario) -> Figure:
    """Speed and errors of the whole run, then voltages, currents and gates of the zoomed span."""
    page = _Page(analysis, scenario)
    panels = (1.1, _speed), (1.0, _errors), (1.3, _voltages), (1.1, _currents), (1.0, _gates)
    figure = _draw(page, _title(page), 17, *panels)
    figure.axes[2].set_title("zoomed span; dotted lines: commutations", fontsize=10, loc="left")
    return figure


def zoom_page(analysis: Analysis, scenario: Scenario) -> Figure:
    """The zoomed span: each terminal voltage, currents, torque, gates."""
    page = _Page(analysis, scenario)
    voltages = [(1.0, partial(_voltages, phases=(phase,))) for phase in range(3)]
    return _draw(page, f"{_title(page)}, zoomed span", 18, *voltages, (1.3, _currents), (0.8, _torque), (1.2, _gates))


def vector_overview_page(analysis: Analysis, scenario: Scenario) -> Figure:
    """Speed, angle error, i_d and i_q of the whole run, then the phase currents of the zoomed span."""
    page = _Page(analysis, scenario)
    panels = (1.1, _speed), (1.0, _angle_errors), (1.0, _dq_of_run), (1.1, _currents)
    figure = _draw(page, _title(page), 14, *panels)
    figure.axes[3].set_title("zoomed span", fontsize=10, loc="left")
    return figure


def vector_zoom_page(analysis: Analysis, scenario: Scenario) -> Figure:
    """The zoomed span: angle error, phase currents, i_d and i_q, torque, gates."""
    page = _Page(analysis, scenario)
    panels = (1.0, _angle_errors_zoomed), (1.3, _currents), (1.1, _dq_zoomed), (0.8, _torque), (1.2, _gates)
    return _draw(page, f"{_title(page)}, zoomed span", 16, *panels)


def write_plots(out_dir: Path, analysis: Analysis, scenario: Scenario) -> list[Path]:
    """Write `overview.png` and `zoom.png`; return their paths."""
    pages = {"overview.png": overview_page, "zoom.png": zoom_page}
    if scenario.drive.method == "vector":
        pages = {"overview.png": vector_overview_page, "zoom.png": vector_zoom_page}
    for name, draw in pages.items():
        _save(draw(analysis, scenario), out_dir / name)
    return [out_dir / name for name in pages]
