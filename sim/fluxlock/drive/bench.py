# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Chip, firmware and plan of a scenario for cocotb's runner. In the process of pytest, without a simulator."""

from __future__ import annotations

import os
import pickle
import re
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from cocotb_tools.runner import get_runner

from fluxlock.base.paths import BUILD, content_hash
from fluxlock.config import ConfigError, Problem, Scenario, load_scenario
from fluxlock.cosim.block import check_results
from fluxlock.cosim.chip import TOP, rtl_sources
from fluxlock.cosim.launch import bytecode_environment
from fluxlock.cosim.plan import PLAN_ENV, SessionPlan
from fluxlock.cosim.run import chip_of, prepare
from fluxlock.generate.registers import generate_registers

SCENARIO_FILE = "scenario.pickle"  # in the plan's folder
MODULE = re.compile(r"^\s*module\s+(\w+)", re.MULTILINE)


class Bench:
    """A scenario's chip, ready for cocotb's runner.

    scenario: a file, or a `Scenario`. overrides: `key=value` as `--set` of `fluxlock run` takes them; of a file only.
    The scenario's `[[event]]`s do not happen, the test leads the run. seed: of the noise, default the scenario's.
    signals: `module.variable` with * in the variable, which cocotb shall see beside the pins of `fl_soc`; a chip of its
    own is built for them, and each costs some speed. folder: for what the simulation leaves, default below the
    checkout's `build/drive`.
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
                raise ConfigError([Problem("scenario", "overrides", "belong to a file; change the object instead")])
            self.scenario = scenario
        else:
            self.scenario = load_scenario(scenario, overrides)
        check_signals(signals)
        self.seed = self.scenario.seed if seed is None else seed
        generate_registers()
        self.chip = chip_of(self.scenario, signals=tuple(signals))
        name = f"{self.scenario.name}-{content_hash([], self.chip.key, *overrides, os.getpid())[:8]}"
        self.folder = (folder or BUILD / "drive" / name).resolve()
        plan = prepare(self.scenario, self.folder, self.seed)
        self.plan: SessionPlan = replace(plan, actions=())

    def arguments(self) -> dict[str, Any]:
        """Keyword arguments for `test` of cocotb's runner; yours are `test_module` and whatever else it takes.

        The simulation's folder gets the firmware and the plan by this call.
        """
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
        """Run the cocotb tests of a module; AssertionError if one fails, with its message.

        module: its file, usually `__file__`, or a name that Python can import. options: of the runner's `test`, for
        instance `testcase`, `seed`, `plusargs`.
        """
        path = Path(module)
        folder = [str(path.resolve().parent)] if path.suffix == ".py" else []
        before = list(sys.path)
        sys.path[:0] = folder
        results = self.folder / "results.xml"
        results.unlink(missing_ok=True)
        try:
            name = path.stem if folder else str(module)
            get_runner("verilator").test(test_module=name, **self.arguments(), **options)
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
    """Run the cocotb tests of a module on a scenario's chip: `Bench(scenario, ...).test(module)`."""
    Bench(scenario, *overrides, seed=seed, signals=signals).test(module, testcase=testcase)


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
