"""Running scenarios from tests: outputs stay below build/closed_loop, one folder a test."""

from __future__ import annotations

import json
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fluxlock.analysis.metrics import Analysis, run_metrics
from fluxlock.analysis.plots import write_plots
from fluxlock.analysis.result import build_result, write_result
from fluxlock.analysis.rundata import LogKind, RunData, save_trace
from fluxlock.config import Scenario, load_scenario
from fluxlock.cosim.run import run_scenario
from fluxlock.paths import BUILD, ROOT

SEED = 1


@dataclass(frozen=True)
class Outcome:
    """A finished run."""

    scenario: Scenario
    data: RunData
    analysis: Analysis
    metrics: dict[str, dict[str, Any]]
    result: dict[str, Any]
    folder: Path

    def gates(self) -> np.ndarray[Any, Any]:
        """Gate log [cycle, gates]."""
        return self.data.rows(LogKind.GATES)[:, [0, 2]]

    def console(self) -> str:
        """What the drive has printed."""
        return "\n".join(self.data.uart)


def drive(scenario: str | Path, name: str, *overrides: str, seed: int = SEED, log_strobes: bool = False) -> Outcome:
    """Run a scenario (absolute, or in scenarios/) with overrides; print the seed.

    Result and plots stay in build/closed_loop/<name>.
    """
    path = ROOT / "scenarios" / scenario
    loaded = load_scenario(path, overrides)
    folder = BUILD / "closed_loop" / name
    shutil.rmtree(folder, ignore_errors=True)
    print(f"{path.name} {' '.join(overrides)} seed {seed}: {folder}")
    data = run_scenario(loaded, folder, seed, log_strobes=log_strobes)
    save_trace(folder / "trace.npz", data)
    analysis, metrics = run_metrics(data, loaded)
    result = build_result(data, loaded, metrics)
    write_result(folder / "result.json", result)
    write_plots(folder, analysis, loaded)
    print(json.dumps(metrics, indent=1))
    return Outcome(loaded, data, analysis, metrics, result, folder)
