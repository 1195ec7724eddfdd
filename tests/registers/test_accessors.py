# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The generated Python accessors, C header and register map describe the same addresses and fields."""

from __future__ import annotations

import sys
from typing import Any

import pytest

from fluxlock.firmware.host import register_offsets
from fluxlock.generate.registers import IO_BASE, generate_python


class Memory:
    """Word memory behind the accessors' callbacks."""

    def __init__(self) -> None:
        self.words: dict[int, int] = {}

    def read(self, addr: int, width: int, accesswidth: int) -> int:
        return self.words.get(addr, 0)

    def write(self, addr: int, width: int, accesswidth: int, data: int) -> None:
        self.words[addr] = data


@pytest.fixture(scope="module")
def accessors() -> tuple[Any, Memory]:
    sys.path.insert(0, str(generate_python()))
    try:
        from fluxlock_regs.lib import NormalCallbackSet  # type: ignore[import-not-found]
        from fluxlock_regs.reg_model import RegModel  # type: ignore[import-not-found]
    finally:
        sys.path.pop(0)
    memory = Memory()
    return RegModel(callbacks=NormalCallbackSet(read_callback=memory.read, write_callback=memory.write)), memory


def test_addresses_agree_with_the_c_header(accessors: tuple[Any, Memory]) -> None:
    """Every register of every block has the same offset in Python and in C.

    Verifies: REG-01
    """
    chip, _ = accessors
    offsets = register_offsets()
    seen = 0
    for name, offset in offsets.items():
        block, register = name.split(".")
        if register.startswith("RESERVED"):
            continue
        node = getattr(getattr(chip, block), register)
        node = node[0] if hasattr(node, "dimensions") or not hasattr(node, "address") else node
        assert node.address == offset, name
        seen += 1
    assert seen > 60
    assert IO_BASE == 0x8000_0000


def test_fields_are_written_and_read_by_name(accessors: tuple[Any, Memory]) -> None:
    """A field write lands in the bits of the register map and reads back.

    Verifies: REG-01
    """
    chip, memory = accessors
    chip.safety.current_limit.dc_lsb.write(0x5A5)
    offsets = register_offsets()
    assert memory.words[offsets["safety.current_limit"]] >> 16 & 0xFFF == 0x5A5
    assert chip.safety.current_limit.dc_lsb.read() == 0x5A5
    chip.zcd.threshold[3].vdc_q17.write(0x12345)
    assert memory.words[offsets["zcd.threshold"] + 12] & 0x1FFFF == 0x12345
