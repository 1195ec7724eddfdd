"""Runs inside the simulator as its cocotb test module: one start, then a forked process for every mutant.

Started by `fluxlock.mutation.run`, which names the job file in the environment. While cocotb imports this module, at
simulation time 0, the process forks once a mutant. The child sets the selector, and this module then holds the block's
tests, so that cocotb runs them; the first that fails ends it. The parent only waits, writes one JSON line a mutant and
in the end holds a single empty test.

Outcomes of an earlier start with the same netlist, bench, tests and seed are kept: a run that was stopped goes on.

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
from importlib import import_module
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import cocotb
from cocotb.handle import Immediate
from cocotb.regression import Test, TestGenerator

from fluxlock.paths import ROOT, content_hash

JOB_VARIABLE = "FLUXLOCK_MUTATION_JOB"
TIME_LIMIT_FACTOR, TIME_LIMIT_EXTRA_S = 2.0, 5.0  # of the CPU time that the block as it is needs
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


def outcome(results: Path, status: int) -> dict[str, Any]:
    """What became of one mutant: `killed_by` is empty if all tests passed; `times` and `simulated_ns` of those."""
    times: dict[str, float] = {}
    simulated: dict[str, float] = {}
    found = {"killed_by": "", "times": times, "simulated_ns": simulated}
    if not results.exists():
        return found | {"killed_by": "time" if os.WIFSIGNALED(status) else "simulation stopped"}
    for case in ElementTree.parse(results).getroot().iter("testcase"):
        name = f"{case.get('classname')}.{case.get('name')}"
        if case.find("failure") is not None or case.find("error") is not None:
            return found | {"killed_by": name}
        times[name] = float(case.get("time") or 0.0)
        properties = {item.get("name"): item.get("value", "") for item in case.iter("property")}
        simulated[name] = float(properties["sim_time_duration"])
    return found


class Server:
    """The parent: forks, waits, keeps score of the tests."""

    def __init__(self, job: dict[str, Any]) -> None:
        self.job = job
        self.folder = Path(job["folder"])
        self.tests = find_tests(job["modules"], job["left_out"])
        self.kills = {test.fullname: 0 for test in self.tests}
        self.times = {test.fullname: 1.0 for test in self.tests}
        self.cpu_limit_s = 0
        self.running: dict[int, int] = {}  # process to mutant
        self.out = Path(job["out"])
        sources = [*map(Path, job["sources"]), *source_files()]
        self.inputs = content_hash(sources, [test.fullname for test in self.tests], job["environment"])

    def results(self, mutant: int) -> Path:
        """Result file of one mutant's tests."""
        return self.folder / f"results-{mutant}.xml"

    def order(self) -> list[Any]:
        """Best first: mutants found a second of running time."""
        return sorted(self.tests, key=lambda t: -(self.kills[t.fullname] + 0.1) / (self.times[t.fullname] + 0.01))

    def start(self, mutant: int) -> bool:
        """Fork; True in the child, which is then ready to run the tests."""
        self.results(mutant).unlink(missing_ok=True)
        sys.stdout.flush()
        sys.stderr.flush()
        process = os.fork()
        if process:
            self.running[process] = mutant
            return False
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

    def wait(self) -> tuple[int, dict[str, Any]]:
        """End of one mutant."""
        process, status, usage = os.wait4(-1, 0)
        mutant = self.running.pop(process)
        found = outcome(self.results(mutant), status) | {"cpu_s": round(usage.ru_utime + usage.ru_stime, 2)}
        self.results(mutant).unlink(missing_ok=True)
        if found["killed_by"] in self.kills:
            self.kills[found["killed_by"]] += 1
        with self.out.open("a") as out:
            out.write(json.dumps({"mutant": mutant, **found}) + "\n")
        return mutant, found

    def left(self) -> list[int]:
        """Mutants without an outcome for these inputs; outcomes of others go."""
        kept, written_for = read_outcomes(self.out), self.folder / "inputs"
        if not written_for.exists() or written_for.read_text() != self.inputs:
            kept = {}
        # Without a line that was being written when a run was stopped.
        self.out.write_text("".join(json.dumps({"mutant": n, **found}) + "\n" for n, found in kept.items()))
        written_for.write_text(self.inputs)
        return [mutant for mutant in self.job["mutants"] if mutant not in kept]

    def run(self) -> bool:
        """Run the block as it is, then every mutant that is left; True in a child."""
        left = self.left()
        if self.start(0):
            return True
        _, baseline = self.wait()
        if baseline["killed_by"]:
            return False
        self.times |= baseline["times"]
        for test in self.tests:
            test.timeout = (
                round(CLOCK_LIMIT_FACTOR * baseline["simulated_ns"][test.fullname] + CLOCK_LIMIT_EXTRA_NS),
                "ns",
            )
        self.cpu_limit_s = round(TIME_LIMIT_FACTOR * baseline["cpu_s"] + TIME_LIMIT_EXTRA_S)
        for mutant in left:
            if len(self.running) >= self.job["jobs"]:
                self.wait()
            if self.start(mutant):
                return True
        while self.running:
            self.wait()
        return False


if JOB_VARIABLE in os.environ:
    sys.path.insert(0, str(ROOT))  # the test modules are no part of the package
    _server = Server(json.loads(Path(os.environ[JOB_VARIABLE]).read_text()))
    if _server.run():
        del every_mutant_was_run
        globals().update({f"test_{i}": test for i, test in enumerate(_server.order())})
