# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The loader over CAN: chip with its controller, flash and UART, the host's own code on a bus with other traffic.

The bus is the model of `cocotb_tests.can.link`, at the chip's pins.
"""

from __future__ import annotations

import random
import struct
from types import SimpleNamespace
from typing import Any

import cocotb
import pytest
from cocotb.task import bridge, resume
from cocotb.triggers import FallingEdge, Timer
from cocotb.utils import get_sim_time

from cocotb_tests.can.bench import BSP_SOURCES
from cocotb_tests.can.link import Wire
from cocotb_tests.soc.boot_bench import BootBench, build_program, make_block
from cocotb_tests.soc.test_boot import LISTEN_MS, PHASES, RUNNING, SOURCES, with_word
from fluxlock.base.paths import REGISTER_BLOCKS, ROOT
from fluxlock.can.frame import Frame
from fluxlock.can.timing import chip_timing
from fluxlock.clock import CLOCK_HZ
from fluxlock.cosim.block import run_block_test
from fluxlock.firmware.toolchain import build_loader
from fluxlock.flash.can_line import ID_TO_HOST, ID_TO_LOADER, CanLine, segments
from fluxlock.flash.image import pack_can_setup, pack_image, plan
from fluxlock.flash.loader import HELLO, START, WRITE, Loader, LoaderError, frame
from fluxlock.generate.memory import FLASH_BLOCK, FLASH_CAN_SETUP, FLASH_END, FLASH_IMAGE

NODE, KBIT_PER_S = 5, 1000
IDENTITY = 0xEF4016
WAIT_S = 60.0  # of the machine: the simulated chip answers sooner or not at all
# The host's second, as the chip listens for less than on a board; an answer comes far sooner than from a real flash.
HOST_MS, ANSWER_MS = 8, 4
COMMAND_MS = 20  # until its last frame is gone


def program() -> bytes:
    """Most of the filler behind the program is of no use here."""
    return build_program()[:-480]


class Bus:
    """Another node on the chip's bus, as the host's code uses one from a thread beside the simulation."""

    def __init__(self, dut: Any, kbit_per_s: int = KBIT_PER_S) -> None:
        pins = SimpleNamespace(rx_i=dut.can_rx_i, tx_o=dut.can_tx_o)
        self.wire = Wire(pins, chip_timing(CLOCK_HZ, kbit_per_s), 1)
        self.mac = self.wire.node().mac
        self.send, self.receive = resume(self._send), resume(self._receive)
        self.command_ms = COMMAND_MS
        self.lose: int | None = None  # frames that go before one that is lost, either way

    async def _send(self, identifier: int, data: bytes) -> bool:
        if not self._loses():
            self.mac.queue.append(Frame(identifier, ext=True, dlc=len(data), data=data))
        return True

    async def _receive(self, identifier: int, timeout_s: float) -> bytes | None:
        waited_ms = total_ms = 0.0
        while waited_ms < min(timeout_s * HOST_MS, ANSWER_MS) and total_ms < self.command_ms:
            while self.mac.received:
                frame = self.mac.received.pop(0)
                if frame.ext and frame.id == identifier and not self._loses():
                    return frame.data
            await Timer(20, "us")
            waited_ms += 0.0 if self.mac.queue else 0.02  # from the last frame of the command on
            total_ms += 0.02
        return None

    def _loses(self) -> bool:
        before = self.lose
        self.lose = before - 1 if before else None
        return before == 0

    def trouble(self) -> str:
        return ""

    def loader(self, node: int = NODE) -> Loader:
        return Loader(CanLine(self, node))


class Lossy(CanLine):
    """One frame of a command or of its answer is lost now and then; the next attempt passes."""

    def __init__(self, bus: Bus, rng: random.Random) -> None:
        super().__init__(bus, NODE)
        self.bus, self.rng, self.lost = bus, rng, 0
        self._again = False

    def send(self, code: int, payload: bytes) -> None:
        count = len(segments(code, payload, 0)) + 1  # of the answer the first
        self._again = not self._again and self.rng.random() < 0.25
        self.bus.lose = self.rng.randrange(count) if self._again else None
        self.lost += self._again
        super().send(code, payload)


async def chatter(bus: Bus, rng: random.Random) -> None:
    """Frames of others without end: standard ones, and extended ones beside those of the loader."""
    mac = bus.wire.node().mac
    while True:
        near = Frame(rng.choice([ID_TO_LOADER, ID_TO_HOST]) + rng.choice([0, 4, 6]), ext=True, dlc=8, data=bytes(8))
        data = rng.randbytes(rng.randrange(9))
        mac.queue.append(rng.choice([near, Frame(rng.randrange(0x700), dlc=len(data), data=data)]))
        await Timer(rng.randrange(100, 1500), "us")


async def begin(dut: Any, setup: bytes, kbit_per_s: int = KBIT_PER_S) -> tuple[BootBench, Bus]:
    """Power on with an empty flash but for node-ID and bit rate."""
    tb, bus = BootBench(dut), Bus(dut, kbit_per_s)
    dut.can_rx_i.value = 1
    tb.fill(FLASH_IMAGE, b"\xff" * 4096)
    tb.fill(FLASH_BLOCK, b"\xff" * 4096)
    tb.fill(FLASH_CAN_SETUP, setup)
    await tb.start()
    bus.wire.join()
    return tb, bus


@cocotb.test()
async def host_writes_and_starts(dut: Any) -> None:
    """The host's code fills the flash over CAN, beside other traffic, with frames lost, then by turns with the UART."""
    dut._log.info("seed %d", cocotb.RANDOM_SEED)
    rng = random.Random(cocotb.RANDOM_SEED)
    setup = pack_can_setup(NODE, KBIT_PER_S)
    tb, bus = await begin(dut, setup)
    image, block = pack_image(program(), PHASES), make_block(words=40)
    others = cocotb.start_soon(chatter(bus, rng))
    loader = bus.loader()
    assert await bridge(loader.find)(WAIT_S) == (1, IDENTITY)
    for address in (0, FLASH_IMAGE - 256, FLASH_END):
        with pytest.raises(LoaderError, match="wrong address"):
            await bridge(loader._do)("write", WRITE, struct.pack("<I", address) + b"\x00")
    with pytest.raises(LoaderError, match="unknown command"):
        await bridge(loader._do)("command 9", 9, b"")
    assert tb.contents(0, 4096) == b"\xff" * 4096
    assert await bridge(loader.start)() == "no image"

    lossy = Lossy(bus, rng)
    await bridge(Loader(lossy).upload)(plan(image, block, setup))
    dut._log.info("%d frames lost", lossy.lost)
    bus.lose = None
    assert tb.contents(FLASH_IMAGE, len(image)) == image and tb.contents(FLASH_BLOCK, len(block)) == block
    assert tb.contents(FLASH_CAN_SETUP, len(setup)) == setup
    assert await bridge(loader.check)() == "good"
    # The UART is served too, also between the segments of a command.
    await bridge(loader.line.send)(WRITE, struct.pack("<I", 0) + bytes(256))
    await tb.take(1000, 0.001)  # what the loader has said before
    await tb.send(frame(HELLO))
    assert (await tb.take(16, 0.005))[1:] == frame(0, struct.pack("<2I", 1, IDENTITY))[1:16]
    assert (await bridge(loader.line.receive)(1.0)) == (2, b"")
    assert await bridge(loader.start)() == "good"
    assert await tb.line() == RUNNING
    # It has left the bus: others' frames are no longer acknowledged by it.
    edges = bus.wire.edges[0]
    await Timer(3, "ms")
    assert bus.wire.edges[0] == edges and int(dut.can_tx_o.value) == 1
    await tb.reset()
    assert await tb.line() == RUNNING
    others.cancel()
    await tb.reset()
    assert await bridge(loader.find)(WAIT_S) == (1, IDENTITY)  # a host in time keeps the firmware from starting
    assert await tb.line(limit_s=0.003) == ""


