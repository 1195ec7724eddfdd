# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Stored objects in the flash of a chip with Boot: the firmware with its CANopen node, a master on the bus, power-offs.

The RAM is filled from outside, and the ROM only jumps into it: the loader's copy takes longer than all the rest.
"""

from __future__ import annotations

import random
import struct
from collections.abc import Awaitable, Callable
from types import SimpleNamespace
from typing import Any

import cocotb
from cocotb.triggers import FallingEdge, Timer

from cocotb_tests.can.link import Wire
from cocotb_tests.soc.boot_bench import BootBench
from fluxlock.base.paths import BUILD, REGISTER_BLOCKS, ROOT, RTL
from fluxlock.can.frame import Frame
from fluxlock.can.timing import chip_timing
from fluxlock.canopen.dictionary import load_dictionary
from fluxlock.clock import CLOCK_HZ
from fluxlock.config import load_scenario
from fluxlock.cosim.block import run_block_test
from fluxlock.cosim.chip import rtl_sources
from fluxlock.cosim.parameters import parameter_block
from fluxlock.firmware import write_image
from fluxlock.firmware.toolchain import build_firmware
from fluxlock.flash.image import pack_can_setup
from fluxlock.generate.memory import BOOT_BYTES, FLASH_CAN_SETUP, FLASH_SECTOR_BYTES, FLASH_STORE

NODE, KBIT_PER_S = 5, 1000
FOLDER = BUILD / "block" / "boot_store"
JUMP = 0x08000067  # jalr x0, 0x80(x0)
BOOT_UP_MS = 20
SAVE = 0x65766173
SILENT = 4  # what an emergency says of a sector that does not answer


class Master:
    """Another node on the chip's bus, with the requests of an SDO client."""

    def __init__(self, dut: Any) -> None:
        pins = SimpleNamespace(rx_i=dut.can_rx_i, tx_o=dut.can_tx_o)
        self.wire = Wire(pins, chip_timing(CLOCK_HZ, KBIT_PER_S), 1)
        self.mac = self.wire.node().mac
        self.dictionary = load_dictionary()

    async def frame(self, identifier: int, limit_ms: float = BOOT_UP_MS) -> bytes | None:
        """Data of the next frame with an identifier; None: it does not come in time."""
        for _ in range(round(10 * limit_ms)):
            for frame in self.mac.received:
                if frame.id == identifier:
                    self.mac.received.remove(frame)
                    return frame.data
            await Timer(100, "us")
        return None

    async def request(self, data: bytes) -> bytes:
        self.mac.queue.append(Frame(0x600 + NODE, dlc=8, data=data))
        answer = await self.frame(0x580 + NODE)
        assert answer is not None
        return answer

    async def write(self, name: str, value: int) -> bytes:
        """The answer to an expedited download."""
        entry = self.dictionary[name]
        command = 0x23 | 4 - entry.bytes << 2
        return await self.request(struct.pack("<BHBI", command, entry.index, entry.sub, value))

    async def read(self, name: str) -> int:
        entry = self.dictionary[name]
        answer = await self.request(struct.pack("<BHB4x", 0x40, entry.index, entry.sub))
        return int.from_bytes(answer[4 : 4 + entry.bytes], "little")


async def power_up(tb: BootBench, master: Master) -> None:
    """Power was off; the node has told its boot-up."""
    tb.dut.flash_power_i.value = 0
    await tb.reset()
    master.mac.received.clear()
    assert await master.frame(0x700 + NODE) == b"\0"


async def save(master: Master, name: str, value: int) -> None:
    """Write an object and store all."""
    assert (await master.write(name, value))[0] == 0x60
    assert (await master.write("store_parameters_save_all", SAVE))[0] == 0x60


SEED = 1
LOST, COPY = 0x6310, 0x5530  # emergencies
STORED, BEFORE, LEAST = 300, 500, 1  # permille of the current limit


