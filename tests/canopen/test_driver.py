# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The driver of the CAN controller on a register file of the host, and what the node asks of its filters."""

from __future__ import annotations

import random
from collections.abc import Iterator

import numpy as np
import pytest

from fluxlock.can.timing import chip_timing
from fluxlock.clock import CLOCK_HZ
from fluxlock.config.can import BIT_RATES
from fluxlock.firmware.binding import new
from tests.canopen.node_bench import NODE, NodeBench

EXT, RTR, ENABLE = 1 << 31, 1 << 30, 1 << 29


class Driver:
    """`hal/can.h` on the registers of the host library."""

    def __init__(self, bench: NodeBench) -> None:
        self.firmware = bench.bench.fw
        self.lib = self.firmware.lib
        self.registers: np.ndarray[tuple[int], np.dtype[np.uint32]] = self.firmware.registers

    def get(self, name: str, element: int = 0) -> int:
        return int(self.registers[self.firmware.index(f"can.{name}", element)])

    def put(self, name: str, value: int, element: int = 0) -> None:
        self.registers[self.firmware.index(f"can.{name}", element)] = value


@pytest.fixture
def driver(bench: NodeBench) -> Iterator[Driver]:
    found = Driver(bench)
    yield found
    found.registers[:] = 0


def test_bit_timing(driver: Driver) -> None:
    """Bit rates with whole bits get the timing that the tools of the host use; others none.

    Verifies: CO-20
    """
    for rate in BIT_RATES:
        timing = chip_timing(CLOCK_HZ, rate)
        fields = ((timing.brp, 0), (timing.prop + timing.ps1, 8), (timing.ps2, 16), (timing.sjw, 24))
        word = sum(value - 1 << place for value, place in fields)
        assert driver.lib.can_bit_timing(round(CLOCK_HZ), rate) == word, rate
        assert timing.bit_cycles * rate * 1000 == CLOCK_HZ
    for rate in (0, 3, 800, 999):
        assert driver.lib.can_bit_timing(round(CLOCK_HZ), rate) == 0, rate
    driver.lib.can_join(0x1234)
    assert (driver.get("bit_timing"), driver.get("control")) == (0x1234, 1 | 8)


def test_frames_in_and_out(driver: Driver) -> None:
    """What is in the registers of the FIFO comes out as a frame; what is sent goes behind every waiting buffer.

    Verifies: CO-20
    """
    seed = random.randrange(1 << 32)
    print(f"seed {seed}")
    rng = random.Random(seed)
    frame, lost = new("can_frame_t"), new("bool")
    assert not driver.lib.can_take(frame, lost)
    for _ in range(200):
        ext, rtr, mark = rng.getrandbits(1), rng.getrandbits(1), rng.getrandbits(1)
        identifier, dlc = rng.getrandbits(29 if ext else 11), rng.randrange(16)
        data = rng.randbytes(8)
        driver.put("rx_id", ext << 31 | rtr << 30 | identifier)
        driver.put("rx_info", 1 << 31 | mark << 16 | rng.randrange(8) << 8 | dlc)
        for i in range(2):
            driver.put("rx_data", int.from_bytes(data[4 * i : 4 * i + 4], "little"), i)
        driver.put("rx_command", 0)
        assert driver.lib.can_take(frame, lost)
        assert (frame.id, frame.flags, frame.length) == (identifier, ext | rtr << 1, min(dlc, 8))
        assert (bytes(frame.data), lost[0], driver.get("rx_command")) == (data, bool(mark), 1)
        # The lowest waiting buffer goes first: only one behind all keeps the order.
        pending = rng.randrange(8)
        free = [n for n in range(3) if pending >> n == 0]
        out = new("can_frame_t", rng.getrandbits(11), 0, rng.randrange(9), data)
        driver.put("status", pending)
        driver.put("tx_command", 0)
        assert driver.lib.can_send(out) == bool(free)
        assert driver.get("tx_command") == (1 << free[0] | out.length << 8 if free else 0)
        if free:
            assert driver.get("tx_id") == out.id
            assert [driver.get("tx_data", i) for i in range(2)] == list(np.frombuffer(data, "<u4"))


def test_filter_registers(driver: Driver) -> None:
    """A filter keeps standard data frames only; one that is off keeps none.

    Verifies: CO-20
    """
    for k in range(8):
        driver.lib.can_set_filter(k, new("can_filter_t", 0x180 + k, 0x7F0 | k, k != 3))
    for k in range(8):
        assert driver.get("filter_id", k) == 0x180 + k
        assert driver.get("filter_mask", k) == EXT | RTR | (0 if k == 3 else ENABLE) | 0x7F0 | k
    for bus_off in (0, 1):
        driver.put("status", bus_off << 7)
        assert driver.lib.can_is_bus_off() == bool(bus_off)


def test_wanted_frames(bench: NodeBench) -> None:
    """The filters let through what concerns the node and nothing else, also after a master has changed identifiers.

    Verifies: CO-20
    """

    def let_through() -> set[int]:
        return {i for i in range(1 << 11) for can_id, mask in bench.node.wanted() if (i ^ can_id) & mask == 0}

    rpdos = {0x200 + 0x100 * k + NODE for k in range(4)}
    always = {0, 0x600 + NODE, 0x700 + NODE}
    assert let_through() == always | {0x80} | rpdos
    bench.write("sync_cob_id", 0x90)
    bench.write("rpdo2_cob_id", 1 << 31 | 0x300 + NODE)
    bench.write("rpdo3_cob_id", 1 << 31)
    bench.write("rpdo3_cob_id", 0x222)
    rpdos = {0x200 + NODE, 0x222, 0x500 + NODE}
    assert let_through() == always | {0x90} | rpdos
    bench.write("heartbeat_consumer_node_2", 0x20 << 16 | 100)
    assert let_through() == always | {0x90} | rpdos | set(range(0x700, 0x780))
    bench.send(0, bytes([129, NODE]))
    assert let_through() == always | {0x80} | {0x200 + 0x100 * k + NODE for k in range(4)}


def test_bus_is_told(bench: NodeBench) -> None:
    """Bus-off, its end and lost frames are told by EMCY; lost frames end when none was lost for 2 s.

    Verifies: CO-20
    """
    bench.node.bus_off()
    bench.idle(0.01)
    assert [data[:3] for data in bench.taken(0x80 + NODE)] == [b"\x40\x81\x11"]
    bench.node.bus_back()
    bench.idle(0.01)
    assert [data[:3] for data in bench.taken(0x80 + NODE)] == [b"\0\0\0"]
    for _ in range(30):
        bench.node.overrun()
        bench.idle(0.05)
    assert [data[:2] for data in bench.taken(0x80 + NODE)] == [b"\x10\x81"]
    bench.idle(2.0)
    assert [data[:6] for data in bench.taken(0x80 + NODE)] == [b"\0\0\0\0\x10\x81"]
    assert bench.node.value("error_register") == 0
    assert bench.node.value("error_field_error_1") == 0x8110
