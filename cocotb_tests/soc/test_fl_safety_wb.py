# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Watchdog, lock, safe state and brake chopper behind the register bus, up to the gates."""

from __future__ import annotations

import random
from typing import Any

import cocotb
import pytest

from cocotb_tests.soc.bench import Bench
from fluxlock.cosim.block import run_block_test

GUARD, DEAD_TIME, ENABLE, CURRENT, VOLTAGE, COMMAND, TRIP = range(0, 28, 4)
LOCK, WATCHDOG, FEED, MONITOR, BRAKE, BRAKE_LEVEL, BRAKE_TIME, SAMPLE_AGE = range(0x2C, 0x4C, 4)
GATES = 0x28
KEY, CLEAR = 0x10CC, 0xA5 << 8
SHORT = 1 << 8  # of GUARD
DEADLINE = 0x80
# Clocks until the gates are off, published by the pages: after the watchdog's period from the write of a number, after
# the age of the last sample set, and after a locked setting has changed.
PERIOD_TO_OFF = 2
AGE_TO_OFF = 1
CHANGED_TO_OFF = 2
EXPIRED, WRONG, CHANGED, BRAKE_OVER, LATE, CONVERTER, CLOCK = 1, 2, 4, 8, 16, 32, 64
# What the lock holds, by address, with the bits that count.
HELD = {
    GUARD: 0x100, DEAD_TIME: 0x3FF, ENABLE: 0xFF, CURRENT: 0x0FFF0FFF, VOLTAGE: 0x0FFF0FFF, WATCHDOG: 0xFFFFFF,
    LOCK: 0xFFFF, BRAKE: 0x1, BRAKE_LEVEL: 0x0FFF0FFF, BRAKE_TIME: 0xFFFFFFFF, SAMPLE_AGE: 0xFFFFF,
}  # fmt: skip
MIDDLE = sum(0x800 << 12 * i for i in range(9))


class TB(Bench):
    """The block with currents at rest and legs that ask for upper A, lower B."""

    def polarity(self) -> int:
        """Of the build: bit 0 upper, bit 1 lower gate pins active low."""
        return int(self.dut.HighActiveLow.value) | int(self.dut.LowActiveLow.value) << 1

    async def begin(self, period: int = 0) -> None:
        inputs = ("now_i", "adc_fault_i", "clock_fault_i", "fault_pin_i", "lost_i", "deadline_i", "adc_valid_i")
        await self.start(adc_code_i=MIDDLE, req_h_i=1, req_l_i=2, **dict.fromkeys(inputs, 0))
        await self.write(ENABLE, 0xFF)
        await self.write(WATCHDOG, period)

    async def enable(self) -> None:
        await self.write(GUARD, 1)
        await self.clocks(2)

    def pins(self) -> tuple[int, int]:
        """Upper and lower gates that are on, by the pins, a bit a leg."""
        upper = int(self.dut.gate_h_o.value) ^ 7 * int(self.dut.HighActiveLow.value)
        lower = int(self.dut.gate_l_o.value) ^ 7 * int(self.dut.LowActiveLow.value)
        assert not upper & lower, "both gates of a leg are on"
        return upper, lower

    def on(self) -> int:
        """Legs with a gate on, by the pins."""
        upper, lower = self.pins()
        return upper | lower

    async def caused(self) -> tuple[int, int]:
        """Latched trips, and what the monitor tells."""
        return await self.read(TRIP) & 0xFF, await self.read(MONITOR) & 0x7F

    async def vdc(self, code: int) -> None:
        """A sample set with this code of vdc."""
        self.dut.adc_code_i.value = MIDDLE & ~(0xFFF << 72) | code << 72
        self.dut.adc_valid_i.value = 1
        await self.clocks()
        self.dut.adc_valid_i.value = 0