def damages(newest: bytes, older: bytes) -> dict[str, tuple[bytes, bytes, int, int]]:
    """What the two sectors hold, the emergency, 0: none, and the current limit, 0: as without a store.

    newest, older: images of one and the same device; the older one has the higher limit.
    """
    rng = random.Random(SEED)
    used = len(newest.rstrip(b"\xff"))

    def bit(image: bytes) -> bytes:
        at = rng.randrange(4, used)  # behind the magic, without which an image can be read
        return image[:at] + bytes([image[at] ^ 1 << rng.randrange(8)]) + image[at + 1 :]

    def layout(image: bytes) -> bytes:
        return image[:4] + bytes([image[4] ^ 0xFF]) + image[5:]

    def magic(image: bytes) -> bytes:
        return bytes([image[0] ^ 1]) + image[1:]

    blank = b"\xff" * len(newest)
    return {
        "whole": (newest, newest, 0, STORED),
        **{f"one bit of the first copy, {n}": (bit(newest), newest, COPY, STORED) for n in range(3)},
        **{f"one bit of the second copy, {n}": (newest, bit(newest), COPY, STORED) for n in range(3)},
        **{f"one bit of each copy, {n}": (bit(newest), bit(newest), LOST, LEAST) for n in range(3)},
        "first copy blank": (blank, newest, COPY, STORED),
        "second copy blank": (newest, blank, COPY, STORED),
        "blank": (blank, blank, 0, 0),
        "older layout": (layout(newest), layout(newest), LOST, LEAST),
        "older layout beside a copy": (layout(newest), newest, COPY, STORED),
        "older copy first": (older, newest, COPY, STORED),
        "older copy second": (newest, older, COPY, STORED),
        **{f"older copy beside a bit of the newest, {n}": (older, bit(newest), LOST, LEAST) for n in range(4)},
        "older copy beside another layout of the newest": (older, layout(newest), LOST, LEAST),
        "older copy beside a newest whose magic is damaged": (older, magic(newest), COPY, STORED),
        "blank beside a bit": (blank, bit(newest), LOST, LEAST),
    }


@cocotb.test()
async def objects_survive(dut: Any) -> None:
    tb, master = BootBench(dut), Master(dut)
    dut.can_rx_i.value = 1
    await tb.start()
    master.wire.join()
    assert await master.frame(0x700 + NODE, 10) is None, "a node without its ID sends"
    tb.fill(FLASH_CAN_SETUP, pack_can_setup(NODE, KBIT_PER_S))

    async def window_after_power_up() -> int:
        await power_up(tb, master)
        return await master.read("velocity_window")

    default = await window_after_power_up()
    assert default not in (77, 78)
    for window in (76, 77):
        await save(master, "velocity_window", window)
    assert await window_after_power_up() == 77
    for operation in (1, 2, 3):  # power goes when the magic is taken away, in the erase, in a page
        await master.write("velocity_window", 78)
        before = tb.contents(FLASH_STORE, 8192)
        plug = cocotb.start_soon(tb.cut_power(operation))
        entry = master.dictionary["store_parameters_save_all"]
        command = struct.pack("<BHBI", 0x23, entry.index, entry.sub, SAVE)
        master.mac.queue.append(Frame(0x600 + NODE, dlc=8, data=command))
        await plug
        await Timer(1, "us")
        assert tb.contents(FLASH_STORE, 8192) != before
        master.mac.queue.clear()
        assert await window_after_power_up() == 77, f"cut in operation {operation}"
    await save(master, "velocity_window", 79)
    assert await window_after_power_up() == 79
    assert int(dut.gate_o.value) == 0
    await dead_flash(dut, tb, master, window_after_power_up)


async def told_lost(master: Master) -> None:
    """The node says that neither sector answers, and holds the limits at their least values."""
    # The bench has no converters: that is a fault of the drive, told before or after it.
    told = await master.frame(0x80 + NODE)
    while told is not None and told[:2] != LOST.to_bytes(2, "little"):
        told = await master.frame(0x80 + NODE)
    assert told is not None
    assert told[4:6] == bytes([SILENT, SILENT])
    assert await master.read("error_register") & 0x80
    listed = [(await master.read(f"error_field_error_{k}")) & 0xFFFF for k in (1, 2)]
    assert LOST in listed
    assert await master.read("max_current") == 1
    assert (await master.write("store_parameters_save_all", SAVE))[:1] == b"\x80", (
        "what is not stored is not acknowledged"
    )
    assert await master.read("velocity_window") not in (77, 79)


