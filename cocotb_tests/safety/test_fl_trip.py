"""Trips: every source, reaction times at the gates, latching, clearing with the cause gone, log.

The reference is a plain list of what happened; converter codes are made from wanted deviations.
"""

from __future__ import annotations

import random
from typing import Any, TypeAlias

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge

from fluxlock.cosim.block import run_block_test
from fluxlock.paths import ROOT

Dut: TypeAlias = Any  # handles are found by name at run time
PHASE, DC, PIN, LOST, OVER, UNDER, SOFT, DEADLINE = (1 << i for i in range(8))
ALL = 0xFF
CHANNELS = 9
MIDDLE = 2048
QUIET = [100, 200, 300, MIDDLE, MIDDLE, MIDDLE, 2000, MIDDLE, 50]  # v0..2, i0..2, vdc, idc, vsm


class TripTb:
    def __init__(self, dut: Dut) -> None:
        self.dut = dut

    async def start(self, **settings: int) -> None:
        inputs = {
            "rst_i": 1, "adc_valid_i": 0, "adc_code_i": 0, "fault_pin_i": 0, "lost_i": 0, "software_i": 0,
            "deadline_i": 0, "guard_enable_i": 0, "cfg_enable_i": ALL, "cfg_phase_lsb_i": 1000, "cfg_dc_lsb_i": 500,
            "cfg_over_lsb_i": 3000, "cfg_under_lsb_i": 1000, "clear_i": 0, "log_index_i": 0, "req_h_i": 7,
        }  # fmt: skip
        for name, value in (inputs | settings).items():
            getattr(self.dut, name).value = value
        Clock(self.dut.clk_i, 20, "ns").start()
        await self.clocks(3)
        self.dut.rst_i.value = 0
        await self.clocks(2)
        self.dut.guard_enable_i.value = 1
        await self.clocks(1030)
        assert self.gates() == 0b010101, "the guard does not conduct"

    async def clocks(self, n: int) -> None:
        for _ in range(n):
            await FallingEdge(self.dut.clk_i)

    def gates(self) -> int:
        return int(self.dut.gate_o.value)

    def get(self, name: str) -> int:
        return int(getattr(self.dut, name).value)

    async def sample(self, **codes: int) -> None:
        """One sample set; keyword cN replaces the code of channel N. Codes are random while valid is low."""
        values = list(QUIET)
        for key, code in codes.items():
            values[int(key[1:])] = code
        self.dut.adc_code_i.value = sum(c << (12 * i) for i, c in enumerate(values))
        self.dut.adc_valid_i.value = 1
        await self.clocks(1)
        self.dut.adc_valid_i.value = 0
        self.dut.adc_code_i.value = random.getrandbits(12 * CHANNELS)

    async def pulse(self, name: str) -> None:
        getattr(self.dut, name).value = 1
        await self.clocks(1)
        getattr(self.dut, name).value = 0

    async def until_off(self, limit: int = 10) -> int:
        """Clock edges from now to the first with all gates off."""
        for n in range(limit):
            if self.gates() == 0:
                return n
            await self.clocks(1)
        return limit

    async def clear(self) -> int:
        """Write the key; the causes that stay latched."""
        await self.pulse("clear_i")
        return self.get("latched_o")


@cocotb.test()
async def codes_trip_at_their_limits(dut: Dut) -> None:
    tb = TripTb(dut)
    await tb.start()
    cases = [(f"c{3 + x}", MIDDLE + s * 1000, MIDDLE + s * 1001, PHASE) for x in range(3) for s in (-1, 1)]
    cases += [("c7", MIDDLE + s * 500, MIDDLE + s * 501, DC) for s in (-1, 1)]
    cases += [
        ("c6", 3000, 3001, OVER),
        ("c6", 1000, 999, UNDER),
        ("c3", 1500, 0, PHASE),
        ("c5", 1500, 4095, PHASE),
    ]
    for channel, good, bad, cause in cases:
        await tb.sample(**{channel: good})
        await tb.clocks(5)
        assert tb.gates() and not tb.get("trip_o"), f"{channel} = {good} tripped"
        await tb.sample(**{channel: bad})  # returns one edge after adc_valid_i rose
        edges = 1 + await tb.until_off()
        assert edges <= 3, f"{channel} = {bad}: gates off {edges} clocks after valid"
        assert edges == 2, "the stated latency is 2 clocks"
        assert tb.get("latched_o") == tb.get("first_o") == tb.get("present_o") == cause
        await tb.clocks(20)
        assert await tb.clear() == cause, "cleared while the last sample set still shows the cause"
        await tb.sample()
        await tb.clocks(2)
        assert tb.get("present_o") == 0 and tb.gates() == 0, "released without the key"
        assert await tb.clear() == 0
        await tb.clocks(2)
        assert tb.gates(), "no gate after clearing"
    assert tb.get("count_o") == len(cases)


