# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What lies in the flash: header and firmware, parameter block, and the order in which it is written.

The header has the words that `sw/images/boot/image.h` names. Versions: of the register map that the firmware was
compiled for, and of the parameter block that it reads.
"""

from __future__ import annotations

import re
import struct
import zlib
from dataclasses import dataclass

from fluxlock.base.paths import RTL
from fluxlock.firmware.schema import HEADER_WORDS, load_schema
from fluxlock.generate.memory import (
    BLOCK_MAX_BYTES,
    FLASH_BLOCK,
    FLASH_CAN_SETUP,
    FLASH_IMAGE,
    FLASH_PAGE_BYTES,
    FLASH_SECTOR_BYTES,
    image_end,
)

MAGIC = 0x49584C46
FORMAT = 1
IMAGE_MAX_BYTES = image_end()
RESET_VECTOR = 0x80


def map_version() -> int:
    """Version of the register map, from its source."""
    found = re.search(r"map_version\[15:0\] = (\d+);", (RTL / "regs" / "fl_sys_regs.rdl").read_text())
    assert found
    return int(found.group(1))


def pack_image(code: bytes, phases: int) -> bytes:
    """Header page and firmware. code: flat binary for address 0 on."""
    code = code.ljust(-(-len(code) // 4) * 4, b"\0")
    if not RESET_VECTOR < len(code) <= IMAGE_MAX_BYTES:
        raise ValueError(f"an image of {len(code)} bytes; {RESET_VECTOR + 4} to {IMAGE_MAX_BYTES} wanted")
    version = load_schema().version_word
    words = [MAGIC, FORMAT, map_version(), phases, version, len(code), zlib.crc32(code)]
    header = struct.pack(f"<{len(words)}I", *words)
    header += struct.pack("<I", zlib.crc32(header))
    return header.ljust(FLASH_PAGE_BYTES, b"\xff") + code


def pack_can_setup(node_id: int, bit_rate_kbit_per_s: int) -> bytes:
    """What the image with the CANopen node reads beside the parameter block."""
    words = struct.pack("<2I", node_id, bit_rate_kbit_per_s)
    return words + struct.pack("<I", zlib.crc32(words))


@dataclass(frozen=True)
class Plan:
    """Addresses to erase, then pages to write; what makes either part valid comes last."""

    erase: list[int]
    write: list[tuple[int, bytes]]


def _pages(address: int, data: bytes) -> list[tuple[int, bytes]]:
    return [(address + i, data[i : i + FLASH_PAGE_BYTES]) for i in range(0, len(data), FLASH_PAGE_BYTES)]


def plan(image: bytes, block: bytes, can_setup: bytes = b"") -> Plan:
    """How image and parameter block get into the flash.

    The first sectors, with the header of the image and that of the block, go first and come back last, so that at no
    moment a part of the old and a part of the new can be taken for a whole. can_setup: of `pack_can_setup`, for an
    image with the CANopen node. Stored objects lie behind and are not touched.
    """
    if not 4 * HEADER_WORDS < len(block) <= BLOCK_MAX_BYTES:
        raise ValueError(f"a parameter block of {len(block)} bytes")
    erase = [FLASH_BLOCK, *range(FLASH_IMAGE, FLASH_IMAGE + len(image), FLASH_SECTOR_BYTES)]
    head, *code = _pages(FLASH_IMAGE, image)
    first, *rest = _pages(FLASH_BLOCK, block)
    setup = _pages(FLASH_CAN_SETUP, can_setup)
    return Plan(erase, [*code, *rest, *setup, first, head])
