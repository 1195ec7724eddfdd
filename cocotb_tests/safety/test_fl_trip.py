# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Trips: every source, reaction times at the gates, latching, clearing with the cause gone, log.

The reference is a plain list of what happened; converter codes are made from wanted deviations.
"""

from __future__ import annotations

import random
from typing import Any, TypeAlias

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge

from fluxlock.base.paths import ROOT
from fluxlock.cosim.block import run_block_test

Dut: TypeAlias = Any  # handles are found by name at run time
PHASE, DC, PIN, LOST, OVER, UNDER, SOFT, DEADLINE = (1 << i for i in range(8))
ALL = 0xFF
CHANNELS = 9
MIDDLE = 2048
# Clock edges until the gates are off, with the guard: published by the pages.
CODE_TO_OFF = 2
PIN_TO_OFF = 3
PULSE_TO_OFF = 1
LOG_IDC, LOG_VDC = 6, 7
PULSES = {"lost_i": LOST, "software_i": SOFT, "deadline_i": DEADLINE}
QUIET = [100, 200, 300, MIDDLE, MIDDLE, MIDDLE, 2000, MIDDLE, 50]  # v0..2, i0..2, vdc, idc, vsm


def code_of(deviation: int, rng: random.Random) -> int:
    """Code of this deviation from the middle, of either sign; 2048 is there downwards only."""
    return MIDDLE + (deviation if rng.random() < 0.5 and deviation < MIDDLE else -deviation)


class TripTb:
    def __init__(self, dut: Dut) -> None:
        self.dut = dut

    async def start(self, **settings: int) -> None:
        inputs = {
            "rst_i": 1, "adc_valid_i": 0, "adc_code_i": 0, "fault_pin_i": 0, "lost_i": 0, "software_i": 0,
            "deadline_i": 0, "guard_enable_i": 0, "cfg_enable_i": ALL, "cfg_phase_lsb_i": 1000, "cfg_dc_lsb_i": 500,
            "cfg_over_lsb_i": 3000, "cfg_under_lsb_i": 1000, "clear_i": 0, "log_index_i": 0, "req_h_i": 7,
            "req_l_i": 0, "dead_time_i": 2, "cfg_short_i": 0, "never_i": 0,
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

    async def pulse(self, *names: str) -> None:
        for name in names:
            getattr(self.dut, name).value = 1
        await self.clocks(1)
        for name in names:
            getattr(self.dut, name).value = 0

    async def hold(self, cause: int) -> None:
        """From now on this cause alone is present; 0: none."""
        for name, bit in PULSES.items():
            getattr(self.dut, name).value = int(cause == bit)
        self.dut.fault_pin_i.value = int(cause == PIN)
        codes = {PHASE: {"c4": 0}, DC: {"c7": 4095}, OVER: {"c6": 4000}, UNDER: {"c6": 500}}
        await self.sample(**codes.get(cause, {}))
        await self.clocks(4)

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
        assert edges == CODE_TO_OFF, f"{channel} = {bad}: gates off {edges} clocks after valid"
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
async def codes_against_random_limits(dut: Dut) -> None:
    """Limits of any value; codes that lie at them, beside them, or differ from them in a single bit."""
    rng = random.Random(11)
    tb = TripTb(dut)
    await tb.start()
    steps = [0, 1, -1, *(sign << bit for bit in range(12) for sign in (-1, 1))]

    def beside(value: int, low: int, high: int) -> int:
        return min(max(value + rng.choice(steps), low), high)

    for _ in range(1500):
        phase, dc = rng.randrange(4096), rng.randrange(4096)
        over, under = rng.randrange(4096), rng.randrange(4096)
        currents = [rng.randrange(min(phase, MIDDLE) + 1) for _ in range(3)]
        currents[rng.randrange(3)] = beside(phase, 0, MIDDLE)
        vdc, idc = beside(rng.choice([over, under]), 0, 4095), beside(dc, 0, MIDDLE)
        dut.cfg_phase_lsb_i.value, dut.cfg_dc_lsb_i.value = phase, dc
        dut.cfg_over_lsb_i.value, dut.cfg_under_lsb_i.value = over, under
        await tb.sample(**{f"c{3 + x}": code_of(c, rng) for x, c in enumerate(currents)}, c6=vdc, c7=code_of(idc, rng))
        expected = PHASE * (max(currents) > phase) | DC * (idc > dc) | OVER * (vdc > over) | UNDER * (vdc < under)
        assert tb.get("present_o") == expected, f"{currents}, {phase}; {idc}, {dc}; {vdc}, {over}, {under}"


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
            assert (tb.gates() == 0) == (edge >= PIN_TO_OFF), f"pin pulse of {width} clocks, edge {edge}"
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
    for name, cause in PULSES.items():
        await tb.pulse(name)
        await tb.clocks(PULSE_TO_OFF - 1)
        assert tb.gates() == 0, f"{name}: gates on after {PULSE_TO_OFF} edges"
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
    await tb.clocks(PULSE_TO_OFF)
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
    await tb.clocks(2)
    assert tb.get("count_o") == 2
    await tb.pulse("software_i")  # known already: no new trip
    await tb.clocks(2)
    assert tb.get("first_o") == PHASE | DC and tb.get("count_o") == 2
    assert await tb.clear() == PHASE | DC
    assert tb.get("first_o") == PHASE | DC
    await tb.sample()
    assert await tb.clear() == 0
    assert tb.get("first_o") == 0
    count = 2
    for name, cause in PULSES.items():
        await tb.pulse(name)
        count += 1
        await tb.clocks(2)
        assert tb.get("first_o") == cause and tb.get("count_o") == count
        assert await tb.clear() == 0
        assert tb.get("first_o") == 0
    # A cause that a clear finds present is the first since then.
    for bit in range(8):
        other = "lost_i" if 1 << bit == SOFT else "software_i"
        await tb.pulse(other)
        await tb.hold(1 << bit)
        assert tb.get("first_o") == PULSES[other]
        for _ in range(2):
            assert await tb.clear() == 1 << bit
            assert tb.get("first_o") == 1 << bit
        await tb.hold(0)
        assert await tb.clear() == 0
        assert tb.get("first_o") == 0
        count += 2
    for _ in range(300):
        await tb.pulse("lost_i")
        count = min(count + 1, 255)  # saturates
        assert tb.get("count_o") == count and tb.get("first_o") == LOST
        await tb.clear()


@cocotb.test()
async def log_of_eight(dut: Dut) -> None:
    """Random trips: the log holds the last eight with time, causes, and the channel that tells most of them.

    Deviations are apart, equal, or differ in a single bit. What trips is said by the limits: of each code that is
    to trip it lies one below, of the others at the code.
    """
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

    def draw() -> list[int]:
        largest = rng.choice([rng.randrange(1, MIDDLE), rng.randrange(1, MIDDLE), MIDDLE])
        second = rng.choice([largest, largest % MIDDLE ^ 1 << rng.randrange(11), rng.randrange(1, MIDDLE)])
        deviations = [largest, second, rng.choice([largest, second, rng.randrange(max(largest, second) + 1)])]
        rng.shuffle(deviations)
        return [code_of(deviation, rng) for deviation in deviations]

    await check()
    for _ in range(800):
        codes = draw()
        largest = max(range(3), key=lambda x: abs(codes[x] - MIDDLE))
        pulses = rng.sample(sorted(PULSES), rng.choice([0, 0, 1, 2, 3]))
        cause = sum(PULSES[name] for name in pulses) or rng.choice(
            [PHASE, DC, PHASE | DC, PHASE | OVER, UNDER, DC | OVER, OVER]
        )
        links = {OVER: (3001, 4096), UNDER: (0, 1000)}
        vdc = rng.randrange(*links.get(cause & (OVER | UNDER), (1000, 3001)))
        idc = code_of(rng.randrange(501, MIDDLE + 1) if cause & DC else rng.randrange(501), rng)
        dut.cfg_phase_lsb_i.value = abs(codes[largest] - MIDDLE) - bool(cause & PHASE)
        await tb.sample(**{f"c{3 + x}": c for x, c in enumerate(codes)}, c6=vdc, c7=idc)
        if pulses:
            await tb.clocks(rng.randrange(4))
        # A pulse is stamped with its clock, a code with the clock after its valid: both are `now` here.
        stamp = tb.get("now_o")
        if pulses:
            await tb.pulse(*pulses)
        channel = largest, codes[largest]
        if not cause & PHASE and cause & DC:
            channel = LOG_IDC, idc
        elif not cause & PHASE and cause & (OVER | UNDER):
            channel = LOG_VDC, vdc
        entries.append((stamp, cause, *channel))
        await tb.clocks(1)
        await tb.sample()
        assert await tb.clear() == 0
        await check()


@cocotb.test()
async def reset_forgets_all(dut: Dut) -> None:
    """After trips by every source and a full log: nothing latched, present, counted or logged."""
    tb = TripTb(dut)
    await tb.start()
    await tb.sample(c3=0, c6=4000, c7=0)
    await tb.pulse(*PULSES)
    for _ in range(10):
        await tb.clear()
        await tb.pulse(*PULSES)
    await tb.sample(c3=0, c6=500, c7=0)
    dut.fault_pin_i.value = 1
    await tb.clocks(5)
    assert tb.get("latched_o") == ALL and tb.get("log_valid_o") == 1
    await tb.sample(c3=0, c6=4000, c7=0)
    for vdc, cause in ((4000, OVER), (500, UNDER)):
        await tb.sample(c3=0, c6=vdc, c7=0)
        await tb.clear()
        assert tb.get("present_o") == PHASE | DC | PIN | cause
        dut.rst_i.value, dut.deadline_i.value = 1, 1
        dut.cfg_enable_i.value = 0  # a register, reset too
        await tb.clocks(1)
        assert tb.get("event_o") == 0 and tb.get("first_o") == 0
        dut.deadline_i.value = 0
        await tb.clocks(1)
        dut.rst_i.value = 0
        names = ("present_o", "latched_o", "first_o", "count_o", "event_o", "trip_o", "log_valid_o")
        assert [tb.get(name) for name in names] == [0] * len(names)
        for index in range(8):
            dut.log_index_i.value = index
            await tb.clocks(1)
            assert tb.get("log_valid_o") == 0, f"entry {index} is valid after the reset"
        await tb.sample(c3=0, c6=vdc, c7=0)
        await tb.pulse(*PULSES)
        await tb.clocks(5)
        assert tb.get("latched_o") == 0 and tb.get("present_o") == PHASE | DC | PIN | cause
        dut.cfg_enable_i.value = ALL


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
    assert tb.get("log_cause_o") == PIN


def test_fl_trip() -> None:
    """Trip block test, with the guard.

    Verifies: SAFE-07, SAFE-08, SAFE-09, SAFE-10, SAFE-11, SAFE-12
    """
    run_block_test(
        "fl_safety_chain",
        [
            "common/fl_sync.sv",
            "safety/fl_trip.sv",
            "safety/fl_gate_guard.sv",
            ROOT / "cocotb_tests" / "safety" / "fl_safety_chain.sv",
        ],
        __name__,
    )
