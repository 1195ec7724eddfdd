# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Runs inside the simulator as its cocotb test module: one start, then a forked process for every mutant.

Started by `fluxverify.mutation.run`, which names the job file in the environment: first for the block as it is, then
for each share of the mutants, side by side. While cocotb imports this module, at simulation time 0, the process forks
once a mutant. The child sets the selector, and this module then holds the block's tests, so that cocotb runs them; the
first that fails ends it. The parent only waits, writes one JSON line a mutant and in the end holds a single empty test.

What an earlier start with the same netlist, bench and seed found with test modules that have not changed is kept: a run
that was stopped goes on, and where a test module was added, only its tests are run on the mutants that survived.

Tests that have found many mutants in little time come first. A mutant is killed by a failing test, by a test that
takes much more simulated time than on the block as it is (it waits for what never comes), by the end of the simulation
(an assertion of the bench), or by using up its CPU time.
"""

from __future__ import annotations

import atexit
import json
import os
import resource
import sys
from collections import Counter
from collections.abc import Iterable, Set
from importlib import import_module
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import cocotb
from cocotb.handle import Immediate
from cocotb.regression import Test, TestGenerator

from fluxlock.base.paths import ROOT, content_hash
from fluxlock.base.processes import end_with_parent
from fluxverify.mutation.blocks import NONE

JOB_VARIABLE = "FLUXLOCK_MUTATION_JOB"
TIME_LIMIT_FACTOR, TIME_LIMIT_EXTRA_S = 2.0, 5.0  # of the CPU time that the block as it is needs
OTHER_ENDS = ("time", "simulation stopped")  # of a mutant than by a failing test
CLOCK_LIMIT_FACTOR, CLOCK_LIMIT_EXTRA_NS = 2.0, 2000.0  # of the simulated time that a test needs on it


@cocotb.test()
async def every_mutant_was_run(_: object) -> None:
    """The parent's own test: cocotb wants one."""


def find_tests(modules: list[str], left_out: list[str]) -> list[Any]:
    """Every cocotb test of the modules, as cocotb itself would find them."""
    tests = []
    for module in modules:
        for item in vars(import_module(module)).values():
            if isinstance(item, Test):
                tests.append(item)
            elif isinstance(item, TestGenerator):
                tests += item.generate_tests()
    return [test for test in tests if test.func.__name__ not in left_out]


def source_files() -> set[Path]:
    """Modules of this checkout that are loaded: the tests and all that they use."""
    paths = {Path(name) for m in list(sys.modules.values()) if (name := getattr(m, "__file__", None))}
    return {path for path in paths if path.is_relative_to(ROOT) and not path.is_relative_to(ROOT / ".venv")}


def read_outcomes(path: Path) -> dict[int, dict[str, Any]]:
    """Outcome by mutant so far; a line still being written is left for the next look."""
    lines = path.read_text().splitlines(keepends=True) if path.exists() else []
    found = [json.loads(line) for line in lines if line.endswith("\n")]
    return {entry.pop("mutant"): entry for entry in found}


def has_ended(found: dict[str, Any] | None, unchanged: dict[str, Any]) -> bool:
    """Whether a mutant's outcome is one of all tests. unchanged: outcome of the block as it is, which passes all."""
    return found is not None and bool(found["killed_by"] or found["times"].keys() >= unchanged["times"].keys())


def outcome(results: Path, status: int) -> dict[str, Any]:
    """What became of one mutant: `killed_by` is empty if all tests passed; `times` and `simulated_ns` of those."""
    times: dict[str, float] = {}
    simulated: dict[str, float] = {}
    found = {"killed_by": "", "times": times, "simulated_ns": simulated}
    if not results.exists():
        return found | {"killed_by": OTHER_ENDS[0 if os.WIFSIGNALED(status) else 1]}
    for case in ElementTree.parse(results).getroot().iter("testcase"):
        name = f"{case.get('classname')}.{case.get('name')}"
        if case.find("failure") is not None or case.find("error") is not None:
            return found | {"killed_by": name}
        times[name] = float(case.get("time") or 0.0)
        properties = {item.get("name"): item.get("value", "") for item in case.iter("property")}
        simulated[name] = float(properties["sim_time_duration"])
    return found


def module_of(test: str, modules: Iterable[str]) -> str:
    """Module of a test by the test's full name; empty: none of them."""
    return next((module for module in modules if test.startswith(f"{module}.")), "")


def still_known(found: dict[str, Any], unchanged: Set[str], *, all_unchanged: bool) -> dict[str, Any]:
    """What holds of an earlier outcome, if only the test modules `unchanged` are as they were then; empty: nothing.

    all_unchanged: no other module was there then. A kill holds with its module, any other end with all of them; else
    the tests that passed are what holds.
    """
    if killer := found["killed_by"]:
        return found if module_of(killer, unchanged) or (all_unchanged and killer in OTHER_ENDS) else {}
    passed = {test: time_s for test, time_s in found["times"].items() if module_of(test, unchanged)}
    return found | {"times": passed, "simulated_ns": {test: found["simulated_ns"][test] for test in passed}}


