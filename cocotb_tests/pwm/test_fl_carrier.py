"""Carrier: widths, carry, shadowing, commutation patterns and the minimum-pulse rule.

The oracle counts clocks of the recorded pulse; a carrier of n clocks owes min(duty, n).
No internal state is read.
"""

from __future__ import annotations

import random

import cocotb
import numpy as np
import pytest

from cocotb_tests.pwm.carrier_model import levels, owed, planned
from cocotb_tests.pwm.chain import (
    COMM_TO_GATE,
    CSC,
    H_ON_L_PWM,
    H_PWM_L_ON,
    NSC,
    ON_PWM,
    PWM_ON,
    RSC,
    SOURCES,
    Chain,
    Drive,
    Dut,
    add,
    carriers,
    pulse,
    runs,
    schedule,
)
from fluxlock.cosim.block import run_block_test

PERIOD = 100
PATTERNS = (RSC, NSC, CSC)


@cocotb.test()
async def fraction_carries_over(dut: Dut) -> None:
    tb = Chain(dut)
    await tb.start(period=PERIOD)
    for duty_q8 in (
        30 * 256,
        30 * 256 + 1,
        30 * 256 + 64,
        30 * 256 + 128,
        47 * 256 + 255,
        1 * 256,
        94 * 256 + 200,
    ):
        await tb.update(duty_q8=duty_q8)
        await tb.run(2 * PERIOD, {})
        rows = carriers(await tb.run(40 * PERIOD, {}))
        duty = duty_q8 / 256
        assert {n for _, n, _ in rows} == {PERIOD}
        widths = [on for _, _, on in rows]
        assert set(widths) <= {int(duty), int(duty) + 1}, f"duty {duty}: widths {set(widths)}"
        error = np.cumsum([w - duty for w in widths])
        assert np.ptp(error) <= 255 / 256, f"duty {duty}: accumulated error spans {np.ptp(error)} clocks"


def draw_duty(rng: random.Random, length: int, minimum: int) -> int:
    """Q16.8, of any size or at the limits of the minimum-pulse rule."""
    whole, rule = length << 8, minimum + 1 << 8
    ends = [0, whole - 1, whole, 0xFFFFFF, rng.randrange(rule), whole - 1 - rng.randrange(rule)]
    return rng.choice([rng.randrange(whole), rng.randrange(whole), 1 << rng.randrange(24), *rng.sample(ends, 2)])


