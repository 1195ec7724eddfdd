# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Instructions of the firmware that are replaced while the chip runs."""

from __future__ import annotations

import struct
from pathlib import Path

from elftools.elf.elffile import ELFFile
from elftools.elf.sections import SymbolTableSection

from fluxlock.cosim.plan import Action
from fluxlock.generate.memory import STACK_ADDRESS

NOP = 0x00000013
ILLEGAL = 0x00000012
MISALIGNED = 0x00102003  # lw zero, 1(zero)
OUTSIDE = 0x0007F06F  # jal to 508 KiB behind itself
TO_ITSELF = 0x0000006F
# lui t0, sw zero, 0(t0), ret: the last word of the stack is written by the core, so that its data cache knows.
STACK_END = (STACK_ADDRESS | 0x2B7, 0x0002A023, 0x00008067)


def symbols(elf: Path) -> dict[str, tuple[int, int]]:
    """Address and size of the symbols of an ELF file; of equal names the last one."""
    with elf.open("rb") as file:
        table = ELFFile(file).get_section_by_name(".symtab")
        assert isinstance(table, SymbolTableSection)  # no image is stripped
        return {symbol.name: (symbol["st_value"], symbol["st_size"]) for symbol in table.iter_symbols()}


def word_at(image: Path, address: int) -> int:
    """Instruction of an image."""
    return int(struct.unpack_from("<I", image.read_bytes(), address)[0])


def entry(image: Path, function: str) -> int:
    """Address of a function's first instruction."""
    return symbols(image.with_suffix(".elf"))[function][0]


def idle_place(image: Path) -> int:
    """Address of the instruction with which the main loop passes its time."""
    begin, size = symbols(image.with_suffix(".elf"))["main"]
    return next(at for at in range(begin, begin + size, 4) if word_at(image, at) == NOP)


def call(image: Path, address: int, function: str) -> int:
    """The instruction that calls a function from an address: `jal ra`, its distance below 1 MiB."""
    away = entry(image, function) - address
    return (away >> 20 & 1) << 31 | (away >> 1 & 0x3FF) << 21 | (away >> 11 & 1) << 20 | away & 0xFF000 | 0xEF


def rewrite(image: Path, address: int, word: int, cycle: int) -> tuple[Action, ...]:
    """Actions that leave another instruction at an address, bit by bit within a clock; twice, it is whole again."""
    changed = word_at(image, address) ^ word
    bits = [bit for bit in range(32) if changed >> bit & 1]
    return tuple(Action(cycle, "memory", {"address": address, "bit": bit}) for bit in bits)