@cocotb.test
async def gates_stay_on_while_steps_are_told(dut: Any) -> None:
    tb = TB(dut)
    await tb.begin(period=100)
    await tb.write(FEED, 250)
    await tb.enable()
    await tb.clocks(1100)  # the guard waits after a reset
    assert not tb.on(), "nothing was told, and the watchdog let the gates on"
    assert await tb.caused() == (DEADLINE, EXPIRED)
    await tb.write(COMMAND, CLEAR)
    await tb.write(FEED, 250)
    await tb.enable()
    for step in range(251, 251 + 40):
        await tb.clocks(random.randrange(5, 90))
        assert tb.on()
        await tb.write(FEED, step % 256)
    clocks = 0
    while tb.on() and clocks < 110:
        await tb.clocks()
        clocks += 1
    # One clock each: the report's register, the guard.
    assert clocks == 100 + PERIOD_TO_OFF, f"gates off after {clocks} clocks"
    assert await tb.caused() == (DEADLINE, EXPIRED)
    assert (await tb.read(GUARD)) & 1 == 0


@cocotb.test
async def wrong_number_opens_the_gates(dut: Any) -> None:
    tb = TB(dut)
    await tb.begin(period=5000)
    await tb.enable()
    await tb.clocks(1100)
    assert tb.on()
    await tb.write(FEED, 1)
    await tb.clocks(5)
    assert tb.on()
    await tb.write(FEED, 1)
    await tb.clocks(3)
    assert not tb.on()
    assert await tb.caused() == (DEADLINE, WRONG)
    await tb.write(COMMAND, CLEAR)
    await tb.clocks(2)
    assert await tb.caused() == (0, 0)


@cocotb.test
async def locked_settings_hold(dut: Any) -> None:
    """Random words to every register of the block: what is locked keeps its value, the rest works."""
    tb = TB(dut)
    await tb.begin()
    values = {adr: random.getrandbits(32) & mask for adr, mask in HELD.items() if adr not in (LOCK, GUARD)}
    for adr, value in values.items():
        await tb.write(adr, value)
    await tb.write(LOCK, KEY)
    await tb.clocks(2)
    assert await tb.read(MONITOR) >> 8 & 1
    for _ in range(300):
        adr = random.choice(list(HELD))
        await tb.write(adr, random.getrandbits(32), random.randrange(16))
        for held, value in {**values, LOCK: KEY, GUARD: 0}.items():
            assert await tb.read(held) & HELD[held] == value, f"{held:#x} after a write to {adr:#x}"
    await tb.write(GUARD, 1)
    await tb.clocks(2)
    tb.dut.rst_i.value = 1
    await tb.clocks()
    tb.dut.rst_i.value = 0
    await tb.write(DEAD_TIME, 77)
    assert await tb.read(DEAD_TIME) == 77, "a reset opens the lock"


@cocotb.test
async def upset_of_a_locked_setting_trips(dut: Any) -> None:
    """A parity that is no more that of the locked settings opens the gates and keeps them open, whatever the key."""
    tb = TB(dut)
    await tb.begin()
    await tb.write(LOCK, KEY)
    await tb.enable()
    await tb.clocks(1100)
    assert tb.on()
    parity = dut.u_lock.parity_q
    parity.value = 1 - int(parity.value)
    await tb.clocks(CHANGED_TO_OFF)
    assert not tb.on()
    assert await tb.caused() == (DEADLINE, CHANGED)
    for _ in range(3):
        await tb.write(COMMAND, CLEAR)
        await tb.enable()
        assert not tb.on()