async def dead_flash(dut: Any, tb: BootBench, master: Master, window: Callable[[], Awaitable[int]]) -> None:
    """A flash that ceases to answer, is dead at power-up, and comes back."""
    await master.write("max_current", 300)
    assert (await master.write("store_parameters_save_all", SAVE))[0] == 0x60
    dut.flash_power_i.value = 0
    master.mac.received.clear()
    master.mac.queue.append(Frame(0, dlc=2, data=bytes([129, NODE])))
    assert await master.frame(0x700 + NODE) == b"\0"
    await told_lost(master)
    dut.rst_i.value = 1
    await Timer(10, "us")
    await FallingEdge(dut.clk_i)
    master.mac.received.clear()
    dut.rst_i.value = 0
    assert await master.frame(0x700 + NODE) == b"\0", "the node-ID is the one of the start before"
    await told_lost(master)
    assert await window() == 79
    assert await master.read("max_current") == 300
    assert int(dut.gate_o.value) == 0


@cocotb.test()
async def damaged_stores_are_told(dut: Any) -> None:
    """Each damage has its emergency, and the current limit is never above what was stored; blank is no damage."""
    tb, master = BootBench(dut), Master(dut)
    dut.can_rx_i.value = 1
    await tb.start()
    master.wire.join()
    tb.fill(FLASH_CAN_SETUP, pack_can_setup(NODE, KBIT_PER_S))
    tb.fill(FLASH_STORE, b"\xff" * 2 * FLASH_SECTOR_BYTES)
    await power_up(tb, master)
    default = await master.read("max_current")
    assert default > BEFORE
    images = []
    for limit in (BEFORE, STORED):
        await save(master, "max_current", limit)
        both = tb.contents(FLASH_STORE, 2 * FLASH_SECTOR_BYTES)
        assert both[:FLASH_SECTOR_BYTES] == both[FLASH_SECTOR_BYTES:]
        images.append(both[:FLASH_SECTOR_BYTES].rstrip(b"\xff"))
    length = max(map(len, images))
    older, newest = (image.ljust(length, b"\xff") for image in images)
    print(f"seed {SEED}, {length} bytes")
    for name, (first, second, emergency, limit) in damages(newest, older).items():
        tb.fill(FLASH_STORE, first)
        tb.fill(FLASH_STORE + FLASH_SECTOR_BYTES, second)
        await power_up(tb, master)
        found = await master.read("max_current")
        told = [int.from_bytes(f.data[:2], "little") for f in master.mac.received if f.id == 0x80 + NODE]
        assert (told, found) == ([emergency] if emergency else [], limit or default), name
        assert int(dut.gate_o.value) == 0
    for sector in range(2):
        tb.fill(FLASH_STORE + sector * FLASH_SECTOR_BYTES, newest)
    record = pack_can_setup(NODE, KBIT_PER_S)
    for at in (0, 4, len(record) - 1):  # node-ID, bit rate, check
        tb.fill(FLASH_CAN_SETUP, record[:at] + bytes([record[at] ^ 1]) + record[at + 1 :])
        await power_up(tb, master)  # by the node-ID of the store
        assert await master.read("max_current") == STORED
        told = [f.data for f in master.mac.received if f.id == 0x80 + NODE]
        assert [(int.from_bytes(data[:2], "little"), data[6:8]) for data in told] == [(COPY, b"\x00\x20")], at
        assert int(dut.gate_o.value) == 0


def run_boot_soc(module: str) -> None:
    """Run a module's cocotb tests on the chip with the six-step image and its node."""
    scenario = load_scenario(ROOT / "scenarios" / "demo.toml")
    image = write_image(FOLDER / "firmware.hex", build_firmware(can_method="six-step"), parameter_block(scenario))
    jump = FOLDER / "jump.hex"
    jump.write_text("".join(f"{word:08x}\n" for word in (JUMP, *[0] * (BOOT_BYTES // 4 - 1))))
    sources = [path for path in rtl_sources() if path.is_relative_to(RTL) or "VexRiscv" in path.name]
    bench = [ROOT / "cocotb_tests" / "soc" / name for name in ("fl_spi_flash_model.sv", "fl_boot_soc.sv")]
    run_block_test(
        "fl_boot_soc",
        [*(path for path in sources if path.parent.name != "pkg"), *bench],
        module,
        parameters={"Init": f'"{image}"', "BootInit": f'"{jump}"', "Can": 1},
        registers=REGISTER_BLOCKS,
        seen=["fl_spi_flash_model"],
    )


def test_boot_store() -> None:
    """What a master stores holds over a power-off, also if power goes while it is stored; without a node-ID silence.

    A store that is damaged is told, by one emergency, and gives no higher limit. A flash that does not answer is told
    too, at a reset and at power-up.

    Verifies: CO-28, CAMP-09
    """
    run_boot_soc(__name__)
