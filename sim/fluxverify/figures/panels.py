# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Panels that several figures share, and how a page is saved."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from fluxlock.cosim.outcome import Run
from fluxlock.results.metrics import Analysis, Series
from fluxlock.results.plots import COMMUTATION_COLOUR, PHASE_COLOURS
from fluxlock.results.rundata import BoolArray, FloatArray, IntArray, LogKind, RecordArray, RunData
from fluxlock.theory.six_step.fourier import space_vector
from fluxlock.theory.six_step.plots import GREY, draw_gates, finish

DPI = 90
COLOURS = (48, 24, 12)  # of the palette: the most that keep the file small
LARGEST = 58_000  # bytes
SMALL = 8
Corner = Literal["upper right", "upper left", "lower right", "lower left", "center right"]
TITLE = 9
PHASES = ("ia", "ib", "ic")


def page(title: str, rows: int, columns: int, size: tuple[float, float]) -> tuple[Figure, list[list[Axes]]]:
    """A page of rows x columns panels; size in inches."""
    drawn = Figure(figsize=size, layout="constrained")
    drawn.suptitle(title, fontsize=11)
    grid = drawn.subplots(rows, columns, squeeze=False)
    return drawn, [list(line) for line in grid]


def save_small(drawn: Figure, path: Path) -> None:
    """Write a page as PNG with a palette; the same page gives the same bytes."""
    FigureCanvasAgg(drawn)
    buffer = io.BytesIO()
    drawn.savefig(buffer, format="png", dpi=DPI, metadata={"Software": None})
    with Image.open(buffer) as image:
        for colours in COLOURS:
            image.convert("RGB").quantize(colours, dither=Image.Dither.NONE).save(path, optimize=True)
            if path.stat().st_size <= LARGEST:
                break


def records_between(data: RunData, from_s: float, to_s: float) -> RecordArray:
    """Waveform records of a span: every event where the run has them, else the regular ones."""
    for records in (data.zoom, data.records):
        if records.size and records["t_cycle"][0] <= from_s * data.clock_hz + 1e3:
            time = records["t_cycle"]
            found = records[(time >= from_s * data.clock_hz) & (time <= to_s * data.clock_hz)]
            if found.size and records["t_cycle"][-1] >= to_s * data.clock_hz - 1e3:
                return found
    time = data.records["t_cycle"]
    return data.records[(time >= from_s * data.clock_hz) & (time <= to_s * data.clock_hz)]


def ms(cycles: FloatArray, data: RunData, from_s: float = 0.0) -> FloatArray:
    """Clock cycles as time in ms since from_s."""
    return np.asarray((cycles / data.clock_hz - from_s) * 1e3, dtype=np.float64)


def currents(axes: Axes, data: RunData, from_s: float, to_s: float, names: Sequence[str] = PHASES) -> None:
    """Phase currents of a span; time in ms since its start."""
    records = records_between(data, from_s, to_s)
    for name in names:
        colour = PHASE_COLOURS[PHASES.index(name)]
        axes.plot(
            ms(records["t_cycle"], data, from_s), records[name], color=colour, linewidth=0.8, label=name[1:].upper()
        )
    axes.set_xlim(0.0, (to_s - from_s) * 1e3)
    finish(axes, "time / ms", "current / A")


def intervals(axes: Axes, series: Series, data: RunData, from_s: float, to_s: float, label: str = "") -> FloatArray:
    """True angle between successive crossings or commutations of a span, drawn and returned (deg)."""
    part = series.between(from_s * data.clock_hz, to_s * data.clock_hz)
    steps = part.intervals_deg()
    axes.plot(
        ms(part.cycle[1:], data, from_s),
        steps,
        ".-",
        color=COMMUTATION_COLOUR,
        linewidth=0.6,
        markersize=3,
        label=label,
    )
    axes.axhline(60.0, color=GREY, linewidth=0.8)
    axes.set_xlim(0.0, (to_s - from_s) * 1e3)
    finish(axes, "time / ms", "interval / deg")
    return steps


