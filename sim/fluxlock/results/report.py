# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Prints the tables of a run in the terminal: metrics per window, clocks per interrupt handler."""

from __future__ import annotations

from typing import Any

from rich.table import Table
from rich.text import Text

from fluxlock.config.scenario import METHOD_METRICS, METRICS
from fluxlock.results.metrics import lookup

# Unit and decimals by the first part of a metric's name.
_FORMATS = {
    "speed_rpm": ("r/min", 1),
    "zcp_error_deg": ("deg", 3),
    "commutation_error_deg": ("deg", 3),
    "sector_interval_deg": ("deg", 2),
    "commutation_interval_deg": ("deg", 2),
    "phase_current_pp_a": ("A", 2),
    "freewheel_deg": ("deg", 2),
    "demagnetisation_margin_deg": ("deg", 2),
    "pwm_phase_error_pp_deg": ("deg", 3),
    "torque_nm": ("mN*m", 2),
    "late_crossings": ("", 0),
    "angle_error_deg": ("deg", 3),
    "id_a": ("A", 2),
    "iq_a": ("A", 2),
}
_SUFFIXES = ("_rpm", "_deg", "_nm", "_pp_a", "_a")


def _label(metric: str) -> str:
    """`zcp_error_deg.rms` -> `crossing error rms`."""
    name, _, part = metric.partition(".")
    for suffix in _SUFFIXES:
        name = name.replace("zcp_", "crossing_").removesuffix(suffix) + (
            " p-p" if suffix == "_pp_a" and name.endswith(suffix) else ""
        )
    return f"{name} {part}".replace("_pp", " p-p").replace("_", " ").strip()


def metrics_table(result: dict[str, Any]) -> Table:
    """Metrics of all windows, a column each; missed expectations in red with an exclamation mark.

    What only the other method has is left out.
    """
    method = result["scenario"]["settings"]["drive"]["method"]
    others = {name for other, names in METHOD_METRICS.items() if other != method for name in names}
    missed = {(e["window"], e["metric"]) for e in result["expectations"] if not e["pass"]}
    table = Table(title=f"{result['scenario']['name']}, seed {result['run']['seed']}", title_justify="left")
    table.add_column("metric")
    table.add_column("unit")
    for window in result["metrics"]:
        table.add_column(window, justify="right")
    for metric in METRICS:
        name = metric.partition(".")[0]
        if name in others:
            continue
        unit, decimals = _FORMATS[name]
        cells = []
        for window, metrics in result["metrics"].items():
            value = lookup(metrics, metric)
            scale = 1e3 if unit == "mN*m" else 1.0
            text = "-" if value is None else f"{value * scale:.{decimals}f}"
            bad = (window, metric) in missed
            cells.append(Text(f"{text} !" if bad else text, style="bold red" if bad else ""))
        table.add_row(_label(metric), unit, *cells)
    return table


def handlers_table(result: dict[str, Any]) -> Table:
    """Cycles of the interrupt handlers."""
    table = Table(
        title=f"Interrupt handlers, clock cycles; overruns: {result['run']['overruns']}", title_justify="left"
    )
    table.add_column("handler")
    for name in ("min", "mean", "max", "count"):
        table.add_column(name, justify="right")
    for handler, stats in result["run"]["isr"].items():
        cells = [f"{stats[k]:.0f}" if k in stats else "-" for k in ("min", "mean", "max", "count")]
        table.add_row(handler, *cells)
    return table


def run_line(result: dict[str, Any]) -> str:
    """Size and speed of the run in one line."""
    run = result["run"]
    return (
        f"{run['simulated_s']:.3f} s simulated = {run['cycles'] / 1e6:.1f} Mcycles in {run['wall_s']:.1f} s: "
        f"{run['cycles_per_s'] / 1e6:.2f} Mcycle/s, {run['realtime_factor']:.4f} of real time"
    )
