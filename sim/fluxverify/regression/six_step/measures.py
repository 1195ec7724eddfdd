# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Timelines of runs, and intervals and thresholds in their windows."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Mapping

import numpy as np

from fluxlock.cosim.outcome import Run
from fluxlock.results.angles import FLOATING_PHASE
from fluxlock.results.metrics import Series
from fluxlock.results.rundata import FloatArray
from fluxlock.theory.six_step.unequal import crossing_errors_deg
from fluxverify.regression.case import Number

Limits = dict[str, tuple[float | None, float | None]]


def toml_value(value: object) -> str:
    """A value as TOML writes it in one line; a mapping as an inline table."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key} = {toml_value(inner)}" for key, inner in value.items()) + "}"
    return repr(round(value, 9)) if isinstance(value, float) else json.dumps(value)


def event(at_s: float, key: str, value: object) -> dict[str, object]:
    """An event with one action."""
    return {"at_s": at_s, key: value}


def timeline(
    duration_s: float, events: Iterable[Mapping[str, object]], windows: Iterable[tuple[str, float, float]]
) -> list[str]:
    """Overrides that give a scenario other events and windows (name, from, to)."""
    listed = ", ".join(toml_value(entry) for entry in events)
    window = ", ".join(toml_value({"name": n, "from_s": a, "to_s": b}) for n, a, b in windows)
    return [f"duration_s={duration_s!r}", f"event=[{listed}]", f"window=[{window}]"]


def in_window(run: Run, series: Series, name: str) -> Series:
    """Entries within a measuring window."""
    window = next(w for w in run.scenario.window if w.name == name)
    return series.between(window.from_s * run.data.clock_hz, window.to_s * run.data.clock_hz)


def interval_values(intervals_deg: FloatArray, name: str) -> dict[str, Number]:
    """Extremes of intervals, and their rms deviation from 60 degrees."""
    if not intervals_deg.size:
        return {f"{name}.{kind}": None for kind in ("min", "max", "rms")}
    return {
        f"{name}.min": float(intervals_deg.min()),
        f"{name}.max": float(intervals_deg.max()),
        f"{name}.rms": float(np.sqrt(np.mean((intervals_deg - 60.0) ** 2))),
    }


def extremes_about(theory_deg: Iterable[float], allowed_deg: float, name: str) -> Limits:
    """Limits of `interval_values`: least and largest interval of a theory, each within what the method allows."""
    intervals = sorted(theory_deg)
    return {
        f"{name}.{kind}": (value - allowed_deg, value + allowed_deg)
        for kind, value in (("min", intervals[0]), ("max", intervals[-1]))
    }


def commutation_intervals(run: Run, window: str) -> FloatArray:
    """True angles between successive commutations of a window, deg."""
    return in_window(run, run.analysis.commutations, window).intervals_deg()


def crossing_intervals(run: Run, window: str) -> FloatArray:
    """True angles between successive crossings of a window, deg."""
    return in_window(run, run.analysis.crossings, window).intervals_deg()


def console_word(run: Run, name: str) -> str:
    """Last value of that name that the console has printed; the first word of several."""
    found = re.findall(rf"^{name} (\S+)", run.console(), re.MULTILINE)
    return found[-1] if found else ""


def printed_thresholds(run: Run) -> tuple[float, ...]:
    """Last reply to `get threshold_pu`: thresholds of sectors I to VI in vdc."""
    found = re.findall(r"^threshold_pu((?: [\d.]+){6})$", run.console(), re.MULTILINE)
    return tuple(float(word) for word in found[-1].split()) if found else ()


def line_drop_v(run: Run, window: str) -> float:
    """What the mean current of a window loses on supply, switches and two phases, V."""
    motor, inverter = run.scenario.motor, run.scenario.inverter
    current_a = float(run.metrics[window]["torque_nm"]["mean"]) / motor.torque_per_amp_nm
    phase_ohm = inverter.on_resistance_ohm + sum(motor.resistance_ohm) / len(motor.resistance_ohm)
    return (inverter.supply_resistance_ohm + 2 * phase_ohm) * current_a


def theory_errors(run: Run, window: str, speed_rpm: float) -> dict[str, Number]:
    """How late the crossings of phases A, B, C come by theory at the mean current of a window, deg."""
    supply_v = run.scenario.inverter.supply_v
    errors = crossing_errors_deg(run.scenario.motor, supply_v, speed_rpm, line_drop_v(run, window))
    return {f"crossing_error_theory_deg.{x}": error for x, error in zip("ABC", errors, strict=True)}


def phase_crossing_errors(run: Run, window: str) -> dict[str, Number]:
    """Mean lateness of the crossings of phases A, B, C in a window, deg."""
    crossings = in_window(run, run.analysis.crossings, window)
    values: dict[str, Number] = {}
    for phase, name in enumerate("ABC"):
        errors = crossings.error_deg[FLOATING_PHASE[crossings.sector] == phase]
        values[f"crossing_error_deg.{name}"] = float(errors.mean()) if errors.size else None
    return values


def turn_peak_to_peak_a(run: Run, window: str) -> float:
    """Largest less smallest current of a phase in a turn, mean over the turns and phases of a window.

    Over a whole window the extremes are those of one turn: where the ripple's beat with the rotor peaks.
    """
    span = next(w for w in run.scenario.window if w.name == window)
    records = run.data.records
    time = records["t_cycle"] / run.data.clock_hz
    inside = records[(time >= span.from_s) & (time < span.to_s)]
    turn = np.floor(inside["theta_e"] / (2 * math.pi))
    # The first and the last turn are not whole.
    starts = np.flatnonzero(np.diff(turn)) + 1
    spreads = [
        np.maximum.reduceat(inside[name], starts)[:-1] - np.minimum.reduceat(inside[name], starts)[:-1]
        for name in ("ia", "ib", "ic")
    ]
    return float(np.mean(spreads))
