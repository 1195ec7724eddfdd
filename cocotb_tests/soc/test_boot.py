# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The loader on the core, with a flash at its pins: what is right starts, nothing else does, and the line says why.

The flash is filled from outside or through the host's own code (`fluxlock.flash`).
"""

from __future__ import annotations

import random
import struct
import zlib
from typing import Any

import cocotb
import pytest
from cocotb.task import bridge
from cocotb.triggers import Timer

from cocotb_tests.soc.boot_bench import BootBench, Line, build_program, make_block
from fluxlock.base.paths import REGISTER_BLOCKS, ROOT
from fluxlock.cosim.block import run_block_test
from fluxlock.firmware.toolchain import build_loader
from fluxlock.flash.image import IMAGE_MAX_BYTES, map_version, pack_image, plan
from fluxlock.flash.loader import HELLO, WRITE, Loader, LoaderError, SerialLine, frame
from fluxlock.generate.memory import FLASH_BLOCK, FLASH_END, FLASH_IMAGE, FLASH_PAGE_BYTES
from fluxlock.generate.soft_core import soft_core

PHASES = 3
LISTEN_MS = 1
RUNNING = "running"
SOURCES = [
    *(f"soc/fl_{name}.sv" for name in ("bus_pkg", "map_pkg")),
    "common/fl_sync.sv",
    "common/fl_fifo.sv",
    "common/fl_ram.sv",
    *(f"soc/fl_{name}.sv" for name in ("cpu", "interconnect", "sys_wb", "uart_rx", "uart_tx", "uart")),
    *(f"soc/fl_{name}.sv" for name in ("uart_wb", "spi", "spi_wb")),
    soft_core(),
]


def with_word(image: bytes, index: int, value: int, seal: bool = True) -> bytes:
    """An image whose header has another word; seal: with a CRC that is right for it."""
    words = list(struct.unpack_from("<8I", image))
    words[index] = value
    if seal:
        words[7] = zlib.crc32(struct.pack("<7I", *words[:7]))
    return struct.pack("<8I", *words) + image[32:]


async def started(tb: BootBench, image: bytes, block: bytes) -> str:
    """What the chip says after a reset with these in the flash."""
    tb.fill(FLASH_IMAGE, image)
    tb.fill(FLASH_BLOCK, block)
    await tb.reset()
    return await tb.line()


@cocotb.test()
async def only_what_is_right_is_started(dut: Any) -> None:
    dut._log.info("seed %d", cocotb.RANDOM_SEED)
    rng = random.Random(cocotb.RANDOM_SEED)
    tb = BootBench(dut)
    await tb.start()
    assert await tb.line() == "boot: not started: no image"  # an empty flash
    code = build_program()
    good, block = pack_image(code, PHASES), make_block()
    length, version = struct.unpack_from("<II", good, 16)[::-1]
    bit = 1 << rng.randrange(8)
    at = FLASH_PAGE_BYTES + rng.randrange(len(code))
    flipped = good[:at] + bytes([good[at] ^ bit]) + good[at + 1 :]
    in_block = rng.randrange(16, len(block))
    cases = [
        ("no image", with_word(good, 0, 0xFFFFFFFF), block),
        ("image header CRC", with_word(good, rng.randrange(1, 7), rng.randrange(1 << 20), seal=False), block),
        ("image format", with_word(good, 1, 2), block),
        ("image is for another chip", with_word(good, 2, map_version() ^ 1), block),
        ("image is for another chip", with_word(good, 3, 5), block),
        ("image length", with_word(good, 5, 0x80), block),
        ("image length", with_word(good, 5, length + 2), block),
        ("image length", with_word(good, 5, IMAGE_MAX_BYTES + 4), block),
        ("image CRC", flipped, block),
        ("image CRC", with_word(good, 5, length - 4), block),
        ("image CRC", good[: FLASH_PAGE_BYTES + length // 2].ljust(len(good), b"\xff"), block),  # cut short
        ("no parameter block", good, bytes([block[0] ^ bit]) + block[1:]),
        ("parameter block version", good, make_block(version=version + 1)),
        ("parameter block version", with_word(good, 4, version ^ 1 << 16), block),
        ("parameter block length", good, block[:8] + struct.pack("<I", 4096) + block[12:]),
        ("parameter block CRC", good, block[:in_block] + bytes([block[in_block] ^ bit]) + block[in_block + 1 :]),
    ]
    for reason, image, parameters in cases:
        assert await started(tb, image, parameters) == f"boot: not started: {reason}"
        assert await tb.line(limit_s=0.001) == "", f"{reason}: more than the reason"
    assert await started(tb, good, block) == RUNNING
    # Again, with what the program and the cases before left in the RAM; then without a flash.
    await tb.reset()
    assert await tb.line() == RUNNING
    dut.flash_power_i.value = 0
    dut.rst_i.value = 1
    await Timer(100, "ns")
    dut.rst_i.value = 0
    assert await tb.line() == "boot: not started: no flash"


@cocotb.test()
async def host_writes_and_starts(dut: Any) -> None:
    """The host's code fills the flash through the loader; bad frames and addresses change nothing."""
    tb = BootBench(dut)
    await tb.start()
    code = build_program()
    image, block = pack_image(code, PHASES), make_block()
    loader = Loader(SerialLine(Line(tb)))
    assert await bridge(loader.find)(20) == (1, 0xEF4016)
    for address in (FLASH_IMAGE, FLASH_BLOCK):
        tb.fill(address, b"\xff" * 4096)
    tb.fill(FLASH_IMAGE + 0x300, bytes(64))  # what lies there must be erased first

    await tb.send(b"\xa5\x02" + frame(WRITE, bytes(8))[:-1] + b"\x00")  # noise, then a frame with a wrong CRC
    assert await tb.take(1, 0.001) == b""
    await Timer(25, "ms")  # the loader gives up waiting for the rest of a frame
    for address in (0, FLASH_IMAGE - 256, FLASH_END, 0x400000):
        with pytest.raises(LoaderError, match="wrong address"):
            await bridge(loader._do)("write", WRITE, struct.pack("<I", address) + b"\x00")
    with pytest.raises(LoaderError, match="wrong address"):
        await bridge(loader._do)("write", WRITE, struct.pack("<I", FLASH_IMAGE + 255) + b"\x00\x00")
    with pytest.raises(LoaderError, match="unknown command"):
        await bridge(loader._do)("command 9", 9, b"")
    with pytest.raises(LoaderError, match="the flash did not erase or write"):  # not erased
        await bridge(loader._do)("write", WRITE, struct.pack("<I", FLASH_IMAGE + 0x300) + b"\xff")
    assert tb.contents(0, 4096) == b"\xff" * 4096
    assert await bridge(loader.check)() == "no image"
    assert await bridge(loader.start)() == "no image"
    await bridge(loader.upload)(plan(image, block))
    assert tb.contents(FLASH_IMAGE, len(image)) == image and tb.contents(FLASH_BLOCK, len(block)) == block
    assert await bridge(loader.check)() == "good"
    assert await bridge(loader.start)() == "good"
    assert await tb.line() == RUNNING
    await tb.reset()
    assert await tb.line() == RUNNING
    await tb.reset()
    await tb.send(frame(HELLO))  # a host in time keeps the firmware from starting
    assert len(await tb.take(16, 0.005)) == 16
    assert await tb.line(limit_s=0.003) == ""