@cocotb.test
async def safe_state_by_register(dut: Any) -> None:
    """A short after a trip, held by the lock, ended by the key; an upset of the settings opens it for good."""
    tb = TB(dut)
    await tb.begin()
    await tb.write(GUARD, SHORT)
    await tb.write(LOCK, KEY)
    await tb.clocks(2)
    await tb.enable()
    await tb.clocks(1100)
    assert await tb.read(GATES) == 0b001001
    await tb.write(COMMAND, 1)
    await tb.clocks(2)
    assert await tb.read(GATES) == 0b101000, "only leg A waits for its dead time of 50 clocks"
    await tb.clocks(60)
    assert await tb.read(GUARD) == SHORT | tb.polarity() << 4, "the trip has cleared enable, the lock held the rest"
    assert await tb.read(GATES) == 0b101010
    await tb.write(GUARD, 0)
    await tb.clocks(2)
    assert await tb.read(GATES) == 0b101010, "what disables the drive does not end a short"
    await tb.write(COMMAND, CLEAR)
    await tb.clocks(3)
    assert not tb.on()
    await tb.enable()
    await tb.clocks(60)
    assert await tb.read(GATES) == 0b001001
    await tb.write(COMMAND, 1)
    await tb.clocks(60)
    assert await tb.read(GATES) == 0b101010
    parity = dut.u_lock.parity_q
    parity.value = 1 - int(parity.value)
    await tb.clocks(CHANGED_TO_OFF)
    assert not tb.on()
    assert await tb.caused() == (DEADLINE | 0x40, CHANGED)
    await tb.write(COMMAND, CLEAR)
    await tb.enable()
    await tb.clocks(60)
    assert not tb.on()


@cocotb.test
async def brake_follows_vdc_and_opens_the_gates_at_its_end(dut: Any) -> None:
    """By its registers: off after reset, on while the link is high, tripped or not, overload by its own name."""
    tb = TB(dut)
    await tb.begin()
    await tb.vdc(4095)
    await tb.clocks(2)
    assert dut.brake_o.value == 0, "after a reset there is no brake"
    await tb.write(BRAKE_LEVEL, 3000 | 2800 << 16)
    await tb.write(BRAKE_TIME, 100)
    await tb.write(BRAKE, 1)
    await tb.write(SAMPLE_AGE, 1500)
    await tb.write(LOCK, KEY)
    await tb.enable()
    await tb.clocks(1100)
    assert tb.on()
    for code, on in ((3000, 0), (3001, 1), (2800, 1), (2799, 0)):
        await tb.vdc(code)
        await tb.clocks()
        assert int(dut.brake_o.value) == on, f"code {code}"
        assert await tb.read(BRAKE) == on << 1 | 1
    await tb.write(COMMAND, 1)
    await tb.clocks(3)
    assert not tb.on()
    await tb.vdc(3500)
    assert dut.brake_o.value == 1, "a trip leaves the brake alone"
    await tb.write(COMMAND, CLEAR)
    await tb.clocks(2)
    await tb.enable()
    await tb.clocks(30)
    assert tb.on()
    for _ in range(12):
        await tb.vdc(3500)
        await tb.clocks(9)
    assert dut.brake_o.value == 0
    assert not tb.on()
    assert await tb.caused() == (DEADLINE, BRAKE_OVER)
    await tb.write(COMMAND, CLEAR)
    await tb.clocks(2)
    await tb.enable()
    assert not tb.on(), "the link has not been low since"
    assert await tb.caused() == (DEADLINE, BRAKE_OVER)
    await tb.vdc(2799)
    await tb.write(COMMAND, CLEAR)
    await tb.clocks(2)
    await tb.enable()
    await tb.clocks(2)
    assert tb.on()
    assert await tb.caused() == (0, 0)


@cocotb.test
async def samples_that_stop_open_the_gates(dut: Any) -> None:
    """No sample set for the set time: gates and brake off, and no short, for nobody looks at the currents."""
    tb = TB(dut)
    await tb.begin()
    await tb.write(BRAKE_LEVEL, 3000 | 2800 << 16)
    await tb.write(BRAKE_TIME, 1000000)
    await tb.write(BRAKE, 1)
    await tb.write(SAMPLE_AGE, 60)
    await tb.write(GUARD, SHORT)
    await tb.write(LOCK, KEY)
    await tb.clocks(2)
    await tb.enable()
    for gap in [*[20] * 60, *range(50, 60)]:
        await tb.vdc(3500)
        await tb.clocks(gap - 1)
    assert tb.on() and dut.brake_o.value == 1
    await tb.vdc(3500)
    clocks = 0
    while tb.on() and clocks < 70:
        await tb.clocks()
        clocks += 1
    assert clocks == 60 + AGE_TO_OFF, f"gates off {clocks} clocks after the last sample"
    assert dut.brake_o.value == 0
    assert await tb.caused() == (DEADLINE, LATE)
    await tb.clocks(100)
    assert not tb.on()
    await tb.write(COMMAND, CLEAR)
    await tb.vdc(2000)
    await tb.enable()
    assert tb.on()
    assert await tb.caused() == (0, 0)


