# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The chip's registers as the simulator main can flip them: a table made from the Verilated model's header.

In it: the registers of our RTL by their names, outputs that are registers, storage and pipeline registers of register
blocks and soft core. Not in it: arrays (memories, the core's register file and caches), other registers of the core,
what the model has merged or optimized away, and registers that only assertions read, which no netlist holds.
"""

from __future__ import annotations

import re
from pathlib import Path

from fluxlock.base.paths import RTL
from fluxlock.cosim.registers import Place, helper_places, modules, output_places

HEADER = "Vtop___024root.h"
TABLE = "upsets.inc"
TOP = "fl_soc"
# One scalar or vector of the flattened model: storage, highest bit, name.
_MEMBER = re.compile(r"^\s*(?:CData|SData|IData|QData|VlWide<\d+>)/\*(\d+):0\*/ (fl_soc__DOT__\w+);", re.MULTILINE)
# Names that are registers: ours end so, those of the register blocks and of the soft core's pipeline begin so.
_REGISTER = re.compile(r"(_q|__field_storage_\w+|__(decode_to_execute|execute_to_memory|memory_to_writeBack)_\w+)$")
_GENERATE = re.compile(r"g_\w+")


def place_of(name: str) -> Place:
    """Where a name of the model's header stands in the chip."""
    return tuple(part for part in name.split("__DOT__") if not _GENERATE.fullmatch(part))


def registers_of(header: str, rtl: list[Path]) -> dict[str, int]:
    """Registers and their bits, by the names of the model's header, in their order."""
    bits = {name: int(top) + 1 for top, name in _MEMBER.findall(header)}
    known = modules(rtl)
    helpers = helper_places(known, TOP)
    found = {name for name in bits if _REGISTER.search(name) and place_of(name) not in helpers}
    at: dict[Place, list[str]] = {}
    for name in bits:
        at.setdefault(place_of(name), []).append(name)
    for places in output_places(known, TOP):
        found.update(next((at[place] for place in places if place in at), []))
    return {name: bits[name] for name in sorted(found)}


def write_upset_table(folder: Path) -> None:
    """Write the table beside the model's header, for `cosim_main.cpp`."""
    registers = registers_of((folder / HEADER).read_text(), sorted(RTL.glob("*/*.sv")))
    (folder / TABLE).write_text("".join(f"UPSET({name}, {bits})\n" for name, bits in registers.items()))


def read_upset_table(folder: Path) -> dict[str, int]:
    """Registers and their bits, in the order of the table."""
    found = re.findall(r"UPSET\((\w+), (\d+)\)", (folder / TABLE).read_text())
    return {name: int(bits) for name, bits in found}