@cocotb.test()
async def other_channels_do_not_trip(dut: Dut) -> None:
    tb = TripTb(dut)
    await tb.start()
    for channel in ("c0", "c1", "c2", "c8"):
        for code in (0, 4095):
            await tb.sample(**{channel: code})
            await tb.clocks(3)
            assert tb.gates() and tb.get("present_o") == 0, f"{channel} = {code} tripped"


@cocotb.test()
async def fault_pin_acts_at_the_third_edge(dut: Dut) -> None:
    tb = TripTb(dut)
    await tb.start()
    for width in (1, 2, 40):
        dut.fault_pin_i.value = 1
        for edge in range(1, 5):
            await tb.clocks(1)
            if edge == width:
                dut.fault_pin_i.value = 0
            assert (tb.gates() == 0) == (edge >= 3), f"pin pulse of {width} clocks, edge {edge}"
        await tb.clocks(width)
        dut.fault_pin_i.value = 0
        await tb.clocks(4)
        assert tb.get("latched_o") == PIN and tb.gates() == 0
        assert await tb.clear() == 0
        await tb.clocks(2)
    # The cause must be gone.
    dut.fault_pin_i.value = 1
    await tb.clocks(5)
    assert await tb.clear() == PIN
    dut.fault_pin_i.value = 0
    await tb.clocks(5)
    assert tb.gates() == 0
    assert await tb.clear() == 0


@cocotb.test()
async def pulses_trip_at_the_next_edge(dut: Dut) -> None:
    tb = TripTb(dut)
    await tb.start()
    for name, cause in (("lost_i", LOST), ("software_i", SOFT), ("deadline_i", DEADLINE)):
        await tb.pulse(name)
        assert tb.gates() == 0, f"{name}: gates on after one edge"
        assert tb.get("latched_o") == cause
        await tb.clocks(10)
        assert tb.gates() == 0
        assert await tb.clear() == 0
        await tb.clocks(2)
        assert tb.gates()
        # A trip in the very clock of the clear is not lost.
        getattr(dut, name).value = 1
        assert await tb.clear() == cause
        getattr(dut, name).value = 0
        await tb.clocks(3)
        assert tb.gates() == 0
        assert await tb.clear() == 0
        await tb.clocks(2)


@cocotb.test()
async def deadline_lasts_as_long_as_its_level(dut: Dut) -> None:
    tb = TripTb(dut)
    await tb.start()
    dut.deadline_i.value = 1
    await tb.clocks(1)
    assert tb.gates() == 0, "gates on one edge after the fault of the leg carriers"
    await tb.clocks(5)
    assert await tb.clear() == DEADLINE and tb.get("present_o") == DEADLINE, "cleared while the fault lasts"
    dut.deadline_i.value = 0
    await tb.clocks(3)
    assert tb.gates() == 0 and tb.get("present_o") == 0, "released without the key"
    assert await tb.clear() == 0
    await tb.clocks(2)
    assert tb.gates() and tb.get("count_o") == 1


@cocotb.test()
async def enables_mask_and_are_locked(dut: Dut) -> None:
    tb = TripTb(dut)
    await tb.start()

    async def cause_all() -> None:
        dut.fault_pin_i.value = 1
        await tb.sample(c3=0, c6=4000, c7=0)
        dut.lost_i.value, dut.software_i.value, dut.deadline_i.value = 1, 1, 1
        await tb.clocks(1)
        dut.lost_i.value, dut.software_i.value, dut.deadline_i.value = 0, 0, 0
        await tb.clocks(3)
        dut.fault_pin_i.value = 0
        await tb.sample(c6=500)
        await tb.clocks(3)
        await tb.sample()
        await tb.clocks(3)

    for bit in range(8):
        dut.guard_enable_i.value = 0
        dut.cfg_enable_i.value = 1 << bit
        await tb.clocks(2)
        dut.guard_enable_i.value = 1
        await tb.clocks(2)
        assert await tb.clear() == 0
        dut.cfg_enable_i.value = ALL & ~(1 << bit)  # locked: the guard is enabled
        await cause_all()
        assert tb.get("latched_o") == 1 << bit, f"only source {bit} enabled: {tb.get('latched_o'):08b}"
    dut.guard_enable_i.value = 0
    dut.cfg_enable_i.value = 0
    await tb.clocks(2)
    assert await tb.clear() == 0
    dut.guard_enable_i.value = 1
    await cause_all()
    assert tb.get("latched_o") == 0 and tb.gates()


