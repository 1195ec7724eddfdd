# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A finished run with its metrics, written to a folder, and read from it again."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from fluxlock.config import ConfigError, Problem, Scenario
from fluxlock.config.motor import RPM_PER_RAD_S
from fluxlock.results.metrics import Analysis, run_metrics
from fluxlock.results.plots import write_plots
from fluxlock.results.result import build_result, write_result
from fluxlock.results.rundata import FloatArray, LogKind, RunData, load_trace, save_trace
from fluxlock.results.verdict import Verdict, judge_run
from fluxlock.workers import EXTRA

if TYPE_CHECKING:
    import pandas

TRACE = "trace.npz"
RESULT = "result.json"


#: Traces of a run and their units; a run has those of its phases, see `Run.traces`.
#:
#: >>> UNITS["ia"], UNITS["speed_rpm"]
#: ('A', 'r/min')
UNITS = {
    "t_s": "s",
    "theta_e_rad": "rad",
    "speed_rpm": "r/min",
    **dict.fromkeys(("ia", "ib", "ic", "id", "ie"), "A"),
    **dict.fromkeys(("va", "vb", "vc", "vd", "ve"), "V"),
    "vdc": "V",
    "idc": "A",
    "torque_nm": "N*m",
}


@dataclass(frozen=True)
class Run:
    """A finished run.

    scenario: what ran. data: everything recorded. analysis: cycles, crossings and commutations found in it. metrics:
    window -> metric -> statistic -> value; a metric's unit ends its name. result: the document of `result.json`, see
    docs/reference/result.md. verdict: `passed`, and in `failures` why not. folder: where trace, result and plots lie;
    None: nowhere.

    >>> from fluxlock import simulate
    >>> run = simulate("scenarios/own-spindle.toml", twin=True)  # doctest: +SKIP
    >>> run.traces["ia"].max(), run.verdict.passed  # A  # doctest: +SKIP
    """

    scenario: Scenario
    data: RunData
    analysis: Analysis
    metrics: dict[str, dict[str, Any]]
    result: dict[str, Any]
    folder: Path | None
    verdict: Verdict

    def __repr__(self) -> str:
        word = "ok" if self.verdict.passed else "failed"
        return f"<Run of {self.scenario.name}: {word}: {'; '.join(self.verdict.lines)}>"

    def gates(self) -> np.ndarray[Any, Any]:
        """Gate log, int64 [n, 2]: cycle, gates (bit 2X upper, 2X+1 lower switch of leg X)."""
        return self.data.rows(LogKind.GATES)[:, [0, 2]]

    def console(self) -> str:
        """What the drive has printed."""
        return "\n".join(self.data.uart)

    @cached_property
    def traces(self) -> dict[str, FloatArray]:
        """Waveforms of the plant, name -> float64 [n], one each `record.period_s`; units in `fluxlock.UNITS`.

        theta_e_rad: true electrical angle, unwrapped. speed_rpm: true mechanical speed. ia, ib, ic: phase currents into
        the machine; with five phases id, ie too: those of phases D and E. va to ve: terminal voltages against the
        negative rail.
        """
        records = self.data.records
        found: dict[str, FloatArray] = {
            "t_s": records["t_cycle"] / self.data.clock_hz,
            "theta_e_rad": records["theta_e"],
            "speed_rpm": records["omega_e"] / self.data.pole_pairs * RPM_PER_RAD_S,
        }
        return found | {name: np.asarray(records[name]) for name in UNITS if name in (records.dtype.names or ())}

    def to_dataframe(self) -> pandas.DataFrame:
        """The traces as a pandas table, n rows, with t_s as index; units in its `attrs["units"]`.

        Raises ConfigError without pandas.
        """
        try:
            import pandas
        except ImportError:
            raise ConfigError([Problem("to_dataframe", "", f"needs pandas: {EXTRA}")]) from None
        table = pandas.DataFrame(self.traces).set_index("t_s")
        table.attrs["units"] = {name: unit for name, unit in UNITS.items() if name in table.columns}
        return table

    def plot(self, *names: str) -> npt.NDArray[Any]:
        """Draw traces over time, one panel each; without names speed, current of phase A and torque.

        Returns the panels, Matplotlib Axes [n]. Raises ConfigError for a name that is no trace.
        """
        from matplotlib import pyplot

        names = names or ("speed_rpm", "ia", "torque_nm")
        unknown = [name for name in names if name not in self.traces]
        if unknown:
            text = f"no such trace, permitted: {', '.join(self.traces)}"
            raise ConfigError([Problem("plot", name, text) for name in unknown])
        figure, axes = pyplot.subplots(len(names), 1, sharex=True, squeeze=False, layout="constrained")
        panels: npt.NDArray[Any] = axes[:, 0]
        for name, panel in zip(names, panels, strict=True):
            panel.plot(self.traces["t_s"], self.traces[name], linewidth=0.8)
            panel.set_ylabel(f"{name} / {UNITS[name]}")
            panel.grid(alpha=0.3)
        panels[-1].set_xlabel("time / s")
        figure.suptitle(self.scenario.name)
        return panels


def finished(
    data: RunData, scenario: Scenario, folder: Path | None = None, *, by_bus: bool = False, broken: str | None = None
) -> Run:
    """Evaluate a run; nothing is written. by_bus, broken: see `judge_run`."""
    analysis, metrics = run_metrics(data, scenario)
    verdict = judge_run(data, scenario, analysis, metrics, by_bus=by_bus, broken=broken)
    return Run(scenario, data, analysis, metrics, build_result(data, scenario, metrics, verdict), folder, verdict)


def write_outcome(
    data: RunData,
    scenario: Scenario,
    folder: Path,
    plots: bool = True,
    *,
    by_bus: bool = False,
    broken: str | None = None,
) -> Run:
    """Evaluate a run and write trace, result and, unless told otherwise, plots. by_bus, broken: see `judge_run`."""
    save_trace(folder / TRACE, data)
    run = finished(data, scenario, folder, by_bus=by_bus, broken=broken)
    write_result(folder / RESULT, run.result)
    if plots:
        write_plots(folder, run.analysis, scenario)
    return run


def read_outcome(scenario: Scenario, folder: Path) -> Run:
    """Read what `write_outcome` has written for this scenario; metrics and verdict are made anew from the trace."""
    data = load_trace(folder / TRACE)
    result = json.loads((folder / RESULT).read_text(encoding="utf-8"))
    run = finished(data, scenario, folder)
    return replace(run, result={**result, "verdict": run.verdict.as_json()})