@cocotb.test()
async def nothing_broken_is_started(dut: Any) -> None:
    """Broken images and parameter blocks are refused by name over CAN, and nothing runs."""
    dut._log.info("seed %d", cocotb.RANDOM_SEED)
    rng = random.Random(cocotb.RANDOM_SEED)
    tb, bus = await begin(dut, pack_can_setup(NODE, KBIT_PER_S))
    good, block = pack_image(program(), PHASES), make_block(words=40)
    at, in_block, bit = rng.randrange(256, len(good)), rng.randrange(16, len(block)), 1 << rng.randrange(8)
    cases = [
        ("image header CRC", with_word(good, rng.randrange(1, 7), rng.randrange(1 << 20), seal=False), block),
        ("image is for another chip", with_word(good, 3, 5), block),
        ("image CRC", good[:at] + bytes([good[at] ^ bit]) + good[at + 1 :], block),
        ("image CRC", good[: len(good) // 2].ljust(len(good), b"\xff"), block),
        ("no parameter block", good, b"\xff" * len(block)),
        ("parameter block CRC", good, block[:in_block] + bytes([block[in_block] ^ bit]) + block[in_block + 1 :]),
    ]
    loader = bus.loader()
    assert await bridge(loader.find)(WAIT_S) == (1, IDENTITY)
    for reason, image, parameters in cases:
        tb.fill(FLASH_IMAGE, image)
        tb.fill(FLASH_BLOCK, parameters)
        assert await bridge(loader.start)() == reason
        assert await tb.line(limit_s=0.0005) == "", f"{reason}: something runs"
    tb.fill(FLASH_IMAGE, good)
    tb.fill(FLASH_BLOCK, block)
    # A start of which a segment has a wrong CRC, or that is for another board, is none.
    right = bytes([START, 0, 0])
    for target, data in ((NODE, right + bytes(4)), (NODE + 1, frame(START)[1:]), (0, frame(START)[1:])):
        bus.mac.queue.append(Frame(ID_TO_LOADER + target, ext=True, dlc=8, data=b"\x40" + data))
        assert await tb.line(limit_s=0.0015) == "", f"started by {target}: {data.hex()}"
    assert await bridge(loader.start)() == "good"
    assert await tb.line() == RUNNING


@cocotb.test()
async def bus_off_ends(dut: Any) -> None:
    """Answers are destroyed until the chip is error passive, then bus-off: it comes back by itself and is served."""
    _, bus = await begin(dut, pack_can_setup(NODE, KBIT_PER_S))
    loader, controller = bus.loader(), dut.g_can.u_can.u_can
    assert await bridge(loader.find)(WAIT_S) == (1, IDENTITY)
    passive = False
    await bridge(loader.line.send)(HELLO, b"")
    while bus.mac.queue:
        await Timer(10, "us")
    attempts = 0
    while not int(controller.bus_off_o.value):
        await FallingEdge(dut.can_tx_o)
        now = get_sim_time("ns")
        bus.wire.bus.force(now + 70 * bus.wire.bit_ns, now + 78 * bus.wire.bit_ns, 0)  # among the data
        await bus.wire.bits(95)
        passive |= bool(int(controller.passive_o.value))
        attempts += 1
        assert attempts < 50
    assert passive
    assert await bridge(loader.find)(WAIT_S) == (1, IDENTITY)
    assert await bridge(loader.check)() == "no image"


@cocotb.test()
async def default_and_wrong_bit_rate(dut: Any) -> None:
    """A host at 500 kbit/s is not heard by a board at another rate; without a setup it is, as node 0."""
    tb, bus = await begin(dut, pack_can_setup(NODE, KBIT_PER_S), 500)
    assert await tb.line() == "boot: not started: no image"
    bus.command_ms = 3  # no command leaves the queue
    with pytest.raises(LoaderError, match="no loader answers"):
        await bridge(bus.loader().find)(0.01)
    bus.mac.queue.clear()
    tb.fill(FLASH_CAN_SETUP, pack_can_setup(NODE, KBIT_PER_S)[:8] + bytes(4))
    await tb.reset()
    assert await bridge(bus.loader(0).find)(WAIT_S) == (1, IDENTITY)
    assert await bridge(bus.loader(0).check)() == "no image"


def test_boot_can() -> None:
    """Over CAN the loader takes and starts what is right, starts nothing else, and survives trouble on the bus.

    Verifies: BOOT-02, BOOT-03, BOOT-07, BOOT-08
    """
    can = [*BSP_SOURCES, *(f"can/fl_can{name}.sv" for name in ("_bit_timing", "_tx", "_rx", "")), "soc/fl_can_wb.sv"]
    bench = [ROOT / "cocotb_tests" / "soc" / name for name in ("fl_spi_flash_model.sv", "fl_boot_chain.sv")]
    run_block_test(
        "fl_boot_chain",
        [*SOURCES, *can, *bench],
        __name__,
        parameters={"BootInit": f'"{build_loader(LISTEN_MS)}"', "Can": 1},
        registers=REGISTER_BLOCKS,
        seen=["fl_spi_flash_model", "fl_can"],
    )
