# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Build steps below `build/`: `python -m fluxlock.generate.registers regs` generates what comes from the register map.

`rtl` also writes the soft core: then every file of `rtl/fl_soc.f` is there, and the core with the debug bus beside it.

Every step keeps a stamp with the hash of its inputs and does nothing when they did not change.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import find_libpython

from fluxlock.base.paths import BUILD, GENERATED, REGISTER_BLOCKS, ROOT, RTL, content_hash, tool_environment
from fluxlock.base.writable import check_folder, file_lock, guarded
from fluxlock.config.errors import Problem, ToolsMissing
from fluxlock.generate import regblock
from fluxlock.generate.soft_core import soft_core

REGBLOCK_OPTIONS = ["--cpuif", "wishbone-flat", "--default-reset", "rst", "--type-style", "hier"]
IO_BASE = 0x8000_0000
PEAKRDL = """
import json, sys
from peakrdl.main import main
for arguments in json.loads(sys.argv[1]):
    sys.argv = ["peakrdl", *arguments]
    print(*sys.argv, flush=True)
    main()
"""


def check_build() -> None:
    """See that the machine has the tools, and that the folders which builds and runs fill can be written.

    Raises ToolsMissing, with the package that brings each tool; OSError names a folder that refuses.
    """
    from fluxlock.plant.build import cache_folder

    done = subprocess.run(["sh", ROOT / "tools" / "needs.sh"], stderr=subprocess.PIPE, text=True, check=False)
    if done.returncode:
        raise ToolsMissing([Problem("", "", done.stderr.strip().removeprefix("error: "))])
    python_library()
    for folder in (BUILD, GENERATED, BUILD / "chip", BUILD / "firmware", BUILD / "bindings", cache_folder()):
        check_folder(folder)


def python_library() -> str:
    """Path of this Python's shared library, by which the simulator runs the plant. Raises ToolsMissing without one."""
    library = find_libpython.find_libpython()
    if library is None:
        package = f"libpython{sys.version_info.major}.{sys.version_info.minor}"
        text = f"this machine lacks the shared library of {sys.executable}: install {package} (Debian, Ubuntu) or "
        text += "python3-libs (Fedora), or take a Python built with --enable-shared"
        raise ToolsMissing([Problem("", "", text)])
    return library


def _peakrdl(*runs: Sequence[str]) -> None:
    """Run PeakRDL once for each list of arguments, all in one process: its start takes longer than a block."""
    command = [sys.executable, "-c", PEAKRDL, json.dumps(runs)]
    done = subprocess.run(command, env=tool_environment(), capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"register generation failed: peakrdl\n{done.stdout}{done.stderr}")


def generate_registers(force: bool = False) -> Path:
    """Generate SV register blocks and C header from `rtl/regs/*.rdl` into `build/generated`.

    Returns the folder. The HTML reference is a step of its own (`html`).
    """
    sources = list((RTL / "regs").glob("*.rdl"))
    key = content_hash([*sources, Path(regblock.__file__)], REGISTER_BLOCKS, REGBLOCK_OPTIONS, IO_BASE)
    stamp = GENERATED / ".regs.stamp"
    with file_lock(BUILD / ".regs.lock"):
        if not force and stamp.exists() and stamp.read_text() == key:
            return GENERATED
        check_folder(GENERATED)
        blocks = [str(RTL / "regs" / f"fl_{block}_regs.rdl") for block in REGISTER_BLOCKS]
        top, header = str(RTL / "regs" / "fluxlock_regs.rdl"), str(GENERATED / "fluxlock_regs.h")
        _peakrdl(
            *(["regblock", rdl, "-o", str(GENERATED), *REGBLOCK_OPTIONS] for rdl in blocks),
            ["c-header", top, "-o", header, "-i", "--inst-offset", hex(IO_BASE)],
        )
        for block in REGISTER_BLOCKS:
            module = GENERATED / f"fl_{block}_regs.sv"
            module.write_text(regblock.gate_with_request(module.read_text()))
        stamp.write_text(key)
    return GENERATED


def generate_python() -> Path:
    """Generate Python accessors into `build/generated/python`; with that folder on the path: `import fluxlock_regs`.

    They read and write through two callbacks, so one API serves a serial line, a debugger or a bus model.
    """
    out = GENERATED / "python"
    sources = list((RTL / "regs").glob("*.rdl"))
    key = content_hash(sources)
    stamp = out / ".stamp"
    with file_lock(BUILD / ".regs-python.lock"):
        if not stamp.exists() or stamp.read_text() != key:
            _peakrdl(["python", str(RTL / "regs" / "fluxlock_regs.rdl"), "-o", str(out), "--skip_test_case_generation"])
            stamp.write_text(key)
    return out


def generate_html() -> Path:
    """Generate the HTML register reference into `build/html/registers`."""
    out = BUILD / "html" / "registers"
    _peakrdl(["html", str(RTL / "regs" / "fluxlock_regs.rdl"), "-o", str(out)])
    return out


def main() -> int:
    """Command line of this module."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("step", choices=["regs", "rtl", "python", "html"])
    parser.add_argument("--force", action="store_true", help="generate again even if nothing changed")
    options = parser.parse_args()
    if options.step == "html":
        print(generate_html())
    elif options.step == "python":
        print(generate_python())
    else:
        print(generate_registers(options.force))
        if options.step == "rtl":
            soft_core()
            soft_core(debug=True)
    return 0


if __name__ == "__main__":
    sys.exit(guarded(main))