@cocotb.test()
async def any_period_duty_and_minimum(dut: Dut) -> None:
    """Settings of all their bits: length, on-time and count of changes of every carrier.

    What is owed follows from what was measured. Where pulse or duty reach into the last clocks of a carrier, the next
    pulse may differ by those clocks.
    """
    dut._log.info("seed %d", cocotb.RANDOM_SEED)
    rng = random.Random(cocotb.RANDOM_SEED)
    tb = Chain(dut)
    await tb.start(period=PERIOD)
    await align(tb, PERIOD)
    await tb.skip(2)
    row = await tb.run(1, {})
    at, dropped, changed = tb.now - 1, int(row.dropped[0]), 0  # at: clock 2 of the running carrier
    length, duty, minimum, owed, late = PERIOD, 0, 0, 0, 0
    bits = [*range(6, 12), *range(6, 16)]
    for period in [0xFFFF, 0x5555, 0xAAAA, *(rng.randrange(1 << b, 2 << b) for b in bits)]:
        new_minimum = rng.choice(
            [0, 1 << rng.randrange(12), rng.randrange(4096), *[period // rng.randrange(17, 99)] * 3]
        )
        new_length = max(period, 4 * new_minimum)
        new_duty = draw_duty(rng, new_length, new_minimum)
        for carrier in range(4):
            if carrier == 0:
                await tb.update(period=period, duty_q8=new_duty, min_pulse=new_minimum)
            at += length
            await tb.skip(at - tb.now)
            row = await tb.run(1, {})
            on = int(row.last_on[0])
            where = f"period {length}, duty {duty / 256}, minimum {minimum}, owed {owed / 256}: {on} clocks"
            assert (int(row.count[0]), int(row.last_length[0])) == (2, length), where
            plans = {planned(length, duty, minimum, owed + (d << 8)) for d in range(-late, late + 1)}
            assert on in plans, f"{where}, not one of {sorted(plans)}"
            pinned = duty == 0 or duty >> 8 >= length
            assert changed == (not pinned and on in (0, length)), f"{where}: {changed} changes counted"
            changed, dropped = (int(row.dropped[0]) - dropped) % 65536, int(row.dropped[0])
            late = 4 if max(on, duty >> 8) > length - 4 else 0
            owed = 0 if pinned else owed + duty - (on << 8)
            length, duty, minimum = new_length, new_duty, new_minimum


@cocotb.test()
async def any_minimum_before_a_commutation(dut: Dut) -> None:
    """NSC, a commutation after a carrier's start: the pulse begins there if it gets its minimum, else with it.

    A commutation that is far ahead holds nothing back, one that is overdue does.
    """
    tb = Chain(dut)
    await tb.start(period=PERIOD, commutation=NSC)
    await align(tb, PERIOD)
    start, length = tb.now, PERIOD

    async def announced(instant: int, ahead: int) -> int:
        """Level of the pulse at the start of the next carrier, with a commutation announced for that time after it.

        ahead: clocks before the start at which it is announced.
        """
        nonlocal start
        start += length
        await tb.skip(start - ahead - tb.now)
        await tb.run(1, {0: {"sched_valid_i": 1, "comm_sched_i": (start + instant) % (1 << 32)}})
        await tb.skip(start - tb.now)
        row = await tb.run(1, {})
        assert row.start[0] == 1
        return int(row.pulse[0])

    for minimum in (*(1 << bit for bit in range(2, 12)), 0x555, 0xAAA, 0xFFF):
        await tb.update(period=4 * minimum + 48, min_pulse=minimum, duty_q8=2 * minimum << 8)
        start += length
        await tb.skip(start - tb.now)
        length = 4 * minimum + 48
        for lasts in (minimum - 1, minimum):
            # pulse_o changes a clock before the gates.
            assert await announced(lasts + 1, 3 * minimum) == (lasts == minimum), f"{lasts} clocks of {minimum}"
            await tb.skip(lasts - 2)
            drive: Drive = {0: {"comm_valid_i": 1}, 1: {"comm_valid_i": 0, "sched_valid_i": 0}}
            trace = await tb.run(3, drive)
            assert trace.pulse.tolist() == [lasts == minimum, 1, 1], f"{lasts} clocks of {minimum}"
    await tb.update(period=64, min_pulse=4, duty_q8=20 << 8)
    start += length
    await tb.skip(start - tb.now)
    length = 64
    for bit in range(5, 31):
        for sign in (1, -1):
            assert await announced(sign << bit, 8) == (sign > 0), f"announced for {sign << bit} clocks after the start"
            await tb.run(1, {0: {"sched_valid_i": 0}})


@cocotb.test()
async def pulse_is_at_the_start(dut: Dut) -> None:
    tb = Chain(dut)
    await tb.start(period=PERIOD, duty_q8=37 * 256)
    trace = await tb.run(10 * PERIOD, {})
    assert np.array_equal(trace.pulse, (trace.count < 37).astype(int))
    assert np.array_equal(trace.start, (trace.count == 0).astype(int))


@cocotb.test()
async def extremes_have_no_edges(dut: Dut) -> None:
    tb = Chain(dut)
    await tb.start(period=PERIOD, min_pulse=10)
    for duty_q8, level in ((0, 0), (PERIOD * 256, 1), (0, 0), (0xFFFFFF, 1), (45 * 256 + 7, None), (0, 0)):
        await tb.update(duty_q8=duty_q8)
        drive: Drive = {}
        pulse(drive, [537, 911, 1350], "comm_valid_i")
        trace = await tb.run(20 * PERIOD, drive)
        if level is not None:
            tail = trace.pulse[2 * PERIOD :]
            assert np.all(tail == level), f"duty {duty_q8}: {np.count_nonzero(tail != level)} clocks off {level}"
            edges = np.count_nonzero(np.diff(trace.pulse))
            assert edges <= (1 if level else 2), f"duty {duty_q8}: {edges} edges after the change"


@cocotb.test()
@cocotb.parametrize(duty_clocks=[0.5, 3.25, 9.99, 10, 11.5, 88.5, 89.75, 90, 90.5, 95.125, 99.5])
async def minimum_pulse_and_gap(dut: Dut, duty_clocks: float) -> None:
    tb = Chain(dut)
    await tb.start(period=PERIOD, min_pulse=10, duty_q8=round(duty_clocks * 256))
    trace = await tb.run(120 * PERIOD, {})
    lengths = [n for _, _, n in runs(trace.pulse)]
    assert lengths and min(lengths) >= 10, f"shortest stretch {min(lengths, default=0)} clocks"
    error = owed(trace, round(duty_clocks * 256) / 256)
    # What is held back stays below one minimum pulse; the plan is made up to 4 clocks before its carrier.
    assert np.ptp(error) <= 10 + 4 + 1, f"volt-seconds wander by {np.ptp(error)} clocks"
    dropped = (trace.dropped[-1] - trace.dropped[0]) % 65536
    assert (dropped > 0) == (duty_clocks < 10 or duty_clocks > 90), f"{dropped} pulses counted as changed"


@cocotb.test()
async def settings_wait_for_update_and_carrier_start(dut: Dut) -> None:
    tb = Chain(dut)
    await tb.start(period=PERIOD, duty_q8=40 * 256)
    await align(tb, PERIOD)
    trace = await tb.run(5 * PERIOD, {10: {"cfg_duty_q8_i": 60 * 256, "cfg_period_i": 150, "cfg_min_pulse_i": 30}})
    assert {(n, on) for _, n, on in carriers(trace)} == {(PERIOD, 40)}, "changed without update"
    for lead in range(1, 12):
        new_period, new_duty = (150, 60) if lead % 2 else (PERIOD, 40)
        old_period, old_duty = (PERIOD, 40) if lead % 2 else (150, 60)
        await align(tb, old_period)
        drive: Drive = {0: {"cfg_duty_q8_i": new_duty * 256, "cfg_period_i": new_period, "cfg_min_pulse_i": 5}}
        pulse(drive, [old_period - lead], "update_i")
        rows = [(n, on) for _, n, on in carriers(await tb.run(5 * 150 + 1, drive))]
        old_carriers = 1 if lead >= 4 else 2  # the update needs 4 clocks to reach a carrier start
        expected = [(old_period, old_duty)] * old_carriers + [(new_period, new_duty)] * (len(rows) - old_carriers)
        assert rows == expected, f"update {lead} clocks before the carrier start: {rows}"


async def align(tb: Chain, period: int) -> None:
    """Run to just before the first clock of a carrier, so that element 0 of the next run is that clock."""
    trace = await tb.run(1, {})
    while not trace.start[0]:
        trace = await tb.run(1, {})
    await tb.run(period - 1, {})


@cocotb.test()
async def period_is_raised_to_four_minimum_pulses(dut: Dut) -> None:
    tb = Chain(dut)
    await tb.start(period=PERIOD, duty_q8=50 * 256, min_pulse=5)
    await tb.update(period=60, min_pulse=30)
    await tb.run(300, {})
    assert {n for _, n, _ in carriers(await tb.run(1000, {}))} == {120}
    await tb.update(period=0, min_pulse=0, duty_q8=256)
    await tb.run(300, {})
    assert {(n, on) for _, n, on in carriers(await tb.run(100, {}))} == {(4, 1)}
    before = 4
    for period in (1 << bit for bit in range(2, 16)):
        await tb.update(period=period)
        await tb.skip(before + period + 8)
        length = int((await tb.run(1, {})).last_length[0])
        assert length == period, f"{length} clocks for a period of {period}"
        before = period


@cocotb.test()
@cocotb.parametrize(pattern=[RSC, NSC, CSC])
async def commutation_instant(dut: Dut, pattern: int) -> None:
    """Unannounced commutations at every phase of the carrier."""
    tb = Chain(dut)
    await tb.start(period=PERIOD, duty_q8=40 * 256, commutation=pattern, min_pulse=8)
    cycle, comms = 50, []
    drive: Drive = {}
    for phase in range(PERIOD + 1):
        cycle += 3 * PERIOD + (phase if pattern == CSC else 1)
        comms.append(cycle)
    pulse(drive, comms, "comm_valid_i")
    trace = await tb.run(cycle + 3 * PERIOD, drive)
    applied = np.flatnonzero(trace.comm_applied)
    starts = np.flatnonzero(trace.start)
    assert len(applied) == len(comms)
    assert np.count_nonzero(np.diff(trace.sector)) == len(comms)
    phases = {int(trace.count[c]) for c in comms}
    assert phases == set(range(PERIOD)), "the stimulus does not cover every phase"
    if pattern == RSC:
        for c, a in zip(comms, applied, strict=True):
            assert a == starts[starts > c][0], f"commutation at {c} applied at {a}, not at the next carrier start"
    else:
        assert np.array_equal(applied, np.array(comms) + 1), "sector register not one clock after comm_valid_i"
        assert np.all(np.diff(trace.sector)[np.array(comms)] != 0)
        # Gates: the switch that the new sector adds to the old one turns on two clocks after comm_valid_i.
        for c in comms:
            assert trace.gate[c + COMM_TO_GATE - 1] != trace.gate[c + COMM_TO_GATE], f"no gate change for {c}"
            assert trace.state_sector[c + COMM_TO_GATE] == trace.sector[c + 1] != trace.state_sector[c + 1]
            assert trace.comm_age[c + COMM_TO_GATE] == 0
    if pattern == CSC:
        assert np.all(trace.count[applied] == 0) and np.all(trace.start[applied] == 1)
        assert np.all(trace.pulse[applied] == 1), "no new pulse at a commutation"
    else:
        assert set(np.diff(starts).tolist()) == {PERIOD}, "a commutation moved the carrier"


@cocotb.test()
@cocotb.parametrize(pattern=[RSC, NSC, CSC], chop=[ON_PWM, H_PWM_L_ON, PWM_ON, H_ON_L_PWM])
async def look_ahead(dut: Dut, pattern: int, chop: int) -> None:
    """Random scheduled commutations: no short pulse or gap, none is delayed, volt-seconds return."""
    rng = random.Random(1000 * pattern + chop)
    tb = Chain(dut)
    minimum = 12
    await tb.start(period=PERIOD, commutation=pattern, pattern=chop, min_pulse=minimum)
    shortest = PERIOD + minimum if pattern == RSC else 4 * minimum
    cut_too_short = 0
    for reverse in (0, 1):
        for _ in range(6):
            duty_q8 = rng.choice(
                [rng.randrange(PERIOD * 256), rng.randrange(30 * 256), rng.randrange(80 * 256, PERIOD * 256)]
            )
            await tb.update(duty_q8=duty_q8, reverse=reverse)
            await tb.run(2 * PERIOD, {})
            drive: Drive = {}
            instants, t = [], 100
            while t < 6000:
                instants.append(t)
                # Known just in time for the rule, or long before.
                known = t - rng.choice([minimum + 2, shortest - 6, shortest // 2])
                schedule(drive, tb.now, t, max(known, t - shortest + 2), rng.random() < 0.5)
                t += rng.choice([rng.randrange(shortest, 5 * PERIOD), shortest + rng.randrange(40)])
            trace = await tb.run(6000 + PERIOD, drive)
            applied = np.flatnonzero(trace.comm_applied)
            assert len(applied) == len(instants)
            if pattern != RSC:
                assert np.array_equal(applied, np.array(instants) - COMM_TO_GATE + 1), "a commutation was moved"
            where = f"duty {duty_q8 / 256}, reverse {reverse}"
            for x in range(3):
                for upper in (True, False):
                    for level, first, length in runs(trace.switch(x, upper)):
                        assert length >= minimum, (
                            f"{where}: leg {x}, upper {upper}, is {level} for {length} clocks at {first}"
                        )
            error = owed(trace, duty_q8 / 256)
            assert np.ptp(error) <= PERIOD + 1, f"{where}: volt-seconds wander by {np.ptp(error)} clocks"
            cut_too_short += sum(n < minimum + 1 for _, n, _ in carriers(trace))
    if pattern == CSC:
        assert cut_too_short > 10, "the stimulus never came to the rule"


@cocotb.test()
@cocotb.parametrize(
    pattern=[NSC, CSC], stamp=[0x5555_5555, 0xAAAA_AAAA, 0x8000_0000 - 3 * PERIOD, 0x1_0000_0000 - 3 * PERIOD]
)
async def held_back_pulse_returns(dut: Dut, pattern: int, stamp: int) -> None:
    """A commutation shortly after every carrier start: nothing short is started, and the mean is exact.

    stamp: time at the beginning, so that time stamps have all their bits and pass their largest value.
    """
    tb = Chain(dut)
    minimum, duty = 12, 30
    await tb.start(period=PERIOD, commutation=pattern, min_pulse=minimum, duty_q8=duty * 256)
    dut.now.value = tb.now = stamp
    trace = await tb.run(PERIOD, {})
    first = int(np.flatnonzero(trace.start)[0]) + 0  # the next carriers start at first + k * PERIOD
    drive: Drive = {}
    instants = []
    if pattern == NSC:
        instants = [first + k * PERIOD + 5 + COMM_TO_GATE for k in range(2, 40, 3)]
    else:
        t = first + 2 * PERIOD
        for _ in range(13):
            t += 3 * PERIOD + 5  # a carrier of five clocks before every commutation
            instants.append(t)
    for t in instants:
        schedule(drive, tb.now, t, t - 60, True)
    trace = await tb.run(50 * PERIOD, drive)
    assert min(n for _, _, n in runs(trace.pulse)) >= minimum
    error = owed(trace, duty)
    assert np.ptp(error) <= minimum, f"volt-seconds wander by {np.ptp(error)} clocks"
    dropped = (trace.dropped[-1] - trace.dropped[0]) % 65536
    assert dropped == len(instants), f"{dropped} changes counted for {len(instants)} pulses held back"


@cocotb.test()
@cocotb.parametrize(duty=[0, 14, 40, 88, PERIOD])
async def commutation_at_any_clock(dut: Dut, duty: int) -> None:
    """NSC, one announced commutation in a carrier: every clock of its pulse, and the changes counted."""
    tb = Chain(dut)
    minimum = 12
    await tb.start(period=PERIOD, commutation=NSC, min_pulse=minimum, duty_q8=duty << 8)
    await align(tb, PERIOD)
    ends = {minimum, duty, duty - minimum, duty + minimum, PERIOD - minimum}
    near = {end + d for end in ends for d in (-1, 0, 1)}
    for p in sorted({0, 2, 50, 70, PERIOD - 1, *(p for p in near if 2 <= p < PERIOD)}):
        drive: Drive = {}
        # The clock before pulse_o changes is that of comm_valid_i.
        schedule(drive, tb.now, PERIOD + p - 1 + COMM_TO_GATE, PERIOD + p - 3 * minimum, True)
        trace = await tb.run(2 * PERIOD + 2, drive)
        expected, changes = levels(PERIOD, duty, minimum, p)
        found = trace.pulse[PERIOD : 2 * PERIOD].tolist()
        wrong = [c for c in range(PERIOD) if found[c] != expected[c]]
        assert not wrong, f"duty {duty}, commutation at {p}: clocks {wrong} differ"
        counted = (trace.dropped[2 * PERIOD] - trace.dropped[PERIOD]) % 65536
        assert counted == changes, f"duty {duty}, commutation at {p}: {counted} changes counted, not {changes}"
        await tb.skip(6 * PERIOD - 2)  # what is owed has returned


@cocotb.test()
@cocotb.parametrize((("duty", "at", "on"), [(88, PERIOD - 5, 12), (PERIOD, PERIOD + 6, 6)]))
async def pulse_runs_into_a_carrier_without_one(dut: Dut, duty: int, at: int, on: int) -> None:
    """Duty set to 0 while the pulse is on at a carrier's end, because of a commutation at clock `at` (NSC).

    Begun early at a commutation, it gets its minimum in the next carrier; held on over the carrier's start for a
    commutation that follows, it ends there.
    """
    tb = Chain(dut)
    minimum = 12
    await tb.start(period=PERIOD, commutation=NSC, min_pulse=minimum, duty_q8=duty << 8)
    await align(tb, PERIOD)
    drive: Drive = {}
    add(drive, 60, cfg_duty_q8_i=0)
    pulse(drive, [60], "update_i")
    schedule(drive, tb.now, at - 1 + COMM_TO_GATE, at - 3 * minimum, True)
    trace = await tb.run(3 * PERIOD, drive)
    wrong = np.flatnonzero(trace.pulse != (np.arange(3 * PERIOD) < PERIOD + on))
    assert not wrong.size, f"clocks {wrong.tolist()} differ"


@cocotb.test()
async def changes_are_counted_beyond_16_bits(dut: Dut) -> None:
    """Duty of 1/256 clock: 255 of 256 pulses are too short, the count of them wraps."""
    tb = Chain(dut)
    await tb.start(period=4, min_pulse=1, duty_q8=1)
    first = await tb.run(1, {})
    for pulses in (1 << bit for bit in range(8, 17)):
        await tb.skip(4 * pulses - 1)
        row = await tb.run(1, {})
        counted = (int(row.dropped[0]) - int(first.dropped[0])) % 65536
        assert abs(counted - pulses * 255 // 256) <= 1, f"{counted} changes in {pulses} carriers"
        first = row


@cocotb.test()
@cocotb.parametrize((("pattern", "duty"), [(NSC, 80), (RSC, 40)]))
async def reset_clears_everything(dut: Dut, pattern: int, duty: int) -> None:
    """One clock of reset: no pulse, count from 0, nothing counted or owed, then period 65535 until an update."""
    tb = Chain(dut)
    await tb.start(period=PERIOD, commutation=pattern, min_pulse=12, duty_q8=duty << 8)
    await align(tb, PERIOD)
    drive: Drive = {}
    # NSC: the pulse goes on for a commutation that is overdue, and much is owed. RSC: a commutation waits.
    add(drive, 50, sched_valid_i=1, comm_sched_i=tb.now + 50)
    pulse(drive, [2 * PERIOD + 10], "comm_valid_i")
    add(drive, 2 * PERIOD + 20, rst_i=1)
    add(drive, 2 * PERIOD + 21, rst_i=0, sched_valid_i=0)
    trace = await tb.run(5 * PERIOD, drive)
    after = slice(2 * PERIOD + 21, None)
    assert not (trace.pulse | trace.start | trace.dropped | trace.apply)[after].any()
    assert trace.count[after].tolist() == list(range(3 * PERIOD - 21))
    await tb.update(commutation=CSC, period=PERIOD, duty_q8=30 << 8, min_pulse=0)
    drive = {}
    pulse(drive, [8], "comm_valid_i")
    rows = carriers(await tb.run(6 * PERIOD, drive))
    assert [(n, on) for _, n, on in rows] == [(PERIOD, 30)] * len(rows), f"carriers after a reset: {rows}"


@cocotb.test()
async def carry_is_bounded(dut: Dut) -> None:
    """A duty that the rule makes impossible for long does not pile up more than one period."""
    tb = Chain(dut)
    await tb.start(period=PERIOD, commutation=CSC, min_pulse=20, duty_q8=15 * 256)
    drive: Drive = {}
    # A commutation announced forever and never issued: no pulse is started.
    add(drive, 0, sched_valid_i=1, comm_sched_i=tb.now)
    add(drive, 50 * PERIOD, sched_valid_i=0)
    trace = await tb.run(80 * PERIOD, drive)
    rows = carriers(trace)
    blocked = [on for a, _, on in rows if 2 * PERIOD < a < 49 * PERIOD]
    assert blocked and not any(blocked)
    extra = sum(on - 15 for a, _, on in rows if a > 50 * PERIOD)
    # One period at most; less than a minimum pulse of it may still be held back at the end.
    assert PERIOD - 20 - 4 <= extra <= PERIOD, f"{extra} clocks came back"
    # The other way: a pulse that does not end takes one period ahead at most. The carrier in which it ends owes the
    # 30 clocks after that, the next ones get less by the rest.
    await tb.update(duty_q8=50 * 256)
    await align(tb, PERIOD)
    drive = {}
    add(drive, 20, sched_valid_i=1, comm_sched_i=tb.now)
    add(drive, 20 * PERIOD + 20, sched_valid_i=0)
    rows = carriers(await tb.run(40 * PERIOD, drive))
    missing = sum(50 - on for a, _, on in rows if a > 20 * PERIOD)
    assert abs(missing - (PERIOD - 30)) <= 4, f"{missing} clocks were taken back"
    # A duty that needs no edges clears what is owed.
    for pinned in (0, PERIOD * 256):
        await tb.update(duty_q8=15 * 256)
        drive = {}
        add(drive, 0, sched_valid_i=1, comm_sched_i=tb.now)
        await tb.run(20 * PERIOD, drive)
        await tb.update(duty_q8=pinned)
        await tb.run(2 * PERIOD, {0: {"sched_valid_i": 0}})
        await align(tb, PERIOD)
        await tb.run(PERIOD // 2, {})
        await tb.update(duty_q8=15 * 256)
        rows = carriers(await tb.run(30 * PERIOD, {}))
        extra = sum(on - 15 for _, _, on in rows)
        assert abs(extra) <= 20, f"{extra} clocks came back after duty {pinned}"


def test_fl_carrier() -> None:
    """Carrier block test.

    Verifies: PWM-01, PWM-02, PWM-03, PWM-04, PWM-05, PWM-06, PWM-07, PWM-08, PWM-09
    """
    run_block_test("fl_pwm_chain", SOURCES, __name__)


if __name__ == "__main__":
    pytest.main([__file__])