@cocotb.test()
async def first_cause_and_count(dut: Dut) -> None:
    tb = TripTb(dut)
    await tb.start()
    await tb.sample(c7=0, c4=0)
    await tb.clocks(2)
    assert tb.get("first_o") == PHASE | DC and tb.get("count_o") == 1
    await tb.pulse("software_i")
    await tb.pulse("software_i")  # known already: no new trip
    await tb.clocks(2)
    assert tb.get("first_o") == PHASE | DC and tb.get("count_o") == 2
    assert await tb.clear() == PHASE | DC
    assert tb.get("first_o") == PHASE | DC
    await tb.sample()
    assert await tb.clear() == 0
    assert tb.get("first_o") == 0
    await tb.pulse("lost_i")
    assert tb.get("first_o") == LOST
    for _ in range(300):
        await tb.clear()
        await tb.pulse("lost_i")
    assert tb.get("count_o") == 255, "the count does not saturate"


@cocotb.test()
async def log_of_eight(dut: Dut) -> None:
    """Random trips: the log holds the last eight with time, cause, and the phase with the largest current."""
    rng = random.Random(7)
    tb = TripTb(dut)
    await tb.start()
    entries: list[tuple[int, int, int, int]] = []

    async def check() -> None:
        await tb.clocks(4)
        for index in range(8):
            dut.log_index_i.value = index
            await tb.clocks(1)
            if index < len(entries):
                got = tuple(tb.get(f"log_{n}_o") for n in ("stamp", "cause", "phase", "code"))
                assert tb.get("log_valid_o") == 1
                assert got == entries[-1 - index], f"entry {index}: {got}, expected {entries[-1 - index]}"
            else:
                assert tb.get("log_valid_o") == 0, f"entry {index} of {len(entries)} is valid"

    await check()
    for _ in range(30):
        codes = [MIDDLE + rng.choice([-1, 1]) * rng.randrange(1, 900) for _ in range(3)]
        cause = rng.choice([PHASE, SOFT, LOST])
        if cause == PHASE:
            codes[rng.randrange(3)] = rng.choice([rng.randrange(1040), rng.randrange(3060, 4096)])
        await tb.sample(**{f"c{3 + x}": c for x, c in enumerate(codes)})
        if cause != PHASE:
            await tb.clocks(rng.randrange(4))
        # A pulse is stamped with its clock, a code with the clock after its valid: both are `now` here.
        stamp = tb.get("now_o")
        largest = max(range(3), key=lambda x: abs(codes[x] - MIDDLE))
        if cause != PHASE:
            await tb.pulse("software_i" if cause == SOFT else "lost_i")
        entries.append((stamp, cause, largest, codes[largest]))
        await tb.clocks(1)
        await tb.sample()
        assert await tb.clear() == 0
        await check()


@cocotb.test()
async def event_pulse(dut: Dut) -> None:
    tb = TripTb(dut)
    await tb.start()
    await tb.pulse("software_i")
    assert tb.get("event_o") == 1 and tb.get("event_cause_o") == SOFT
    for _ in range(20):
        await tb.clocks(1)
        assert tb.get("event_o") == 0, "one trip, more than one event"
    dut.fault_pin_i.value = 1
    events = []
    for _ in range(20):
        await tb.clocks(1)
        if tb.get("event_o"):
            events.append(tb.get("event_cause_o"))
    assert events == [PIN], f"a further cause is an event of its own: {events}"


def test_fl_trip() -> None:
    """Trip block test, with the guard.

    Verifies: SAFE-07, SAFE-08, SAFE-09, SAFE-10, SAFE-11, SAFE-12
    """
    run_block_test(
        "fl_safety_chain",
        [
            "safety/fl_sync.sv",
            "safety/fl_trip.sv",
            "safety/fl_gate_guard.sv",
            ROOT / "cocotb_tests" / "safety" / "fl_safety_chain.sv",
        ],
        __name__,
    )