@cocotb.test()
async def power_cut_never_starts_a_half(dut: Any) -> None:
    """Power goes while the flash erases or writes, at any step of an upload over another image: refused by name."""
    dut._log.info("seed %d", cocotb.RANDOM_SEED)
    rng = random.Random(cocotb.RANDOM_SEED)
    tb = BootBench(dut)
    await tb.start()
    code = build_program()
    old, block = pack_image(code, PHASES), make_block()
    image = pack_image(code[:-4] + b"new!", PHASES)
    steps = plan(image, block)
    operations = len(steps.erase) + len(steps.write)
    for cut in sorted({0, 1, operations - 1, rng.randrange(2, operations - 1)}):
        tb.fill(FLASH_IMAGE, old)
        tb.fill(FLASH_BLOCK, block)
        await tb.reset()
        loader = Loader(SerialLine(Line(tb)))
        await bridge(loader.find)(20)
        plug = cocotb.start_soon(tb.cut_power(cut + 1))
        with pytest.raises(LoaderError, match="stopped answering") as error:
            await bridge(loader.upload)(steps)
        assert plug.done(), f"cut at operation {cut}: {error.value}"
        await tb.reset()
        said = await tb.line()
        assert said.startswith("boot: not started: "), f"cut at operation {cut}: {said!r}"
    # The chip can still be served.
    await bridge(loader.find)(20)
    await bridge(loader.upload)(steps)
    assert await bridge(loader.start)() == "good"
    assert await tb.line() == RUNNING


def test_boot() -> None:
    """The loader starts what is right, refuses everything else by name, and is served by the host's code.

    Verifies: BOOT-02, BOOT-03, BOOT-04, BOOT-05
    """
    run_block_test(
        "fl_boot_chain",
        [*SOURCES, *(ROOT / "cocotb_tests" / "soc" / name for name in ("fl_spi_flash_model.sv", "fl_boot_chain.sv"))],
        __name__,
        parameters={"BootInit": f'"{build_loader(LISTEN_MS)}"'},
        registers=REGISTER_BLOCKS,
        seen=["fl_spi_flash_model"],
    )
