# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Chip, firmware and plan of a scenario for cocotb's runner. In the process of pytest, without a simulator."""

from __future__ import annotations

import os
import pickle
import re
import runpy
import shutil
import sys
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import cache
from importlib import import_module
from itertools import count
from pathlib import Path
from types import ModuleType
from typing import Any

from cocotb_tools.runner import Runner, get_runner

from fluxlock.base.paths import BUILD, content_hash, shipped, tool_environment
from fluxlock.base.writable import InUseError, file_lock
from fluxlock.config import ConfigError, Problem, Scenario, load_scenario
from fluxlock.config.scenario import SEED_MAX
from fluxlock.cosim.block import check_results
from fluxlock.cosim.chip import TOP, rtl_sources
from fluxlock.cosim.launch import bytecode_environment
from fluxlock.cosim.plan import PLAN_ENV, SessionPlan
from fluxlock.cosim.run import chip_of, prepare
from fluxlock.generate.registers import generate_registers

SCENARIO_FILE = "scenario.pickle"  # in the plan's folder
DRIVE_TEST = "of_a_drive"  # attribute of what `drive_test` makes
MODULE = re.compile(r"^\s*module\s+(\w+)", re.MULTILINE)
_led_by_others: list[Bench] = []  # whose folders a runner of the user's still needs


class Bench:
    """A scenario's chip, ready for cocotb's runner.

    scenario: a file, or a `Scenario`. overrides: `key=value` as `--set` of `fluxlock run` takes them; of a file only.
    The scenario's `[[event]]`s do not happen, the test leads the run. seed: of the noise, default the scenario's.
    signals: `module.variable` with * in the variable, which cocotb shall see beside the pins of `fl_soc`; a chip of its
    own is built for them, and each costs some speed. folder: for what the simulation leaves. Default: one below the
    checkout's `build/drive` that is emptied first. It stays that of this bench, while there is one.
    Raises ConfigError if a file, an override or a signal is wrong.
    """

    def __init__(
        self,
        scenario: str | Path | Scenario,
        *overrides: str,
        seed: int | None = None,
        signals: Sequence[str] = (),
        folder: Path | None = None,
    ) -> None:
        if isinstance(scenario, Scenario):
            if overrides:
                raise ConfigError([Problem("scenario", "overrides", "belong to a file; give them to load_scenario")])
            self.scenario = scenario
        else:
            self.scenario = load_scenario(scenario, overrides)
        signals = (signals,) if isinstance(signals, str) else tuple(signals)
        check_signals(signals)
        self.seed = self.scenario.seed if seed is None else seed
        if not 0 <= self.seed <= SEED_MAX:
            raise ConfigError([Problem("seed", str(seed), f"must be from 0 to {SEED_MAX}")])
        generate_registers()
        self.chip = chip_of(self.scenario, signals=signals)
        self._held = ExitStack()
        if folder is None:
            key = content_hash([], self.chip.key, *overrides, self.seed)[:8]
            folder = own_folder(BUILD / "drive" / f"{self.scenario.name}-{key}", self._held)
        self.folder = folder.resolve()
        plan = prepare(self.scenario, self.folder, self.seed)
        self.plan: SessionPlan = replace(plan, actions=())

    def arguments(self) -> dict[str, Any]:
        """Keyword arguments for `test` of cocotb's runner; yours are `test_module` and whatever else it takes.

        The simulation's folder gets the firmware and the plan by this call. It stays as it is until the process ends.
        """
        _led_by_others.append(self)
        return self._arguments()

    def _arguments(self) -> dict[str, Any]:
        (self.folder / SCENARIO_FILE).write_bytes(pickle.dumps(self.scenario))
        return {
            "hdl_toplevel": TOP,
            "hdl_toplevel_lang": "verilog",
            "build_dir": self.chip.executable.parent,
            "test_dir": self.folder,
            "results_xml": str(self.folder / "results.xml"),
            "extra_env": {
                PLAN_ENV: str(self.plan.save()),
                **bytecode_environment(),
                # Assertions of tests say what they compared; those of libraries need not, and import faster.
                "COCOTB_REWRITE_ASSERTION_FILES": "test_*.py",
            },
        }

    def test(self, module: str | Path, **options: Any) -> None:  # noqa: ANN401  # the runner's, each with its type
        """Run the `drive_test`s of a module; AssertionError if one fails, with its message.

        module: its file, usually `__file__`, or a name that Python can import. options: of the runner's `test`, for
        instance `testcase`, `seed`, `plusargs`. `testcase` or `test_filter` choose among all its tests of cocotb. So
        do none where it has no `drive_test`: then its one test makes the `Drive`.
        """
        __tracebackhide__ = True  # in pytest
        path = Path(module)
        if path.suffix == ".py" and not path.is_file():
            raise ConfigError([Problem(str(module), "", "no such file")])
        folder = [str(path.resolve().parent)] if path.suffix == ".py" else []
        before = list(sys.path)
        sys.path[:0] = folder
        results = self.folder / "results.xml"
        results.unlink(missing_ok=True)
        try:
            name = path.stem if folder else str(module)
            chosen = options.get("testcase") or ()
            check_tests(module, chosen.split(",") if isinstance(chosen, str) else chosen)
            if not (options.get("testcase") or options.get("test_filter")):
                options["test_filter"] = filter_of(_globals_of(module))
            get_runner("verilator").test(test_module=name, **self._arguments(), **options)
        except (SystemExit, RuntimeError) as stop:  # also a failed test, which the results tell better
            if not results.exists():
                raise AssertionError(f"the simulation of {module} stopped ({stop}); its log stands above") from stop
        finally:
            sys.path[:] = before
        check_results(results)


