# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Leg carriers: pulses to the clock, shadow registers, deadline and enable.

The oracle works out every clock of the requests from the update strobes, the compares handed over and the definition of
a centred pulse; it has no counter of its own and reads no internal state.
"""

from __future__ import annotations

import random
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import cocotb
import numpy as np
import pytest
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, ReadOnly, Timer
from numpy.typing import NDArray

from cocotb_tests.pwm.chain import Drive, add
from fluxlock.cosim.block import run_block_test

VALID_TO_UPDATE = 3
MIN_PERIOD = 16
SIGNALS = (
    "update_o", "carrier_start_o", "second_o", "count_o", "active_o", "missed_o", "fault_o", "req_h_o", "req_l_o",
)  # fmt: skip
Levels = NDArray[np.int64]


@dataclass(frozen=True)
class Handed:
    """Compares handed over at a clock of a run."""

    clock: int
    period: int
    compares: tuple[int, ...]


class TB:
    """Clock, reset, hand-over of compares, and a record of all outputs."""

    def __init__(self, dut: Any) -> None:
        self.dut = dut
        self.phases = len(dut.compare_i.value) // 16

    async def start(self, **settings: int) -> None:
        inputs = {
            "enable_i": 1, "cfg_double_i": 0, "cfg_period_i": 100, "cfg_miss_limit_i": 0,
            "compare_valid_i": 0, "compare_i": 0, "period_i": 0, "rst_i": 1, **settings,
        }  # fmt: skip
        for name, value in inputs.items():
            getattr(self.dut, name).value = value
        Clock(self.dut.clk_i, 20, "ns").start()
        for _ in range(3):
            await FallingEdge(self.dut.clk_i)
        self.dut.rst_i.value = 0

    def hand_over(self, drive: Drive, handed: Handed) -> None:
        word = sum(c << (16 * x) for x, c in enumerate(handed.compares))
        add(drive, handed.clock, compare_valid_i=1, compare_i=word, period_i=handed.period)
        if drive.get(handed.clock + 1, {}).get("compare_valid_i") != 1:
            # Nothing but the clock of the valid may matter.
            add(drive, handed.clock + 1, compare_valid_i=0, compare_i=0x5A5A, period_i=77)

    async def skip(self, cycles: int) -> None:
        """Let clocks pass without a record."""
        if cycles:
            await Timer(20 * cycles - 10, "ns")
            await FallingEdge(self.dut.clk_i)

    async def to_start(self, limit: int = 200) -> None:
        """Wait for the first clock of a carrier."""
        for _ in range(limit):
            if int(self.dut.carrier_start_o.value):
                return
            await self.skip(1)
        raise AssertionError(f"no carrier started in {limit} clocks")

    def read(self) -> dict[str, int]:
        """All outputs now."""
        return {name: int(getattr(self.dut, name).value) for name in SIGNALS}

    async def run(self, cycles: int, drive: Drive) -> dict[str, Levels]:
        """Element i of the record: registers after i rising edges of this run, inputs of edge i + 1."""
        rows: list[list[int]] = []
        handles = [getattr(self.dut, name) for name in SIGNALS]
        for i in range(cycles):
            for name, value in drive.get(i, {}).items():
                getattr(self.dut, name).value = value
            await ReadOnly()
            rows.append([int(h.value) for h in handles])
            await FallingEdge(self.dut.clk_i)
        return dict(zip(SIGNALS, np.array(rows, dtype=np.int64).T, strict=True))


def leg(trace: Mapping[str, Levels], x: int, upper: bool = True) -> Levels:
    """Request of one switch."""
    return (trace["req_h_o" if upper else "req_l_o"] >> x) & 1


def check(trace: Mapping[str, Levels], handed: list[Handed], period: int, phases: int) -> list[int]:
    """Compare every clock from the first update on with the definition; the updates that missed.

    handed: in the order of the clocks, none before the run; period: that in force before the first update.
    """
    updates = np.flatnonzero(trace["update_o"]).tolist()
    assert updates
    running: Handed | None = None
    missed: list[int] = []
    before = -1  # the last clock whose compares an earlier update could have taken
    for first, after in pairwise(updates):
        new = [h for h in handed if before < h.clock <= first - VALID_TO_UPDATE]
        before = first - VALID_TO_UPDATE
        if new:
            running = new[-1]
            period = max(MIN_PERIOD, running.period)
        elif running is not None:
            missed.append(first)
        start = int(trace["count_o"][first]) == 0
        assert bool(trace["carrier_start_o"][first]) == start
        lengths = [period // 2, period - period // 2]
        if not start:
            lengths = lengths[1:]
        whole = sum(lengths) == after - first
        assert whole or (start and lengths[0] == after - first), f"update at {first}: {after - first} clocks, {lengths}"
        clock = first
        for half, length in zip((0, 1) if start else (1,), lengths, strict=True):
            if clock == after:
                break
            part = slice(clock, clock + length)
            assert np.all(trace["second_o"][part] == half), f"half {half} at {clock}"
            for x in range(phases):
                level = np.zeros(length, dtype=np.int64)
                if running is not None:
                    on = min(length, (running.compares[x] + half) // 2)
                    if half:
                        level[:on] = 1
                    else:
                        level[length - on :] = 1
                    assert np.array_equal(leg(trace, x, False)[part], 1 - level), f"lower request, leg {x}, at {clock}"
                else:
                    assert not leg(trace, x, False)[part].any()
                assert np.array_equal(leg(trace, x)[part], level), f"upper request, leg {x}, at {clock}: {running}"
            clock += length
    counts = np.diff(trace["count_o"])
    starts = trace["carrier_start_o"][1:] == 1
    seen = np.flatnonzero(starts)
    assert np.all(counts[seen[0] + 1 :][~starts[seen[0] + 1 :]] == 1) and np.all(trace["count_o"][1:][starts] == 0)
    return missed


@cocotb.test()
@cocotb.parametrize(double=[0, 1])
async def random_compares(dut: Any, double: int) -> None:
    """Random periods, compares and instants of hand-over, also none or several between two updates."""
    seed = cocotb.RANDOM_SEED + double
    dut._log.info("seed %d", seed)
    rng = random.Random(seed)
    tb = TB(dut)
    await tb.start(cfg_double_i=double, cfg_period_i=60)
    handed: list[Handed] = []
    drive: Drive = {}
    cycles, clock, period = 12000, 5, 60
    while clock < cycles - 5:
        if rng.random() < 0.3:
            period = rng.choice([0, 15, 16, 17, 18, 19, 64, 99, 100, 101, rng.randrange(20, 300)])
        compares = tuple(
            rng.choice(
                [0, 1, 2, 3, period // 2, max(0, period - 1), period, period + 1, 65535, rng.randrange(period + 1)]
            )
            for _ in range(tb.phases)
        )
        handed.append(Handed(clock, period, compares))
        tb.hand_over(drive, handed[-1])
        clock += rng.choice([1, 2, rng.randrange(1, 60), period // (1 + double) + rng.randrange(-2, 3), 2 * period + 1])
        clock = max(clock, handed[-1].clock + 1)
    trace = await tb.run(cycles, drive)
    missed = check(trace, handed, 60, tb.phases)
    assert len(missed) > 5, "the stimulus missed no deadline"
    counted = [int(trace["missed_o"][u + 1] - trace["missed_o"][u - 3]) & 0xFFFF for u in missed]
    assert set(counted) == {1}, f"misses counted {counted}"
    total = int(trace["missed_o"][-4] - trace["missed_o"][0])
    assert total in (len(missed), len(missed) + 1), f"{total} misses counted, {len(missed)} seen"


@cocotb.test()
@cocotb.parametrize(period=[16, 17, 50, 51])
async def every_width_is_exact(dut: Any, period: int) -> None:
    """Every compare of a period: that many clocks, centred to half a clock."""
    tb = TB(dut)
    await tb.start(cfg_period_i=period)
    handed = []
    drive: Drive = {}
    first = period - 4
    for k, c in enumerate(range(0, period + 2)):
        handed.append(Handed(first + k * period, period, tuple((c + 7 * x) % (period + 2) for x in range(tb.phases))))
        tb.hand_over(drive, handed[-1])
    trace = await tb.run(first + (period + 4) * period, drive)
    starts = np.flatnonzero(trace["carrier_start_o"])
    width = {int(c): int(leg(trace, 0)[c : c + period].sum()) for c in starts if c + period <= len(trace["update_o"])}
    assert list(width.values())[1 : period + 3] == [min(c, period) for c in range(period + 2)]
    for c, n in width.items():
        on = np.flatnonzero(leg(trace, 0)[c : c + period])
        if n:
            assert on[-1] - on[0] + 1 == n, "the pulse is not in one piece"
            centre = (on[0] + on[-1] + 1) / 2
            assert abs(centre - period / 2) <= 0.5, f"{n} clocks around {centre} in a carrier of {period}"
    check(trace, handed, period, tb.phases)


@cocotb.test()
async def long_carriers(dut: Any) -> None:
    """Periods and compares of all 16 bits; looked at where something changes, just before, and in between.

    In the first carriers nothing is enabled and cfg_period_i rules, then the period that comes with the compares.
    """
    dut._log.info("seed %d", cocotb.RANDOM_SEED)
    rng = random.Random(cocotb.RANDOM_SEED)
    tb = TB(dut)
    period = 40
    await tb.start(cfg_period_i=period, enable_i=0)
    await tb.to_start()
    compares: tuple[int, ...] | None = None
    single = [0, MIN_PERIOD - 1, *(1 << bit for bit in range(16))]
    several = [0xFFFF, 0x5555, 0xAAAA, *(rng.randrange(1 << bits, 2 << bits) for bits in range(8, 15))]
    disabled = [*single, *rng.sample(several, 4)]
    idle = len(disabled)
    for carrier, asked in enumerate([*disabled, *several, *single, *rng.sample(several, 3)]):
        new_period = max(MIN_PERIOD, asked)
        drawn = [rng.randrange(new_period), 1 << rng.randrange(16), new_period ^ 1 << rng.randrange(16)]
        new = tuple(rng.choice([*drawn, new_period, 0, 0xFFFF]) for _ in range(tb.phases))
        middle = period // 2
        edges = [0, middle, *(e for c in compares or () for e in (middle - c // 2, middle + (c + 1) // 2))]
        change = rng.randrange(1, period - 4)
        instants = {t + d for t in edges for d in (-1, 0)} | {change, change + 1, *rng.sample(range(period), 4)}
        clock = 0
        for t in sorted(t for t in instants if 0 <= t < period):
            await tb.skip(t - clock)
            clock = t
            got = tb.read()
            high = 0
            for x, c in enumerate(compares or ()):
                high |= (c >= period or middle - c // 2 <= t < middle + (c + 1) // 2) << x
            everyone = 0 if compares is None else (1 << tb.phases) - 1
            expected = (t == 0, t == 0, t >= middle, t, compares is not None, 0, 0, high, everyone & ~high)
            if (carrier, t > change) != (idle, True):  # active_o is a register before the requests
                assert tuple(got.values()) == expected, f"clock {t} of {period}, compares {compares}"
            if t == change and carrier < idle:
                dut.cfg_period_i.value = asked
            elif t == change:
                dut.enable_i.value = 1
                dut.compare_valid_i.value, dut.period_i.value = 1, asked
                dut.compare_i.value = sum(c << 16 * x for x, c in enumerate(new))
            elif t == change + 1:
                dut.compare_valid_i.value, dut.period_i.value, dut.compare_i.value = 0, rng.randrange(1 << 16), 0x5A5A
        await tb.skip(period - clock)
        period, compares = new_period, new if carrier >= idle else None


@cocotb.test()
async def every_bit_of_the_limit(dut: Any) -> None:
    """A fault at the limit's miss and not before, again after compares in between; the count of all misses goes on."""
    tb = TB(dut)
    period, total = MIN_PERIOD, 0
    await tb.start(cfg_period_i=period)

    async def compares() -> None:
        """In time for the next update, which is the last of tb.skip(period)."""
        drive: Drive = {}
        tb.hand_over(drive, Handed(0, period, (5,) * tb.phases))
        await tb.run(2, drive)
        await tb.skip(period - 2)

    await tb.to_start()
    await tb.skip(3)
    for limit in (1, 2, 3, 4, 8, 16, 32, 64, 85, 128, 170, 255, 0):
        dut.cfg_miss_limit_i.value = limit
        for misses in (limit - 1, limit) if limit else (300,):
            await compares()
            for miss in range(1, misses + 1):
                await tb.skip(period)
                total += 1
                got = int(dut.missed_o.value), int(dut.fault_o.value)
                assert got == (total, limit and miss >= limit), f"limit {limit}, {miss} misses: {got}"
        dut.enable_i.value = 0
        await tb.skip(1)
        dut.enable_i.value = 1
        await tb.skip(period - 1)
        assert int(dut.fault_o.value) == 0
    await compares()
    for chunk in (257, 1025, 4097, 8193, 20001, 1):  # odd, then two in a row: a bit may be wrong in every other
        await tb.skip(chunk * period)
        total += chunk
        assert int(dut.missed_o.value) == total