@cocotb.test
async def samples_that_stop_end_a_short(dut: Any) -> None:
    """The trip has cleared the guard's enable, and the watch goes on: the lower gates open after the set time."""
    tb = TB(dut)
    await tb.begin()
    await tb.write(SAMPLE_AGE, 60)
    await tb.write(GUARD, SHORT)
    await tb.write(LOCK, KEY)
    await tb.clocks(2)
    await tb.enable()
    for count in range(80):
        if count == 70:
            await tb.write(COMMAND, 1)
        await tb.vdc(2048)
        await tb.clocks(19)
    assert await tb.read(GATES) == 0b101010
    await tb.vdc(2048)
    clocks = 0
    while tb.on() and clocks < 70:
        await tb.clocks()
        clocks += 1
    assert clocks == 60 + AGE_TO_OFF, f"short ended {clocks} clocks after the last sample"
    assert await tb.caused() == (DEADLINE | 0x40, LATE)
    for _ in range(20):
        await tb.vdc(2048)
        await tb.clocks(19)
        assert not tb.on(), "a short that has ended came back"


@cocotb.test
async def every_locked_bit_is_watched(dut: Any) -> None:
    """Whichever bit of the locked settings flips, the gates open and stay open, in the polarity of the build.

    The enable of the trip that tells it is one of them.
    """
    tb = TB(dut)
    fields = [
        "guard_safe_state", "dead_time_cycles", "trip_enable_source", "current_limit_phase_lsb", "current_limit_dc_lsb",
        "voltage_limit_over_lsb", "voltage_limit_under_lsb", "watchdog_cycles", "brake_enable", "brake_level_on_lsb",
        "brake_level_off_lsb", "brake_time_cycles", "sample_age_cycles",
    ]  # fmt: skip
    await tb.begin()
    for name in fields:
        storage = getattr(dut.u_regs, f"field_storage_{name}")
        for bit in range(len(storage)) if name == "trip_enable_source" else [random.randrange(len(storage))]:
            dut.rst_i.value = 1
            await tb.clocks(2)
            assert not tb.on()
            dut.rst_i.value = 0
            await tb.write(ENABLE, 0xFF)
            await tb.write(LOCK, KEY)
            await tb.enable()
            await tb.clocks(1100)
            assert tb.on()
            storage.value = int(storage.value) ^ 1 << bit
            await tb.clocks(CHANGED_TO_OFF)
            assert not tb.on(), f"{name} bit {bit}"
            trips, causes = await tb.caused()
            assert trips & DEADLINE and causes & CHANGED, f"{name} bit {bit}"
            for _ in range(3):
                await tb.write(COMMAND, CLEAR)
                await tb.enable()
                await tb.clocks(60)
                assert not tb.on(), f"{name} bit {bit}"


@cocotb.test
@cocotb.parametrize(fault=["adc_fault_i", "clock_fault_i"])
async def fault_from_outside_opens_the_gates(dut: Any, fault: str) -> None:
    """A trip with a name of its own, that is not cleared while the fault is there, and no short circuit with it."""
    level, cause = getattr(dut, fault), {"adc_fault_i": CONVERTER, "clock_fault_i": CLOCK}[fault]
    tb = TB(dut)
    await tb.begin()
    await tb.write(GUARD, SHORT)
    await tb.write(LOCK, KEY)
    await tb.clocks(2)
    await tb.enable()
    await tb.clocks(1100)
    assert tb.on()
    level.value = 1
    await tb.clocks()
    assert not tb.on(), "gates on one clock after the fault"
    for _ in range(3):
        await tb.clocks(100)
        await tb.write(COMMAND, CLEAR)
        await tb.enable()
        assert not tb.on()
        assert await tb.caused() == (DEADLINE, cause)
    level.value = 0
    await tb.write(COMMAND, CLEAR)
    await tb.clocks(2)
    assert await tb.caused() == (0, 0)
    await tb.enable()
    assert tb.on()


