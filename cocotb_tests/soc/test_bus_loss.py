# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The node on the chip while its bus fails: cable out, bus-off, a second node with its ID, a master that restarts."""

from __future__ import annotations

import struct
from types import SimpleNamespace
from typing import Any

import cocotb
from cocotb.triggers import Timer

from cocotb_tests.soc.boot_bench import BootBench
from cocotb_tests.soc.test_boot_store import KBIT_PER_S, NODE, Master, run_boot_soc
from fluxlock.can.frame import Frame
from fluxlock.flash.image import pack_can_setup
from fluxlock.generate.memory import FLASH_CAN_SETUP

HEARTBEAT_MS = 5
EMERGENCY, ALIVE = 0x80 + NODE, 0x700 + NODE


class Plug:
    """The chip's receive pin, on the bus or not."""

    def __init__(self, dut: Any) -> None:
        self.dut, self.whole, self.level = dut, True, 1

    @property
    def value(self) -> int:
        """What the bus would give."""
        return self.level

    @value.setter
    def value(self, level: int) -> None:
        self.level = level
        if self.whole:
            self.dut.can_rx_i.value = level

    def pull(self, loops: bool) -> None:
        """Off the bus. loops: the transceiver shows the chip its own bits; else it is dead, recessive."""
        self.whole, self.dut.can_rx_i.value = False, 1
        if loops:
            cocotb.start_soon(self._loop())

    def push(self) -> None:
        """On the bus again."""
        self.whole, self.dut.can_rx_i.value = True, self.level

    async def _loop(self) -> None:
        while not self.whole:
            await self.dut.can_tx_o.value_change
            if not self.whole:
                self.dut.can_rx_i.value = int(self.dut.can_tx_o.value)


async def told(master: Master, limit_ms: float = 20) -> tuple[int, int] | None:
    """Code, and code that has ended, of the next emergency."""
    data = await master.frame(EMERGENCY, limit_ms)
    return None if data is None else (data[0] | data[1] << 8, data[4] | data[5] << 8)


@cocotb.test()
async def node_lives_on(dut: Any) -> None:
    tb, master, plug = BootBench(dut), Master(dut), Plug(dut)
    master.wire.dut = SimpleNamespace(rx_i=plug, tx_o=dut.can_tx_o)
    dut.can_rx_i.value = 1
    await tb.start()
    master.wire.join()
    tb.fill(FLASH_CAN_SETUP, pack_can_setup(NODE, KBIT_PER_S))
    await tb.reset()
    assert await master.frame(ALIVE) == b"\0"
    await master.write("heartbeat_producer", HEARTBEAT_MS)
    # The bench has no converters: that is a fault of the drive.
    assert await told(master, 50) is not None
    alone = await master.read("error_register")
    assert not alone & 0x10

    # The cable is out: nobody acknowledges, which alone is no bus-off.
    plug.pull(loops=True)
    await Timer(6 * HEARTBEAT_MS, "ms")
    plug.push()
    await Timer(1, "ms")
    master.mac.received.clear()
    assert await master.frame(ALIVE, 3 * HEARTBEAT_MS) == b"\x7f"
    assert await told(master, 2) is None
    assert await master.read("error_register") == alone

    # A dead transceiver: the chip does not see its own bits, its counter runs to bus-off.
    plug.pull(loops=False)
    await Timer(2 * HEARTBEAT_MS, "ms")
    plug.push()
    codes = []
    while (code := await told(master)) is not None:
        codes.append(code)
    # It has come back to try again, and has gone again.
    assert codes[0] == (0x8140, 0) and codes[-1] == (0, 0x8140) and set(codes) == {codes[0], codes[-1]}
    assert await master.frame(ALIVE, 3 * HEARTBEAT_MS) == b"\x7f"
    assert await master.read("error_register") == alone

    # Another node with this node-ID.
    master.mac.queue.append(Frame(ALIVE, dlc=1, data=b"\x05"))
    assert await told(master) == (0x8150, NODE)
    assert await master.read("error_register") == alone | 0x11

    # A master that restarts before, in and after a segment.
    for segments in (0, 1, 3):
        assert (await master.request(struct.pack("<BHBI", 0x21, 0x2000, 3, 32)))[0] == 0x60
        for k in range(segments):
            assert (await master.request(bytes([(k & 1) << 4, *b"segment"])))[0] == 0x20 | (k & 1) << 4
        assert (await master.write("velocity_window", 70 + segments))[0] == 0x60
        assert await master.read("velocity_window") == 70 + segments
        left = await master.request(bytes([(segments & 1) << 4, *b"segment"]))
        assert left[0] == 0x80 and int.from_bytes(left[4:], "little") == 0x05040001
        length = await master.request(struct.pack("<BHB4x", 0x40, 0x2000, 3))
        assert int.from_bytes(length[4:], "little") == 0, "no part of the label was taken"
    assert int(dut.gate_o.value) == 0


def test_bus_loss() -> None:
    """No cable, bus-off, a second node with its ID, a restarting master: the node goes on, each is told that can be.

    Verifies: CO-20, CO-06, CO-04
    """
    run_boot_soc(__name__)