@cocotb.test()
@cocotb.parametrize(double=[0, 1])
async def deadline_to_the_clock(dut: Any, double: int) -> None:
    """Compares ValidToUpdateCycles before the update are in time, a clock later they wait for the next one."""
    tb = TB(dut)
    period = 100
    await tb.start(cfg_period_i=period, cfg_double_i=double)
    first = await tb.run(3, {})
    start = int(np.flatnonzero(first["carrier_start_o"])[0]) - 3  # clock of a carrier start in the next run
    step = period // (1 + double)
    for lead in range(1, 8):
        drive: Drive = {}
        middle = (30 + lead,) * tb.phases
        handed = [
            Handed(1, period, (50,) * tb.phases),
            Handed(start + 2 * period - lead, period, middle),
        ]
        for h in handed:
            tb.hand_over(drive, h)
        trace = await tb.run(4 * period, drive)
        u = start + 2 * period
        assert trace["carrier_start_o"][u]
        clocks = int(leg(trace, 0)[u : u + period // 2].sum())
        assert clocks == (15 + lead // 2 if lead >= VALID_TO_UPDATE else 25), f"lead {lead}: {clocks} clocks"
        after = int(leg(trace, 0)[u + step :][: period // 2].sum())
        assert after == (30 + lead + double) // 2, f"lead {lead}: {after} clocks after the next update"


@cocotb.test()
@cocotb.parametrize(limit=[0, 1, 2, 5])
async def fault_after_misses_in_a_row(dut: Any, limit: int) -> None:
    tb = TB(dut)
    period = 40
    await tb.start(cfg_period_i=period, cfg_miss_limit_i=limit)
    drive: Drive = {}
    # Compares for all but every second, then every third carrier and so on, at last for none.
    handed = []
    clock = 10
    for gap in (1, 2, 3, 4, 5, 6, 7):
        for _ in range(3):
            handed.append(Handed(clock, period, (11,) * tb.phases))
            clock += gap * period
    for h in handed:
        tb.hand_over(drive, h)
    trace = await tb.run(clock + 3 * period, drive)
    missed = check(trace, handed, period, tb.phases)
    row, fault_at = 0, None
    updates = np.flatnonzero(trace["update_o"]).tolist()
    for u in updates[2:]:
        row = row + 1 if u in missed else 0
        if limit and row >= limit and fault_at is None:
            fault_at = u
    fault = np.flatnonzero(trace["fault_o"])
    if not limit:
        assert not len(fault), "a fault without a limit"
        return
    assert fault_at is not None and len(fault)
    assert abs(int(fault[0]) - fault_at) <= 2, f"fault at {fault[0]}, the update of the last miss at {fault_at}"
    assert np.all(np.diff(fault) == 1) and fault[-1] == len(trace["fault_o"]) - 1, "the fault did not stay"
    trace = await tb.run(5, {0: {"enable_i": 0}})
    assert trace["fault_o"].tolist() == [1, 0, 0, 0, 0], "the fault must go with enable"


@cocotb.test()
async def enable_begins_fresh_and_ends_at_once(dut: Any) -> None:
    tb = TB(dut)
    period, phases = 50, tb.phases
    await tb.start(cfg_period_i=64, cfg_miss_limit_i=2, enable_i=0)
    drive: Drive = {}
    tb.hand_over(drive, Handed(20, period, (25,) * phases))  # while disabled: forgotten, its period too
    add(drive, 400, enable_i=1)
    trace = await tb.run(1000, drive)
    assert not trace["req_h_o"].any() and not trace["req_l_o"].any() and not trace["active_o"].any()
    assert not trace["missed_o"].any() and not trace["fault_o"].any(), "no deadline before the first compares"
    assert set(np.diff(np.flatnonzero(trace["carrier_start_o"]))) == {64}
    drive = {}
    tb.hand_over(drive, Handed(5, period, (25,) * phases))
    for clock in range(50, 420, 25):
        tb.hand_over(drive, Handed(clock, period, (25,) * phases))
    for off in (430,):
        add(drive, off, enable_i=0)
        tb.hand_over(drive, Handed(off - 1, period, (25,) * phases))
        add(drive, off + 1, enable_i=1, cfg_period_i=70)
    trace = await tb.run(900, drive)
    everyone = (1 << phases) - 1
    active = np.flatnonzero(trace["req_h_o"] | trace["req_l_o"])
    first = int(active[0])
    assert trace["carrier_start_o"][first], "requests begin with an update"
    assert np.all((trace["req_h_o"] ^ trace["req_l_o"])[first:431] == everyone)
    assert active[-1] == 430, "off in the clock after enable fell, and no old compares when it came back"
    starts = np.flatnonzero(trace["carrier_start_o"])
    lengths = np.diff(starts[starts >= first])
    assert set(lengths.tolist()) == {50, 70}, "after the end the carrier runs with cfg_period_i"


@cocotb.test()
async def double_update_is_taken_over_at_the_start(dut: Any) -> None:
    """A change of the mode at every phase of the carrier leaves the running carrier as it is."""
    tb = TB(dut)
    period = 24
    await tb.start(cfg_period_i=period)
    await tb.run(2 * period, {})
    mode = 0
    for phase in range(2 * period):
        change = period + phase
        old, mode = mode, 1 - mode
        trace = await tb.run(5 * period, {change: {"cfg_double_i": mode}})
        starts = np.flatnonzero(trace["carrier_start_o"]).tolist()
        assert set(np.diff(starts)) == {period}
        # The ramp is two clocks ahead of the ports.
        taken = [mode if start - 2 >= change else old for start in starts]
        expected = {s + period // 2 for s, double in zip(starts, taken, strict=True) if double}
        middles = {c for c in np.flatnonzero(trace["update_o"]).tolist() if c not in starts and c > starts[0]}
        assert middles == {e for e in expected if e < 5 * period}, f"change at {change}: {middles}, carriers {starts}"


@pytest.mark.parametrize("phases", [1, 3, 5])
def test_fl_leg_carrier(phases: int) -> None:
    """Leg carriers alone.

    Verifies: VPWM-01, VPWM-02, VPWM-03, VPWM-04, VPWM-05
    """
    run_block_test("fl_leg_carrier", ["pwm/fl_leg_carrier.sv"], __name__, parameters={"Phases": phases})


if __name__ == "__main__":
    pytest.main([__file__])