def run_tests(
    scenario: str | Path | Scenario,
    module: str | Path,
    *overrides: str,
    seed: int | None = None,
    signals: Sequence[str] = (),
    testcase: str | Sequence[str] | None = None,
) -> None:
    """Run the `drive_test`s of a module on a scenario's chip: `Bench(scenario, ...).test(module)`.

    scenario: a file, in the module's folder or the current one, or a `Scenario`. testcase: only these tests of cocotb.
    """
    __tracebackhide__ = True  # in pytest: the test's line, and what is wrong
    try:
        bench = Bench(find_scenario(scenario, module), *overrides, seed=seed, signals=signals)
    except ConfigError as error:
        raise error.with_traceback(None) from None
    bench.test(module, testcase=testcase)


@cache
def _find_tools() -> None:
    os.environ.update(tool_environment())


def verilator_runner() -> Runner:
    """The `get_runner("verilator")` of cocotb for RTL of your own, with the Verilator that comes with Fluxlock.

    Puts that Verilator in front of this process's PATH.
    """
    _find_tools()
    return get_runner("verilator")


def own_folder(folder: Path, held: ExitStack) -> Path:
    """A folder, emptied and for the holder alone; while another one has it, the same with a number."""
    for number in count():
        own = folder.with_name(f"{folder.name}-{number}") if number else folder
        try:
            held.enter_context(file_lock(own.with_name(f"{own.name}.lock"), wait=False))
        except InUseError:
            continue
        shutil.rmtree(own, ignore_errors=True)
        return own
    raise AssertionError


def find_scenario(scenario: str | Path | Scenario, module: str | Path) -> Path | Scenario:
    """A scenario's file: beside the module's, in the current folder, or a shipped one. ConfigError if there is none."""
    if isinstance(scenario, Scenario):
        return scenario
    folders = [*([Path(module).resolve().parent] if Path(module).suffix == ".py" else []), Path.cwd()]
    for path in (*(folder / scenario for folder in folders), shipped(Path(scenario))):
        if path.is_file():
            return path
    there = " and ".join(dict.fromkeys(map(str, folders)))
    raise ConfigError([Problem(str(scenario), "", f"no such file; looked in {there}")])


def _globals_of(module: str | Path) -> dict[str, Any]:
    """Names of a module, which is loaded already as a rule: by pytest."""
    path = Path(module)
    if path.suffix != ".py":
        return vars(import_module(str(module)))
    for loaded in tuple(sys.modules.values()):
        if isinstance(loaded, ModuleType) and vars(loaded).get("__file__") in (str(path), str(path.resolve())):
            return vars(loaded)
    return runpy.run_path(str(path))


def filter_of(names: dict[str, Any]) -> str | None:
    """A filter for cocotb that takes the `drive_test`s of a module; None if it has none."""
    tests = [re.escape(made.name) for made in names.values() if getattr(made, DRIVE_TEST, None) is True]
    return rf"\.(?:{'|'.join(tests)})(?:/|$)" if tests else None


def check_tests(module: str | Path, chosen: Sequence[str]) -> None:
    """Raise ConfigError if a module has no test that is chosen by its name, with or without its parameters."""
    if not chosen:
        return
    made = [value for value in _globals_of(module).values() if hasattr(value, "expect_fail")]  # by cocotb.test
    names = [f"{Path(module).stem}.{value.name}" for value in made]
    for test in chosen:  # cocotb searches for it at the end of the name, with its parameters behind a slash
        bare = re.compile(rf"{test.split('/')[0]}$")
        if not any(bare.search(name) for name in names):
            there = ", ".join(name.partition(".")[2] for name in names) or "none"
            raise ConfigError([Problem(str(module), test, f"no such test; there is {there}")])


def check_signals(signals: Sequence[str]) -> None:
    """Raise ConfigError for what is no `module.variable` of the chip's sources."""
    known: dict[str, str] = {}
    if signals:
        for path in rtl_sources():
            text = path.read_text(encoding="utf-8")
            known.update((name, text) for name in MODULE.findall(text))
    for signal in signals:
        module, _, variable = signal.rpartition(".")
        if not re.fullmatch(r"\w+\.[\w*]+", signal):
            fault = "is no signal; write module.variable, for instance fl_trip.trip_o"
        elif module not in known:
            fault = f"there is no module {module} in the chip; see rtl/fl_soc.f"
        elif not re.search(rf"\b{variable.replace('*', chr(92) + 'w*')}\b", known[module]):
            fault = f"module {module} has no variable {variable}"
        else:
            continue
        raise ConfigError([Problem("signals", signal, fault)])