class Server:
    """The parent: forks, waits, keeps score of the tests."""

    def __init__(self, job: dict[str, Any]) -> None:
        self.job = job
        self.folder = Path(job["folder"])
        self.tests = find_tests(job["modules"], job["left_out"])
        self.kills = Counter[str]()
        self.times = {test.fullname: 1.0 for test in self.tests}
        self.cpu_limit_s = 0
        self.out = Path(job["out"])
        self.before: dict[int, dict[str, Any]] = {}  # tests that mutants have passed in an earlier start
        self.mutant = NONE  # of a child

    def inputs(self) -> dict[str, Any]:
        """Hashes of what outcomes depend on: of each test module, and of the rest."""
        job = self.job
        sources = [*map(Path, job["sources"]), *source_files()]
        tests = {name: Path(str(sys.modules[name].__file__)) for name in job["modules"]}
        rest = [path for path in sources if path not in tests.values()]
        return {
            "bench": content_hash(rest, job["environment"]),
            "modules": {
                name: content_hash([path], [test.fullname for test in self.tests if module_of(test.fullname, [name])])
                for name, path in tests.items()
            },
        }

    def results(self, mutant: int) -> Path:
        """Result file of one mutant's tests."""
        return self.folder / f"results-{mutant}.xml"

    def order(self) -> list[Any]:
        """Best first: mutants found a second of running time; without those that the child's mutant has passed."""
        passed = self.before.get(self.mutant, {"times": {}})["times"]
        tests = [test for test in self.tests if test.fullname not in passed]
        return sorted(tests, key=lambda t: -(self.kills[t.fullname] + 0.1) / (self.times[t.fullname] + 0.01))

    def start(self, mutant: int) -> bool:
        """Fork and wait; True in the child, which is then ready to run the tests."""
        self.results(mutant).unlink(missing_ok=True)
        sys.stdout.flush()
        sys.stderr.flush()
        process = os.fork()
        if process:
            self.wait(process, mutant)
            return False
        end_with_parent()
        self.mutant = mutant
        # The results are written by then; the simulator's own end waits for threads that a fork does not copy.
        atexit.register(os._exit, 0)
        os.environ["COCOTB_RESULTS_FILE"] = str(self.results(mutant))
        silent = os.open(self.folder / "baseline.log" if not mutant else os.devnull, os.O_WRONLY | os.O_CREAT)
        os.dup2(silent, 1)
        os.dup2(silent, 2)
        if self.cpu_limit_s:
            resource.setrlimit(resource.RLIMIT_CPU, (self.cpu_limit_s, self.cpu_limit_s + 5))
        handle: Any = cocotb.top
        for name in self.job["selector"]:
            handle = getattr(handle, name)
        handle.set(Immediate(mutant))
        return True

    def wait(self, process: int, mutant: int) -> None:
        """Until the end of a mutant, whose outcome is written then."""
        _, status, usage = os.wait4(process, 0)
        found = outcome(self.results(mutant), status) | {"cpu_s": round(usage.ru_utime + usage.ru_stime, 2)}
        if (before := self.before.get(mutant)) and not found["killed_by"]:
            found |= {key: before[key] | found[key] for key in ("times", "simulated_ns")}
        self.results(mutant).unlink(missing_ok=True)
        self.kills[found["killed_by"]] += 1
        out = os.open(self.out, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
        os.write(out, (json.dumps({"mutant": mutant, **found}) + "\n").encode())  # at once: other shares write too
        os.close(out)

    def take_over(self) -> None:
        """Leave of the outcomes of earlier starts what still holds, none of the block as it is."""
        written_for, inputs = self.folder / "inputs.json", self.inputs()
        then = json.loads(written_for.read_text()) if written_for.exists() else {}
        now = inputs["modules"]
        unchanged: set[str] = set()
        if then.get("bench") == inputs["bench"]:
            unchanged = {name for name, key in then["modules"].items() if now.get(name) == key}
        kept = {}
        for mutant, found in read_outcomes(self.out).items():
            known = still_known(found, unchanged, all_unchanged=len(unchanged) == len(then.get("modules", {})))
            if known and mutant != NONE:
                kept[mutant] = known
        # Without a line that was being written when a run was stopped.
        self.out.write_text("".join(json.dumps({"mutant": n, **found}) + "\n" for n, found in kept.items()))
        written_for.write_text(json.dumps(inputs))

    def set_limits(self) -> None:
        """By what the block as it is has needed, and by the mutants that are through."""
        self.before = read_outcomes(self.out)
        baseline = self.before.pop(NONE)
        self.kills.update(found["killed_by"] for found in self.before.values())
        self.times |= baseline["times"]
        for test in self.tests:
            test.timeout = (
                round(CLOCK_LIMIT_FACTOR * baseline["simulated_ns"][test.fullname] + CLOCK_LIMIT_EXTRA_NS),
                "ns",
            )
        self.cpu_limit_s = round(TIME_LIMIT_FACTOR * baseline["cpu_s"] + TIME_LIMIT_EXTRA_S)

    def run(self) -> bool:
        """Run the mutants of the job; True in a child."""
        mutants = self.job["mutants"]
        if mutants == [NONE]:
            self.take_over()
        else:
            self.set_limits()
        return any(self.start(mutant) for mutant in mutants)


if JOB_VARIABLE in os.environ:
    end_with_parent()
    sys.path.insert(0, str(ROOT))  # the test modules are no part of the package
    _server = Server(json.loads(Path(os.environ[JOB_VARIABLE]).read_text()))
    if _server.run():
        del every_mutant_was_run
        globals().update({f"test_{i}": test for i, test in enumerate(_server.order())})
