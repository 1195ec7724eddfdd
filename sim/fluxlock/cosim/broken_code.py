# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Instructions of the firmware that are replaced while the chip runs."""

from __future__ import annotations

import struct
from pathlib import Path

from fluxlock.cosim.plan import Action

NOP = 0x00000013
ILLEGAL = 0x00000012
MISALIGNED = 0x00102003  # lw zero, 1(zero)
OUTSIDE = 0x0007F06F  # jal to 508 KiB behind itself
TO_ITSELF = 0x0000006F


def symbols(elf: Path) -> dict[str, tuple[int, int]]:
    """Address and size of the symbols of a 32-bit little-endian ELF file; of equal names the last one."""
    data = elf.read_bytes()
    (table,) = struct.unpack_from("<I", data, 32)
    size, count = struct.unpack_from("<HH", data, 46)
    sections = [struct.unpack_from("<10I", data, table + size * n) for n in range(count)]
    found = {}
    for _, kind, _, _, offset, length, link, _, _, entry in sections:
        for at in range(offset, offset + length, entry) if kind == 2 else ():
            name, value, bytes_ = struct.unpack_from("<III", data, at)
            text = sections[link][4] + name
            found[data[text : data.index(b"\0", text)].decode()] = value, bytes_
    return found


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


def rewrite(image: Path, address: int, word: int, cycle: int) -> tuple[Action, ...]:
    """Actions that leave another instruction at an address, bit by bit within a clock; twice, it is whole again."""
    changed = word_at(image, address) ^ word
    bits = [bit for bit in range(32) if changed >> bit & 1]
    return tuple(Action(cycle, "memory", {"address": address, "bit": bit}) for bit in bits)
