# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The chip with the core of the debug bus: a debugger halts, reads, writes, steps and resets the core alone."""

from __future__ import annotations

from typing import Any

import cocotb
from cocotb.triggers import FallingEdge, RisingEdge, Timer

from cocotb_tests.soc.bench import CLOCK_NS, Bench
from fluxlock.base.paths import BUILD, REGISTER_BLOCKS, RTL
from fluxlock.base.writable import write_whole
from fluxlock.cosim.block import run_block_test
from fluxlock.cosim.chip import rtl_sources
from fluxlock.generate.soft_core import soft_core

# Debug bus: addresses, bits that set and clear, bits of the state.
CONTROL, DATA, BREAKPOINTS = 0x00, 0x04, (0x40, 0x44)
STEP, RESET, HALT, END_RESET, RESUME = 1 << 4, 1 << 16, 1 << 17, 1 << 24, 1 << 25
NO_EBREAK, EBREAK_HALTS = 1 << 18, 1 << 26
IN_RESET, HALTED, BUSY, BY_BREAK = 1 << 0, 1 << 1, 1 << 2, 1 << 3

EBREAK = 0x00100073
START, MAILBOX = 0x80, 0x1E000
CONSTANT, OTHER = 0x5AFE600D, 0x0DDBA115
WINDOW = 5000  # of the watchdog, clocks
PERIOD = 500  # of the carrier, clocks
LINK, TEMPORARY, STEPS, SAFETY, WAIT, KEPT, BOX = 1, 5, 8, 9, 10, 20, 21  # registers


def address(block: str, offset: int) -> int:
    return 0x80000000 + 0x1000 * REGISTER_BLOCKS.index(block) + offset


FEED = address("safety", 0x34)


def addi(rd: int, rs: int, value: int) -> int:
    return (value & 0xFFF) << 20 | rs << 15 | rd << 7 | 0x13


def load(rd: int, rs: int) -> int:
    return rs << 15 | 2 << 12 | rd << 7 | 0x03


def store(rs: int, value: int, offset: int = 0) -> int:
    return (offset >> 5) << 25 | value << 20 | rs << 15 | 2 << 12 | (offset & 31) << 7 | 0x23


def constant(rd: int, value: int) -> list[int]:
    """lui, addi."""
    return [(value + 0x800 & 0xFFFFF000) | rd << 7 | 0x37, addi(rd, rd, value)]