async def enable_edges(tb: TB, clocks: int) -> int:
    """Edges of the drivers' enable in so many clocks."""
    count, before = 0, tb.dut.driver_enable_o.value
    for _ in range(clocks):
        await tb.clocks()
        count += tb.dut.driver_enable_o.value != before
        before = tb.dut.driver_enable_o.value
    return count


@cocotb.test
async def drivers_are_enabled_while_the_watchdog_is_fed(dut: Any) -> None:
    """An edge every 64 clocks with reports in time; none without period, guard or reports, trip enabled or not."""
    tb = TB(dut)
    await tb.begin()
    await tb.enable()
    assert await enable_edges(tb, 640) == 0, "edges without a watchdog"
    await tb.write(GUARD, 0)
    await tb.write(WATCHDOG, 500)
    assert await enable_edges(tb, 640) == 0, "edges with the gates disabled"
    for enables in (0xFF, 0xFF & ~DEADLINE):
        await tb.write(ENABLE, enables)
        await tb.write(COMMAND, CLEAR)
        await tb.write(FEED, 0)
        await tb.enable()
        edges = 0
        for step in range(1, 9):
            edges += await enable_edges(tb, 320)
            await tb.write(FEED, step)
        assert 38 <= edges <= 42
        await tb.clocks(510)
        assert await enable_edges(tb, 640) == 0 and dut.driver_enable_o.value == 0, "edges without reports"
        await tb.write(GUARD, 0)
        await tb.clocks(5)


@cocotb.test
async def short_circuit_keeps_the_drivers_enabled(dut: Any) -> None:
    """A short needs its drivers; a cause that opens it ends the edges."""
    tb = TB(dut)
    await tb.begin(0xFFFF)
    await tb.write(GUARD, SHORT | 1)
    await tb.clocks(1100)
    await tb.write(COMMAND, 1)
    await tb.clocks(1100)
    assert tb.pins() == (0, 7) and await enable_edges(tb, 640) == 10
    dut.clock_fault_i.value = 1
    await tb.clocks(2)
    assert not tb.on() and await enable_edges(tb, 640) == 0


@cocotb.test
async def key_acts_once(dut: Any) -> None:
    """It is gone from the register when it has acted: a pulse of the write alone clears nothing."""
    tb = TB(dut)
    await tb.begin()
    await tb.write(COMMAND, CLEAR)
    await tb.clocks(2)
    assert await tb.read(COMMAND) == 0
    await tb.write(COMMAND, 1)
    await tb.clocks(2)
    dut.clear_written_q.value = 1
    await tb.clocks(2)
    assert await tb.caused() == (0x40, 0)


def build_arguments(polarity: int) -> dict[str, Any]:
    """Of `run_block_test`: sources and parameters of the block."""
    names = ("trip", "gate_guard", "watchdog", "settings_lock", "brake", "driver_enable")
    sources = [
        "soc/fl_bus_pkg.sv",
        "common/fl_sync.sv",
        *(f"safety/fl_{name}.sv" for name in names),
        "soc/fl_safety_wb.sv",
    ]
    parameters = {"HighActiveLow": polarity & 1, "LowActiveLow": polarity >> 1}
    seen = ["fl_settings_lock", "fl_safety_regs", "fl_gate_guard"]
    return {"sources": sources, "registers": ["safety"], "parameters": parameters, "seen": seen}


@pytest.mark.parametrize("polarity", [0, 3])
def test_fl_safety_wb(polarity: int) -> None:
    """Watchdogs, lock, upsets of locked settings up to the pins, converter and clock faults, safe state, brake chopper.

    Verifies: SAFE-13, SAFE-14, SAFE-15, SAFE-17, SAFE-18, SAFE-20, SAFE-21, SAFE-23, CLK-04, CLK-06
    """
    run_block_test("fl_safety_wb", test_module=__name__, **build_arguments(polarity))
