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
from pathlib import Path

from fluxlock.config import Inverter, Motor, Scenario, load_scenario
from fluxlock.config.loader import Override, changed
from fluxlock.cosim.outcome import Run, finished, write_outcome
from fluxlock.python_load import LoadFunction, PythonLoad, check_rotor
from fluxlock.results.rundata import RunData


def scenario_of(scenario: Scenario | Path | str, overrides: Mapping[str, object] | None = None) -> Scenario:
    """A scenario, read from its file unless it is one, with keys changed, and checked.

    overrides: key -> value. Keys are those of the file, `drive.carrier_hz`, `motor.resistance_ohm`,
    `window.steady.to_s`; two underscores may stand for a dot. `motor` and `inverter` take a whole `Motor` and
    `Inverter` too. Raises ConfigError with all problems.

    >>> scenario_of("scenarios/own-spindle.toml", {"motor.resistance_ohm": 0.2}).motor.resistance_ohm  # Ohm, phases
    (0.2, 0.2, 0.2)
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
    plots: bool = True,
    progress: bool = False,
    load_nm: LoadFunction | None = None,
    **overrides: object,
) -> Run:
    """Run a scenario and return what was measured.

    scenario: a file (also a shipped one by its name, "scenarios/demo.toml") or a `Scenario`. twin: the firmware as a
    program of this machine on an averaged motor, faster than real time, in place of the chip clock by clock. seed: of
    the noise, default the scenario's. folder: keeps trace, result and, unless told otherwise, plots there. progress:
    draw a bar on the error output. load_nm: a function of the shaft's speed_rad_s, angle_rad (mechanical, unwrapped)
    and time_s that returns a torque, N m, on top of the scenario's load; positive brakes a positive speed. overrides:
    keys to change, `drive__commutation="CSC"` or `**{"motor.resistance_ohm": 0.2}`.

    Raises ConfigError (bad input), SimulationFault (the run broke off, or `load_nm` did). A run that fails its verdict
    is returned: look at `run.verdict`.

    >>> run = simulate("scenarios/own-spindle.toml", twin=True)
    >>> run.metrics["steady"]["speed_rpm"]["mean"]  # r/min
    >>> simulate("scenarios/own-spindle.toml", twin=True, load_nm=lambda speed, angle, time: 2e-6 * speed)
    """
    from fluxlock.cosim.parameters import check_parameters

    loaded = scenario_of(scenario, overrides)
    check_parameters(loaded)
    load = PythonLoad(load_nm) if load_nm is not None else None
    if load is not None:
        check_rotor(loaded)
    used_seed = loaded.seed if seed is None else seed
    with ExitStack() as stack:
        out = Path(folder) if folder is not None else Path(stack.enter_context(tempfile.TemporaryDirectory()))
        data = _on_twin(loaded, used_seed, load) if twin else _on_chip(loaded, out, used_seed, progress, load)
        return finished(data, loaded) if folder is None else write_outcome(data, loaded, out, plots)


def _on_chip(scenario: Scenario, folder: Path, seed: int, progress: bool, load: PythonLoad | None) -> RunData:
    from rich.console import Console

    from fluxlock.base.progress import ProgressBar
    from fluxlock.cosim.run import run_scenario
    from fluxlock.generate.registers import check_build

    check_build()
    if not progress:
        return run_scenario(scenario, folder, seed, load=load)
    with ProgressBar(Console(stderr=True), scenario.duration_s) as bar:
        return run_scenario(scenario, folder, seed, progress=bar, load=load)


def _on_twin(scenario: Scenario, seed: int, load: PythonLoad | None) -> RunData:
    from fluxlock.native.player import player

    return player(scenario, seed).run(load)