PC = 0x17  # auipc x0, 0: its result is the program counter
BACK = 0xFE000EE3 | WAIT << 15 | 1 << 12  # bne WAIT, x0, -4
AGAIN = 0xFE9FF06F  # jal x0, -24
# Six steps at a constant speed, with the watchdog: tick, carrier, commutations, their update, trip, guard.
SETTINGS = (
    (address("timer", 0x00), 1000),
    (address("pwm", 0x04), PERIOD),
    (address("pwm", 0x08), PERIOD // 2 << 8),
    (address("pwm", 0x00), 2 | 2 << 4),
    (address("comm", 0x0C), 3000),
    (address("comm", 0x00), 1),
    (address("timer", 0x0C), 1),
    (address("safety", 0x08), 0x80),
    (address("safety", 0x30), WINDOW),
    (address("safety", 0x00), 1),
)
PREPARE = [
    *(word for adr, value in SETTINGS for word in (*constant(5, adr), *constant(6, value), store(5, 6))),
    addi(STEPS, 0, 0),
    *constant(SAFETY, address("safety", 0)),
    *constant(KEPT, CONSTANT),
    *constant(BOX, MAILBOX),
]
# Counts, reports to the watchdog, puts a register into the memory, waits.
LOOP = START + 4 * len(PREPARE)
TURN = [
    addi(STEPS, STEPS, 1),
    store(SAFETY, STEPS, 0x34),
    store(BOX, KEPT),
    addi(WAIT, 0, 40),
    addi(WAIT, WAIT, -1),
    BACK,
    AGAIN,
]
REPORT, BRANCH = LOOP + 4, LOOP + 20
PROGRAM = [*PREPARE, *TURN]


class Debugger:
    """Master of the debug bus, and what the chip shows of the core at its own pins and buses."""

    def __init__(self, dut: Any) -> None:
        self.dut, self.bench = dut, Bench(dut)
        self.reports: list[tuple[int, int]] = []  # to the watchdog: time, number
        self.trips: list[tuple[int, int]] = []  # time, cause

    async def start(self) -> None:
        idle = {"adc_valid_i": 0, "adc_code_i": 0, "adc_fault_i": 0, "clock_fault_i": 0, "fault_pin_i": 0, "hall_i": 0}
        idle |= {"encoder_i": 0, "uart_rx_i": 1, "can_rx_i": 1, "spi_miso_i": 1}
        await self.bench.start(**idle, debug_valid_i=0, debug_we_i=0, debug_adr_i=0, debug_wdat_i=0)
        cocotb.start_soon(self._listen())
        cocotb.start_soon(self._trips())

    async def _listen(self) -> None:
        while True:
            await RisingEdge(self.dut.io_stb)
            await FallingEdge(self.dut.clk_i)
            if self.dut.io_we.value == 1 and int(self.dut.io_adr.value) == (FEED & 0x7FFFFFFF) // 4:
                self.reports.append((self.now(), int(self.dut.io_wdat.value)))

    async def _trips(self) -> None:
        while True:
            await RisingEdge(self.dut.trc_trip_o)
            await FallingEdge(self.dut.clk_i)
            self.trips.append((self.now(), int(self.dut.trc_trip_cause_o.value)))

    def now(self) -> int:
        return int(self.dut.trc_now_o.value)

    def mailbox(self) -> int:
        return int(self.dut.u_cpu.u_ram.mem[MAILBOX // 4].value)

    async def write(self, adr: int, value: int) -> None:
        for name, given in (("adr", adr), ("wdat", value), ("we", 1), ("valid", 1)):
            getattr(self.dut, f"debug_{name}_i").value = given
        for _ in range(100):
            await Timer(CLOCK_NS // 4, "ns")
            ready = int(self.dut.debug_ready_o.value)
            await FallingEdge(self.dut.clk_i)
            if ready:
                self.dut.debug_valid_i.value = self.dut.debug_we_i.value = 0
                return
        raise AssertionError(f"the debug bus does not take {value:#x} at {adr:#x}")

    async def read(self, adr: int) -> int:
        self.dut.debug_adr_i.value = adr
        await FallingEdge(self.dut.clk_i)
        return int(self.dut.debug_rdat_o.value)

    async def state(self) -> int:
        return await self.read(CONTROL) & 0x1F

    async def until_halted(self) -> int:
        """The state in which the core stands."""
        for _ in range(2000):
            state = await self.state()
            if state & HALTED and not state & BUSY:
                return state
        raise AssertionError("the core does not halt")

    async def execute(self, *instructions: int) -> int:
        """Instructions of the debugger in the halted core; result of the last."""
        for instruction in instructions:
            await self.write(DATA, instruction)
            await self.until_halted()
        return await self.read(DATA)

    async def register(self, number: int) -> int:
        return await self.execute(addi(0, number, 0))

    async def pc(self) -> int:
        """Of a core that was not halted by a breakpoint: then it is in `DATA` until the debugger executes something."""
        return await self.execute(PC)

    async def go_to(self, adr: int) -> None:
        """Go on from there, as a debugger has to after a breakpoint."""
        await self.execute(*constant(LINK, adr), LINK << 15 | 0x67)  # jalr x0, LINK

    async def memory(self, adr: int) -> int:
        return await self.execute(*constant(TEMPORARY, adr), load(TEMPORARY, TEMPORARY), addi(0, TEMPORARY, 0))

    async def put(self, adr: int, value: int) -> None:
        await self.execute(*constant(TEMPORARY, adr), *constant(TEMPORARY + 1, value), store(TEMPORARY, TEMPORARY + 1))

    async def step(self) -> int:
        """One instruction of the program; where the next one is."""
        await self.write(CONTROL, STEP | RESUME)
        await self.until_halted()
        await self.write(CONTROL, 0)
        return await self.pc()

    async def until_break(self) -> int:
        """Address of the instruction at which the core has stopped."""
        assert await self.until_halted() & BY_BREAK, "halted, but not by a breakpoint"
        at = await self.read(DATA)
        await self.go_to(at)
        return at

    async def run_to(self, index: int, adr: int) -> int:
        """Go on to a breakpoint, and take it away."""
        await self.write(BREAKPOINTS[index], adr | 1)
        await self.write(CONTROL, RESUME)
        at = await self.until_break()
        await self.write(BREAKPOINTS[index], 0)
        return at


@cocotb.test
async def debugger_sees_and_leads_the_core(dut: Any) -> None:
    debugger = Debugger(dut)
    await debugger.start()
    await debugger.bench.clocks(2000)
    assert await debugger.state() & (HALTED | IN_RESET | BY_BREAK) == 0
    assert debugger.mailbox() == CONSTANT and len(debugger.reports) > 5

    assert await debugger.run_to(0, LOOP) == LOOP
    last = debugger.reports[-1][1]
    held = {STEPS: last, SAFETY: address("safety", 0), KEPT: CONSTANT, BOX: MAILBOX, WAIT: 0}
    assert {number: await debugger.register(number) for number in held} == held
    assert await debugger.memory(MAILBOX) == CONSTANT
    assert await debugger.memory(address("pwm", 0x04)) == PERIOD

    await debugger.execute(*constant(KEPT, OTHER))
    assert await debugger.step() == REPORT
    assert await debugger.register(STEPS) == last + 1 and debugger.reports[-1][1] == last
    assert await debugger.step() == REPORT + 4
    await debugger.bench.clocks(20)
    assert debugger.reports[-1][1] == last + 1 and debugger.mailbox() == CONSTANT
    assert await debugger.step() == REPORT + 8
    await debugger.bench.clocks(20)
    assert debugger.mailbox() == OTHER and await debugger.memory(MAILBOX) == OTHER

    assert (await debugger.run_to(1, BRANCH), await debugger.register(WAIT)) == (BRANCH, 39)
    assert await debugger.step() == BRANCH - 4

    # A breakpoint of the debugger's in the memory: nothing, until `ebreak` shall halt again.
    await debugger.put(REPORT, EBREAK)
    await debugger.write(CONTROL, NO_EBREAK | RESUME)
    await debugger.bench.clocks(2000)
    assert not await debugger.state() & HALTED and debugger.reports[-1][1] == last + 1
    await debugger.write(CONTROL, HALT)
    await debugger.until_halted()
    assert await debugger.register(STEPS) > last + 5
    await debugger.execute(addi(STEPS, 0, last + 1))
    await debugger.go_to(LOOP)
    await debugger.write(CONTROL, EBREAK_HALTS | RESUME)
    assert (await debugger.until_break(), await debugger.register(STEPS)) == (REPORT, last + 2)
    await debugger.put(REPORT, TURN[1])

    await debugger.write(CONTROL, RESUME)
    await debugger.bench.clocks(2000)
    assert not await debugger.state() & HALTED
    await debugger.write(CONTROL, HALT)
    state = await debugger.until_halted()
    assert not state & BY_BREAK
    numbers = [number for _, number in debugger.reports]
    assert numbers == list(range(1, len(numbers) + 1)), f"the program was led astray: {numbers}"
    assert LOOP <= await debugger.pc() <= BRANCH + 4
    assert await debugger.register(STEPS) - numbers[-1] in (0, 1)
    before = len(numbers)
    await debugger.bench.clocks(1000)
    assert len(debugger.reports) == before, "a halted core goes on"


@cocotb.test
async def reset_of_the_core_leaves_the_chip(dut: Any) -> None:
    debugger = Debugger(dut)
    await debugger.start()
    await debugger.bench.clocks(2000)
    assert len(debugger.reports) > 5
    await debugger.write(BREAKPOINTS[0], LOOP | 1)
    before = debugger.now()
    await debugger.write(CONTROL, RESET | HALT)
    await debugger.bench.clocks(100)
    assert await debugger.state() & (IN_RESET | HALTED) == IN_RESET | HALTED
    await debugger.write(CONTROL, END_RESET)
    await debugger.bench.clocks(300)  # the core clears its data cache
    assert await debugger.pc() == START
    assert await debugger.memory(address("pwm", 0x04)) == PERIOD and debugger.now() > before + 100
    await debugger.write(CONTROL, RESUME)
    assert (await debugger.until_break(), await debugger.register(STEPS)) == (LOOP, 0)
    # The reset of the chip is that of the debug logic too.
    await debugger.bench.start()
    debugger.reports.clear()
    await debugger.bench.clocks(2000)
    assert await debugger.state() & HALTED == 0 and len(debugger.reports) > 5


@cocotb.test
async def halted_core_opens_the_gates(dut: Any) -> None:
    debugger = Debugger(dut)
    await debugger.start()
    await debugger.bench.clocks(3 * WINDOW)
    assert not debugger.trips and debugger.reports[-1][0] > 3 * WINDOW - 500
    await debugger.write(CONTROL, HALT)
    await debugger.until_halted()
    at = debugger.reports[-1][0]
    changes, gates = [], int(dut.gate_o.value)
    while debugger.now() < at + 2 * WINDOW:
        await debugger.bench.clocks()
        if int(dut.gate_o.value) != gates:
            gates = int(dut.gate_o.value)
            changes.append(debugger.now())
    assert len(changes) > 20, "the carrier stands with the core"
    assert [cause for _, cause in debugger.trips] == [0x80]
    late = (debugger.trips[0][0] - at - WINDOW, changes[-1] - at - WINDOW)
    assert gates == 0 and late == (3, 3), f"trip and last gate: {late} clocks after the window"
    before = len(debugger.reports)
    await debugger.write(CONTROL, RESUME)
    await debugger.bench.clocks(WINDOW)
    assert len(debugger.reports) > before + 5 and int(dut.gate_o.value) == 0


def test_core_debug() -> None:
    """A debugger at the bus of the chip leads the core; the gates open within the watchdog's window after a halt.

    Verifies: SOC-32, SOC-33
    """
    image = BUILD / "block" / "core_debug.hex"
    image.parent.mkdir(parents=True, exist_ok=True)
    write_whole(image, "".join(f"{word:08x}\n" for word in [0] * (START // 4) + PROGRAM))
    sources = [path for path in rtl_sources() if path.is_relative_to(RTL) and path.parent.name != "pkg"]
    run_block_test(
        "fl_soc",
        [*sources, soft_core(debug=True)],
        __name__,
        parameters={"Init": f'"{image}"', "Vector": 0},
        registers=REGISTER_BLOCKS,
        seen=["fl_ram"],
    )
