# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""File lists of the RTL: whole, what the builds read, and legal for a strict front end."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from fluxlock.base.paths import GENERATED, REGISTER_BLOCKS, RTL
from fluxlock.cosim.block import register_sources
from fluxlock.cosim.chip import CPU_HOST, rtl_sources
from fluxlock.file_lists import CHIP_LIST, board_lists, chip_files, read_list
from fluxlock.generate.registers import generate_registers
from fluxlock.generate.soft_core import CORE, soft_core
from fluxlock.synth.tools import sources

# Command line of slang: complains of what the standard forbids, and says which files it has read.
SLANG = """
import sys
from pyslang.driver import Driver
driver = Driver()
driver.addStandardArgs()
good = driver.parseCommandLine(" ".join(["slang", *sys.argv[1:]])) and driver.processOptions()
good = good and driver.parseAllSources() and driver.runFullCompilation(True)
print(*(driver.sourceManager.getFullPath(buffer) for buffer in driver.sourceManager.getAllBuffers()), sep="\\n")
sys.exit(not good)
"""


def slang(list_: str, top: str, folder: Path) -> tuple[int, str, list[Path]]:
    """Elaborate `top` from a list: exit code, what slang says, files that it has read."""
    command = [sys.executable, "-I", "-c", SLANG, "-F", list_, "--top", top]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    files = [Path(line).resolve() for line in done.stdout.splitlines() if line.startswith("/")]
    return done.returncode, done.stderr, [file for file in files if file.suffix != ".f"]


def test_lists_are_whole() -> None:
    """Every source of the RTL is in a list, and every file of a list is there once its generators have run.

    Verifies: EXP-01
    """
    generate_registers()
    soft_core()
    named = {path for board in board_lists() for path in read_list(board)}
    assert {path for path in named if path.is_relative_to(RTL)} == set(RTL.glob("**/*.sv"))
    assert {path for path in named if path.is_relative_to(GENERATED)} == {*register_sources(*REGISTER_BLOCKS), CORE}
    assert all(path.is_file() for path in named)
    for board in board_lists():
        files = read_list(board)
        assert len(set(files)) == len(files) and files[: len(chip_files())] == chip_files(), board


def test_builds_read_the_lists(tmp_path: Path) -> None:
    """Simulation, synthesis and lint build what the lists name.

    Verifies: EXP-01
    """
    assert rtl_sources() == chip_files()
    assert rtl_sources(native=True)[-1] == CPU_HOST
    assert {path.name for path in chip_files()} - {path.name for path in rtl_sources(native=True)} == {CORE.name}
    assert set(sources()) == {path for board in board_lists() for path in read_list(board)}
    nested = tmp_path / "nested.f"
    nested.write_text("// of the test\n-F sub/inner.f\n\nlast.sv  // this one\n")
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "inner.f").write_text("../first.sv\nsecond.sv\n")
    names = [path.relative_to(tmp_path).as_posix() for path in read_list(nested)]
    assert names == ["first.sv", "sub/second.sv", "last.sv"]


@pytest.mark.parametrize("path", [CHIP_LIST, *board_lists()], ids=lambda path: path.stem)
def test_lists_elaborate(path: Path) -> None:
    """Each list of the checkout elaborates in slang from another folder, which reads nothing else.

    Verifies: EXP-01
    """
    generate_registers()
    soft_core()
    code, said, read = slang(str(path), path.stem, Path("/"))
    assert code == 0 and "error" not in said, said
    assert set(read) == set(read_list(path))
