# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Changes to the package's core."""

from __future__ import annotations

import re

import pytest

from fluxlock.base.paths import package_dir
from fluxlock.generate.soft_core import SoftCoreError, derive

PORT = re.compile(r"^  (?:in|out)put (?:reg)? *(\[\S+\])? *(\w+),?$", re.MULTILINE)


def package_core(debug: bool = False) -> str:
    """The core as it is installed."""
    name = "VexRiscv_Debug.v" if debug else "VexRiscv.v"
    return (package_dir("pythondata_cpu_vexriscv") / "verilog" / name).read_text(encoding="utf-8")


@pytest.mark.parametrize("debug", [False, True])
def test_core_without_instruction_cache(debug: bool) -> None:
    """The cache is gone, the ports of the memory are there, everything else stays.

    Verifies: SOC-19
    """
    before = package_core(debug)
    core = derive(before, debug)
    assert "module InstructionCache" in before and "InstructionCache IBus" in before
    assert "module InstructionCache" not in core and "InstructionCache IBus" not in core
    assert core.index("instructionMemory_ADR,") < core.index("iBusWishbone_CYC,")
    assert before[before.index("module DataCache") : before.index("module InstructionCache")] in core


@pytest.mark.parametrize("lacking", ["iBusWishbone_CYC,", "InstructionCache IBus", "module InstructionCache"])
def test_other_core_is_refused(lacking: str) -> None:
    """A core in which a place to change is missing, or which was changed already, is not built.

    Verifies: SOC-19
    """
    with pytest.raises(SoftCoreError, match="0 matches"):
        derive(package_core().replace(lacking, "other"))
    with pytest.raises(SoftCoreError, match="0 matches"):
        derive(derive(package_core()))


@pytest.mark.parametrize("debug", [False, True])
def test_core_is_the_one_that_was_asked_for(debug: bool) -> None:
    """Neither core passes for the other, and the chip finds the same ports at both.

    Verifies: SOC-32
    """
    with pytest.raises(SoftCoreError, match="0 matches"):
        derive(package_core(not debug), debug)
    plain, other = (derive(package_core(kind), kind) for kind in (False, True))
    ports = [set(PORT.findall(core[: core.index(");")])) for core in (plain, other)]
    assert ports[0] == ports[1] and ("[31:0]", "debug_bus_rsp_data") in ports[0]
