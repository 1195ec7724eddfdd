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

import re
import tempfile
from collections.abc import Mapping
from contextlib import ExitStack, nullcontext
from dataclasses import dataclass, replace
from inspect import signature
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fluxlock.base.stage import PLOTTING, Progress, ProgressInfo, tell_building
from fluxlock.base.writable import check_folder
from fluxlock.config import ConfigError, Inverter, Motor, Problem, Scenario, load_scenario
from fluxlock.config.errors import SET_OPTION, closest
from fluxlock.config.loader import Override, changed
from fluxlock.config.scenario import SEED_MAX
from fluxlock.cosim.outcome import Run, finished, write_outcome
from fluxlock.python_load import LoadFunction, PythonLoad, check_rotor
from fluxlock.results.rundata import RunData

if TYPE_CHECKING:
    from fluxlock.cosim.debugger import GdbServer
    from fluxlock.cosim.native_firmware import NativeFirmware


def scenario_of(scenario: Scenario | Path | str, overrides: Mapping[str, object] | None = None) -> Scenario:
    """A scenario, read from its file unless it is one, with keys changed, and checked.

    overrides: key -> value. Keys are those of the file, `drive.carrier_hz`, `motor.resistance_ohm`,
    `window.steady.to_s`; two underscores may stand for a dot. `motor` and `inverter` take a whole `Motor` and
    `Inverter`, or the path of a file. Raises ConfigError with all problems.

    >>> scenario_of("scenarios/own-spindle.toml", {"motor.resistance_ohm": 0.2}).motor.resistance_ohm  # Ohm, phases
    (0.2, 0.2, 0.2)
    """
    if not isinstance(scenario, (Scenario, str, Path)):
        text = f"must be a Scenario or the path of its file, not {scenario!r:.60}"
        raise ConfigError([Problem("scenario", "", text)])
    keys = [(key.replace("__", ".").split("."), plain(value)) for key, value in (overrides or {}).items()]
    changes = [Override(tuple(parts), value) for parts, value in keys]
    try:
        if isinstance(scenario, Scenario):
            made = changed(scenario, changes)  # code may have made or copied it unchecked
            return made if changes else scenario
        if any(isinstance(o.value, (Motor, Inverter)) for o in changes):
            return changed(load_scenario(scenario), changes)
        return load_scenario(scenario, changes)
    except ConfigError as error:  # no option has stated these keys
        problems = [replace(p, file="") if p.file == SET_OPTION else p for p in error.problems]
        raise ConfigError(problems) from None


def plain(value: object) -> object:
    """What a file would state: NumPy's numbers and arrays as Python's, a path as text."""
    if isinstance(value, (np.generic, np.ndarray)):
        return value.tolist()
    if isinstance(value, (list, tuple)):
        return type(value)(plain(part) for part in value)
    return str(value) if isinstance(value, Path) else value


def whole(name: str, value: object, low: int, high: int | None = None) -> int:
    """An argument that must be a whole number from low to high; else ConfigError names it."""
    number = plain(value)
    if isinstance(number, bool) or not isinstance(number, int) or number < low or (high is not None and number > high):
        to = "" if high is None else f" to {high}"
        raise ConfigError([Problem(name, "", f"must be a whole number from {low}{to}, not {value!r}")])
    return number


def seed_of(scenario: Scenario, seed: int | None) -> int:
    """The seed of a run: the scenario's unless one is given, which is checked."""
    return scenario.seed if seed is None else whole("seed", seed, 0, SEED_MAX)


def results_folder(folder: Path | str) -> Path:
    """A folder for results, made before anything takes time; ConfigError where it cannot be written."""
    try:
        check_folder(Path(folder))
    except OSError as error:
        text = f"cannot be written: {error.strerror}; name another folder"
        raise ConfigError([Problem("folder", str(folder), text)]) from None
    return Path(folder)


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
    from rich.console import Console

    from fluxlock.base.progress import ProgressBar
    from fluxlock.cosim.parameters import check_parameters

    _check_keywords(overrides)
    loaded = scenario_of(scenario, overrides)
    check_parameters(loaded)
    with ProgressBar(Console(stderr=True), loaded.duration_s) if progress else nullcontext() as bar:
        return run_checked(loaded, twin, seed, folder, plots, bar, load_nm)


def _check_keywords(overrides: Mapping[str, object]) -> None:
    """ConfigError where an unknown key is most like another argument of `simulate`."""
    arguments = [name for name, p in signature(simulate).parameters.items() if p.kind is p.KEYWORD_ONLY]
    unknown = [key for key in overrides if key not in Scenario.model_fields and not re.search(r"\.|__", key)]
    near = {key: closest(key, [*arguments, *Scenario.model_fields]) for key in unknown}
    meant = {key: name for key, name in near.items() if name in arguments}
    if meant:
        text = 'unknown keyword, did you mean "{}"?'
        raise ConfigError([Problem(key, "", text.format(name)) for key, name in meant.items()])


@dataclass(frozen=True)
class OnChip:
    """What else the chip of a run has; see `fluxlock.cosim.run.run_scenario`."""

    waves: bool = False
    native: NativeFirmware | None = None
    gdb: GdbServer | None = None


def run_checked(
    loaded: Scenario,
    twin: bool,
    seed: int | None,
    folder: Path | str | None = None,
    plots: bool = True,
    progress: Progress | None = None,
    load_nm: LoadFunction | None = None,
    chip: OnChip = OnChip(),
) -> Run:
    """Run a scenario whose parameters have been checked; see `simulate`. progress: is told of each stage."""
    load = PythonLoad(load_nm) if load_nm is not None else None
    if load is not None:
        check_rotor(loaded)
    used_seed = seed_of(loaded, seed)
    with ExitStack() as stack:
        out = results_folder(folder or stack.enter_context(tempfile.TemporaryDirectory()))
        data = (
            _on_twin(loaded, used_seed, progress, load)
            if twin
            else _on_chip(loaded, out, used_seed, progress, load, chip)
        )
        if folder is None:
            return finished(data, loaded)
        if plots and progress is not None:
            progress(ProgressInfo(data.duration_s, loaded.duration_s, 0.0, 0.0, PLOTTING))
        return write_outcome(data, loaded, out, plots)


def _on_chip(
    scenario: Scenario, folder: Path, seed: int, progress: Progress | None, load: PythonLoad | None, chip: OnChip
) -> RunData:
    from fluxlock.cosim.run import run_scenario
    from fluxlock.generate.registers import check_build

    check_build()
    return run_scenario(scenario, folder, seed, chip.waves, progress, native=chip.native, gdb=chip.gdb, load=load)


def _on_twin(scenario: Scenario, seed: int, progress: Progress | None, load: PythonLoad | None) -> RunData:
    from fluxlock.firmware.host import one_at_a_time
    from fluxlock.native.player import player

    with one_at_a_time():
        tell_building(progress, scenario.duration_s, "twin")
        return player(scenario, seed).run(load, progress)
