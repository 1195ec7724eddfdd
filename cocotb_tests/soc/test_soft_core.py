# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Changes to the package's core."""

from __future__ import annotations

import pytest

from fluxlock.base.paths import package_dir
from fluxlock.generate.soft_core import SoftCoreError, derive


def package_core() -> str:
    """The core as it is installed."""
    return (package_dir("pythondata_cpu_vexriscv") / "verilog" / "VexRiscv.v").read_text(encoding="utf-8")


def test_core_without_instruction_cache() -> None:
    """The cache is gone, the ports of the memory are there, everything else stays.

    Verifies: SOC-19
    """
    before = package_core()
    core = derive(before)
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
