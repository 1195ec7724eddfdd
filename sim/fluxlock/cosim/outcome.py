# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A finished run with its metrics, written to a folder, and read from it again."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fluxlock.analysis.metrics import Analysis, run_metrics
from fluxlock.analysis.plots import write_plots
from fluxlock.analysis.result import build_result, write_result
from fluxlock.analysis.rundata import LogKind, RunData, load_trace, save_trace
from fluxlock.analysis.verdict import Verdict, judge_run
from fluxlock.config import Scenario

TRACE = "trace.npz"
RESULT = "result.json"


@dataclass(frozen=True)
class Outcome:
    """A finished run. metrics and result: see docs/reference/result.md."""

    scenario: Scenario
    data: RunData
    analysis: Analysis
    metrics: dict[str, dict[str, Any]]
    result: dict[str, Any]
    folder: Path
    verdict: Verdict

    def gates(self) -> np.ndarray[Any, Any]:
        """Gate log, int64 [n, 2]: cycle, gates (bit 2X upper, 2X+1 lower switch of leg X)."""
        return self.data.rows(LogKind.GATES)[:, [0, 2]]

    def console(self) -> str:
        """What the drive has printed."""
        return "\n".join(self.data.uart)


def write_outcome(
    data: RunData,
    scenario: Scenario,
    folder: Path,
    plots: bool = True,
    *,
    by_bus: bool = False,
    broken: str | None = None,
) -> Outcome:
    """Evaluate a run and write trace, result and, unless told otherwise, plots. by_bus, broken: see `judge_run`."""
    save_trace(folder / TRACE, data)
    analysis, metrics = run_metrics(data, scenario)
    verdict = judge_run(data, scenario, analysis, metrics, by_bus=by_bus, broken=broken)
    result = build_result(data, scenario, metrics, verdict)
    write_result(folder / RESULT, result)
    if plots:
        write_plots(folder, analysis, scenario)
    return Outcome(scenario, data, analysis, metrics, result, folder, verdict)


def read_outcome(scenario: Scenario, folder: Path) -> Outcome:
    """Read what `write_outcome` has written for this scenario; metrics and verdict are made anew from the trace."""
    data = load_trace(folder / TRACE)
    result = json.loads((folder / RESULT).read_text(encoding="utf-8"))
    analysis, metrics = run_metrics(data, scenario)
    verdict = judge_run(data, scenario, analysis, metrics)
    return Outcome(scenario, data, analysis, metrics, {**result, "verdict": verdict.as_json()}, folder, verdict)