def speed(axes: Axes, data: RunData, label: str = "", colour: str = PHASE_COLOURS[0]) -> None:
    """True speed over the whole run."""
    to_krpm = 30.0 / np.pi / data.pole_pairs / 1e3
    axes.plot(data.records["t_cycle"] / data.clock_hz, data.records["omega_e"] * to_krpm, color=colour, label=label)
    for row in data.rows(LogKind.TRIP):
        axes.axvline(row[0] / data.clock_hz, color="red", linewidth=1)
    axes.set_xlim(0.0, data.duration_s)
    finish(axes, "time / s", "1000 r/min")


def gate_rows(data: RunData, from_s: float, to_s: float) -> IntArray:
    """Changes of the gates [n, 2] (cycle, gates from then on) of a span, the one before it included."""
    rows = data.rows(LogKind.GATES)[:, [0, 2]]
    first = max(int(np.searchsorted(rows[:, 0], from_s * data.clock_hz, side="right")) - 1, 0)
    return rows[first : int(np.searchsorted(rows[:, 0], to_s * data.clock_hz))]


def pulse_on(states: IntArray) -> BoolArray:
    """Whether an upper and a lower switch conduct."""
    return np.asarray(np.abs(space_vector(states)) > 0.5)


def trip_text(run: Run) -> str:
    """When and why the run tripped, or that it did not."""
    trips = run.result["trips"]
    return f"trip ({trips[0]['cause']}) at {trips[0]['time_s']:.3f} s" if trips else "no trip"


def gates(axes: Axes, data: RunData, from_s: float, to_s: float) -> None:
    """Gates of a span as lanes; time in ms since its start."""
    rows = gate_rows(data, from_s, to_s)
    at = np.append(rows[:, 0].astype(np.float64), to_s * data.clock_hz)
    draw_gates(axes, ms(at, data, from_s), rows[:, 1])
    axes.set_xlim(0.0, (to_s - from_s) * 1e3)
    axes.set_xlabel("time / ms")


def mark_commutations(axes: Axes, analysis: Analysis, from_s: float, to_s: float) -> None:
    """Dotted lines at the instants at which commutations were due by the true angle."""
    clock = analysis.data.clock_hz
    for instant in due_cycles(analysis, from_s * clock, to_s * clock):
        axes.axvline((instant / clock - from_s) * 1e3, color=GREY, linewidth=0.7, linestyle=":")


def due_cycles(analysis: Analysis, low: float, high: float) -> FloatArray:
    """Cycles at which the rotor passes the ideal commutation angles (forward rotation)."""
    records = analysis.data.records
    theta = np.degrees(records["theta_e"]) + 180.0
    inside = (records["t_cycle"] >= low) & (records["t_cycle"] <= high)
    begin, end = float(np.interp(low, records["t_cycle"], theta)), float(np.interp(high, records["t_cycle"], theta))
    if not inside.any():
        return np.array([])
    angles = np.arange(np.ceil((begin - 30.0) / 60.0) * 60.0 + 30.0, end, 60.0)
    return np.asarray(np.interp(angles, theta, records["t_cycle"]), dtype=np.float64)


def title(axes: Axes, text: str) -> None:
    """Heading of a panel."""
    axes.set_title(text, fontsize=TITLE, loc="left")


def legend(axes: Axes, columns: int = 3, where: Corner = "upper right") -> None:
    """Small legend."""
    axes.legend(loc=where, ncols=columns, fontsize=SMALL)


def legend_above(axes: Axes, columns: int) -> None:
    """Small legend on top of the panel, for one that its curves fill."""
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=columns, fontsize=SMALL, frameon=False)


def peak_to_peak_a(run: Run, from_s: float, to_s: float) -> float:
    """Largest less smallest phase current of a span, mean of the three phases."""
    value = run.analysis.window(from_s, to_s)["phase_current_pp_a"]
    assert isinstance(value, float)
    return value


def span_text(values: FloatArray, decimals: int = 1) -> str:
    """`47.3 … 72.7`."""
    if not values.size:
        return "-"
    return f"{float(values.min()):.{decimals}f} … {float(values.max()):.{decimals}f}"
