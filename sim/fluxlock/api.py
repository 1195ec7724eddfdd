# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Fluxlock from Python: change a scenario in code, run it on the chip or on the twin, read metrics and traces.

```python
import fluxlock

run = fluxlock.simulate("scenarios/own-spindle.toml", **{"motor.resistance_ohm": 0.2})
print(run.verdict.passed, run.metrics["steady"]["speed_rpm"]["mean"])
run.plot("ia", "speed_rpm")
```

Bad input raises `fluxlock.ConfigError` with all problems, a run that breaks off `fluxlock.SimulationFault`. Ctrl-C ends
the simulator and raises KeyboardInterrupt, in a notebook as in a shell.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from fluxlock.analysis.rundata import FloatArray, RunData, SimulationFault
from fluxlock.config import ConfigError, Inverter, Motor, Problem, Scenario, load_scenario
from fluxlock.config.loader import Override, changed

if TYPE_CHECKING:
    import pandas
    from matplotlib.axes import Axes

    from fluxlock.analysis.verdict import Verdict

RPM_PER_RAD_S = 30.0 / np.pi

# Traces and their units; all of one run have the same length.
UNITS = {
    "t_s": "s",
    "theta_e_rad": "rad",
    "speed_rpm": "r/min",
    "ia": "A",
    "ib": "A",
    "ic": "A",
    "va": "V",
    "vb": "V",
    "vc": "V",
    "vdc": "V",
    "idc": "A",
    "torque_nm": "N*m",
}


@dataclass(frozen=True)
class Run:
    """A finished run.

    scenario: what ran. data: everything recorded. metrics: window -> metric -> statistic -> value, see
    docs/reference/result.md. verdict: `passed`, and in `failures` why not.
    """

    scenario: Scenario
    data: RunData
    metrics: dict[str, dict[str, Any]]
    verdict: Verdict

    @cached_property
    def traces(self) -> dict[str, FloatArray]:
        """Waveforms of the plant, name -> float64 [n], one each `record.period_s`; units in `fluxlock.UNITS`.

        theta_e_rad: true electrical angle, unwrapped. speed_rpm: true mechanical speed. ia, ib, ic: phase currents into
        the machine. va, vb, vc: terminal voltages against the negative rail.
        """
        records = self.data.records
        found: dict[str, FloatArray] = {
            "t_s": records["t_cycle"] / self.data.clock_hz,
            "theta_e_rad": records["theta_e"],
            "speed_rpm": records["omega_e"] / self.data.pole_pairs * RPM_PER_RAD_S,
        }
        return found | {name: np.asarray(records[name]) for name in UNITS if name not in found}

    def to_dataframe(self) -> pandas.DataFrame:
        """The traces as a pandas table with t_s as index; units in its `attrs["units"]`. Needs pandas."""
        import pandas

        table = pandas.DataFrame(self.traces).set_index("t_s")
        table.attrs["units"] = {name: unit for name, unit in UNITS.items() if name != "t_s"}
        return table

    def plot(self, *names: str) -> npt.NDArray[Any]:
        """Draw traces over time, one panel each; without names speed, current of phase A and torque.

        Returns the panels, Matplotlib Axes [n]. Raises ConfigError for a name that is no trace.
        """
        from matplotlib import pyplot

        names = names or ("speed_rpm", "ia", "torque_nm")
        unknown = [name for name in names if name not in UNITS]
        if unknown:
            text = f"no such trace, permitted: {', '.join(UNITS)}"
            raise ConfigError([Problem("plot", name, text) for name in unknown])
        figure, axes = pyplot.subplots(len(names), 1, sharex=True, squeeze=False, layout="constrained")
        panels: npt.NDArray[Any] = axes[:, 0]
        for name, panel in zip(names, panels, strict=True):
            self._panel(name, panel)
        panels[-1].set_xlabel("time / s")
        figure.suptitle(self.scenario.name)
        return panels

    def _panel(self, name: str, panel: Axes) -> None:
        panel.plot(self.traces["t_s"], self.traces[name], linewidth=0.8)
        panel.set_ylabel(f"{name} / {UNITS[name]}")
        panel.grid(alpha=0.3)


def scenario_of(scenario: Scenario | Path | str, overrides: Mapping[str, object] | None = None) -> Scenario:
    """A scenario, read from its file unless it is one, with keys changed, and checked.

    overrides: key -> value. Keys are those of the file, `drive.carrier_hz`, `motor.resistance_ohm`,
    `window.steady.to_s`; two underscores may stand for a dot. `motor` and `inverter` take a whole `Motor` and
    `Inverter` too. Raises ConfigError with all problems.
    """
    changes = [Override(tuple(key.replace("__", ".").split(".")), value) for key, value in (overrides or {}).items()]
    if isinstance(scenario, Scenario):
        return changed(scenario, changes) if changes else scenario
    if any(isinstance(o.value, (Motor, Inverter)) for o in changes):
        return changed(load_scenario(scenario), changes)
    return load_scenario(scenario, changes)


def simulate(
    scenario: Scenario | Path | str,
    *,
    twin: bool = False,
    seed: int | None = None,
    folder: Path | str | None = None,
    progress: bool = False,
    **overrides: object,
) -> Run:
    """Run a scenario and return what was measured.

    scenario: a file (also a shipped one by its name, "scenarios/demo.toml") or a `Scenario`. twin: the firmware as a
    program of this machine on an averaged motor, faster than real time, in place of the chip clock by clock. seed: of
    the noise, default the scenario's. folder: keeps trace, result and plots there. progress: draw a bar on the error
    output. overrides: keys to change, `drive__commutation="CSC"` or `**{"motor.resistance_ohm": 0.2}`.

    Raises ConfigError (bad input), SimulationFault (the run broke off). A run that fails its verdict is returned: look
    at `run.verdict`.

    >>> run = simulate("scenarios/own-spindle.toml", twin=True)
    >>> run.metrics["steady"]["speed_rpm"]["mean"]  # r/min
    """
    from fluxlock.analysis.metrics import run_metrics
    from fluxlock.analysis.verdict import judge_run
    from fluxlock.cosim.outcome import write_outcome
    from fluxlock.cosim.parameters import check_parameters

    loaded = scenario_of(scenario, overrides)
    check_parameters(loaded)
    used_seed = loaded.seed if seed is None else seed
    with ExitStack() as stack:
        out = Path(folder) if folder is not None else Path(stack.enter_context(tempfile.TemporaryDirectory()))
        data = _on_twin(loaded, used_seed) if twin else _on_chip(loaded, out, used_seed, progress)
        if folder is not None:
            outcome = write_outcome(data, loaded, out)
            return Run(loaded, data, outcome.metrics, outcome.verdict)
    analysis, metrics = run_metrics(data, loaded)
    return Run(loaded, data, metrics, judge_run(data, loaded, analysis, metrics))


def _on_chip(scenario: Scenario, folder: Path, seed: int, progress: bool) -> RunData:
    from rich.console import Console

    from fluxlock.build import check_build
    from fluxlock.cosim.run import run_scenario
    from fluxlock.progress import ProgressBar

    check_build()
    if not progress:
        return run_scenario(scenario, folder, seed)
    with ProgressBar(Console(stderr=True), scenario.duration_s) as bar:
        return run_scenario(scenario, folder, seed, progress=bar)


def _on_twin(scenario: Scenario, seed: int) -> RunData:
    from fluxlock.native.player import player

    return player(scenario, seed).run()


__all__ = ["UNITS", "Run", "SimulationFault", "scenario_of", "simulate"]
