# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Build one RTL module with Verilator and run a cocotb test module on it.

Registers start at random values (`--x-initial unique`), assertions are on, the seed is printed by cocotb. With a folder
in the environment (`COVERAGE_VARIABLE`) Verilator counts what is reached, and the counts go there.
"""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from xml.etree import ElementTree

from cocotb_tools.runner import get_runner

from fluxlock.base.interrupts import EXIT_TERMINATED
from fluxlock.base.paths import BUILD, GENERATED, ROOT, RTL, content_hash, tool_environment
from fluxlock.base.writable import file_lock
from fluxlock.generate.registers import generate_registers

PACKAGES = (RTL / "pkg" / "fl_pkg.sv",)
COVERAGE_VARIABLE = "FLUXLOCK_RTL_COVERAGE"
COVERAGE_ARGUMENTS = ("--coverage-line", "--coverage-toggle")
WAIVERS = RTL / "verilator_waivers.vlt"
# Registers at random, assertions on; one C++ file, little of it, in which a test's time is not spent.
BUILD_ARGUMENTS = (
    *("--x-assign", "unique", "--x-initial", "unique", "--assert"),
    *("-Wall", "-Wno-fatal"),
    *("--output-split", "0", "-CFLAGS", "-O1"),
)
# Against --public-flat-rw, which cocotb asks for and which keeps every signal. A row of instances has no index without.
NOT_ALL_SEEN = "--no-public-flat-rw"
SEEN = 'public_flat_rw -module "{}" -var "*"\n'
OBJECT_CACHE = ROOT / "tools" / "object_cache.sh"


def object_cache() -> str:
    """What stands in front of the compiler in Verilator's makefiles: its runtime is compiled once for all builds."""
    return f"sh '{OBJECT_CACHE}' '{BUILD / 'runtime' / version('verilator')}'"


def register_sources(*blocks: str) -> list[Path]:
    """Generated sources of the named register blocks, in compile order."""
    return [GENERATED / f"fl_{block}_regs{suffix}.sv" for block in blocks for suffix in ("_pkg", "")]


def run_block_test(
    toplevel: str,
    sources: Sequence[str | Path],
    test_module: str,
    *,
    parameters: Mapping[str, int | str] | None = None,
    registers: Sequence[str] = (),
    testcase: str | Sequence[str] | None = None,
    extra_env: Mapping[str, str] | None = None,
    seed: int | None = None,
    waves: bool = False,
    log: Path | None = None,
    assertions: bool = True,
    seen: Sequence[str] = (),
) -> None:
    """Build `toplevel` and run the cocotb tests of `test_module`; raise AssertionError when one fails or the RTL stops.

    sources: RTL files relative to `rtl/` (or absolute); `rtl/pkg/fl_pkg.sv` comes first by itself.
    test_module: dotted name below the repository root, e.g. `cocotb_tests.zcd.test_fl_zcd` (usually `__name__`).
    parameters: module parameters of this build; each set of parameters and sources has a build folder of its own.
    registers: register blocks (`"zcd"`, ...) whose generated sources are compiled too.
    testcase: cocotb test name(s), default all. extra_env: passed to the simulation. seed: cocotb's random seed.
    log: file for what the simulation prints, default the terminal. assertions: those of the RTL end the simulation.
    seen: modules whose signals the tests use beside those of `toplevel` ("*": all). What is seen is not optimized.
    """
    if registers:
        generate_registers()
    files = [*PACKAGES, *register_sources(*registers), *(RTL / s for s in sources)]
    values = dict(parameters or {})
    counts = os.environ.get(COVERAGE_VARIABLE)
    modules = () if "*" in seen else (toplevel, *seen)
    arguments = [*BUILD_ARGUMENTS, *([NOT_ALL_SEEN] if modules else []), *(COVERAGE_ARGUMENTS if counts else ())]
    access = f"`verilator_config\n{''.join(map(SEEN.format, modules))}"
    key = content_hash(files, toplevel, sorted(values.items()), waves, ROOT, arguments, access)
    build_dir = BUILD / "block" / f"{toplevel}-{key}"
    name = "-".join(str(v) for v in [test_module.split(".")[-1], *([testcase] if isinstance(testcase, str) else [])])
    run_dir = build_dir / f"run-{name}-{os.getpid()}"
    run_dir.mkdir(parents=True, exist_ok=True)
    runner = get_runner("verilator")
    saved = dict(os.environ)
    os.environ.update(tool_environment(), OBJCACHE=object_cache())
    try:
        with file_lock(BUILD / "block" / f"{toplevel}-{key}.lock"):
            if not (build_dir / ".done").exists():
                (build_dir / "seen.vlt").write_text(access)
                runner.build(
                    sources=[WAIVERS, build_dir / "seen.vlt", *files],
                    hdl_toplevel=toplevel,
                    parameters=values,
                    build_dir=build_dir,
                    timescale=("1ns", "1ns"),
                    waves=waves,
                    always=True,
                    build_args=arguments,
                    log_file=build_dir / "build.log",
                )
                (build_dir / ".done").touch()
        runner = get_runner("verilator")
        try:
            results = runner.test(
                test_module=test_module,
                hdl_toplevel=toplevel,
                hdl_toplevel_lang="verilog",
                build_dir=build_dir,
                test_dir=run_dir,
                testcase=testcase,
                seed=seed,
                waves=waves,
                plusargs=[] if assertions else ["+verilator+noassert"],
                timescale=("1ns", "1ns"),
                results_xml=str(run_dir / "results.xml"),
                log_file=log,
                extra_env={
                    "PYTHONPATH": str(ROOT),
                    "COCOTB_REWRITE_ASSERTION_FILES": "test_*.py",
                    **(extra_env or {}),
                },
            )
        except (SystemExit, RuntimeError) as stop:
            if isinstance(stop, SystemExit) and stop.code == EXIT_TERMINATED:
                raise  # this process is told to end
            raise AssertionError(f"{test_module} failed, or its simulation stopped: {stop}") from stop
        if counts and (run_dir / "coverage.dat").exists():
            shutil.move(run_dir / "coverage.dat", Path(counts) / f"{toplevel}-{key}-{name}-{time.time_ns()}.dat")
    finally:
        os.environ.clear()
        os.environ.update(saved)
    check_results(Path(results))


def check_results(results: Path) -> None:
    """Raise AssertionError unless the cocotb result file holds at least one test and no failure."""
    cases = list(ElementTree.parse(results).getroot().iter("testcase"))
    kinds = ("failure", "error")
    failed = [(c.get("name"), found) for c in cases for kind in kinds if (found := c.find(kind)) is not None]
    said = "\n".join(f"{name}: {found.get('message') or found.text}" for name, found in failed)
    assert cases, f"no test ran: {results}"
    assert not failed, f"cocotb tests failed (log above, results in {results}):\n{said}"
