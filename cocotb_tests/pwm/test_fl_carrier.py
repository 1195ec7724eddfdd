# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Carrier: widths, carry, shadowing, commutation alignments and the minimum-pulse rule.

The oracle counts clocks of the recorded pulse; a carrier of n clocks owes min(duty, n).
No internal state is read.
"""

from __future__ import annotations

import random

import cocotb
import numpy as np
import pytest

from cocotb_tests.pwm.carrier_model import owed, planned
from cocotb_tests.pwm.chain import (
    CSC,
    NSC,
    RSC,
    SOURCES,
    Chain,
    Drive,
    Dut,
    add,
    carriers,
    pulse,
    runs,
)
from fluxlock.cosim.block import run_block_test

PERIOD = 100
UPDATE_TO_CARRIER = 4  # least clocks from an update to the first carrier that has its period and duty
ALIGNMENTS = (RSC, NSC, CSC)


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
    await tb.align(PERIOD)
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
async def every_bit_of_the_fraction_counts(dut: Dut) -> None:
    """Duties of one bit below a clock in carriers of odd length: over many of them nothing is lost or gained."""
    tb = Chain(dut)
    await tb.start(period=9)
    for duty_q8 in (*(1 << bit for bit in range(8)), 0x255):
        await tb.update(duty_q8=duty_q8)
        await tb.run(4 * 9, {})
        rows = carriers(await tb.run(520 * 9, {}))
        error = np.cumsum([256 * on - duty_q8 for _, _, on in rows])
        assert np.ptp(error) <= 255, f"duty {duty_q8} / 256: accumulated error spans {np.ptp(error)} / 256 clocks"


@cocotb.test()
async def shortest_gap_at_any_period(dut: Dut) -> None:
    """A gap of the minimum is opened, one of a clock less is not and counts; a duty of the period has none, uncounted.

    The carriers of a whole period between the others clear what is owed.
    """
    tb = Chain(dut)
    await tb.start(period=PERIOD)
    await tb.align(PERIOD)
    await tb.skip(2)
    row = await tb.run(1, {})
    at, length = tb.now - 1, PERIOD  # at: clock 2 of the running carrier
    for period in (1 << bit for bit in range(7, 16)):
        minimum = period // 16
        for duty, on, counted in (
            (period, period, 0),
            (period - minimum + 1, period, 1),
            (period, period, 0),
            (period - minimum, period - minimum, 0),
        ):
            await tb.update(period=period, duty_q8=duty << 8, min_pulse=minimum)
            await tb.skip(at + length - tb.now)
            first = await tb.run(1, {})
            at, length = at + length, period
            where = f"period {period}, minimum {minimum}, duty {duty}"
            assert int(first.dropped[0] - row.dropped[0]) % 65536 == counted, f"{where}: counted is not {counted}"
            row = first
            if duty != period:
                await tb.update(duty_q8=period << 8)
                await tb.skip(at + length - tb.now)
                row = await tb.run(1, {})
                at += length
                assert int(row.last_on[0]) == on, f"{where}: {row.last_on[0]} clocks"


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
    await tb.align(PERIOD)
    trace = await tb.run(5 * PERIOD, {10: {"cfg_duty_q8_i": 60 * 256, "cfg_period_i": 150, "cfg_min_pulse_i": 30}})
    assert {(n, on) for _, n, on in carriers(trace)} == {(PERIOD, 40)}, "changed without update"
    for lead in range(1, 12):
        new_period, new_duty = (150, 60) if lead % 2 else (PERIOD, 40)
        old_period, old_duty = (PERIOD, 40) if lead % 2 else (150, 60)
        await tb.align(old_period)
        drive: Drive = {0: {"cfg_duty_q8_i": new_duty * 256, "cfg_period_i": new_period, "cfg_min_pulse_i": 5}}
        pulse(drive, [old_period - lead], "update_i")
        rows = [(n, on) for _, n, on in carriers(await tb.run(5 * 150 + 1, drive))]
        old_carriers = 1 if lead >= UPDATE_TO_CARRIER else 2
        expected = [(old_period, old_duty)] * old_carriers + [(new_period, new_duty)] * (len(rows) - old_carriers)
        assert rows == expected, f"update {lead} clocks before the carrier start: {rows}"


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
@cocotb.parametrize((("alignment", "duty"), [(NSC, 80), (RSC, 40)]))
async def reset_clears_everything(dut: Dut, alignment: int, duty: int) -> None:
    """One clock of reset: no pulse, count from 0, nothing counted or owed, then period 65535 until an update."""
    tb = Chain(dut)
    await tb.start(period=PERIOD, commutation=alignment, min_pulse=12, duty_q8=duty << 8)
    await tb.align(PERIOD)
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
    await tb.align(PERIOD)
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
        await tb.align(PERIOD)
        await tb.run(PERIOD // 2, {})
        await tb.update(duty_q8=15 * 256)
        rows = carriers(await tb.run(30 * PERIOD, {}))
        extra = sum(on - 15 for _, _, on in rows)
        assert abs(extra) <= 20, f"{extra} clocks came back after duty {pinned}"


@cocotb.test()
@cocotb.parametrize(period=[0x5555, 0xAAAA, 0xFFFF])
async def carry_is_bounded_at_long_periods(dut: Dut, period: int) -> None:
    """More than one period is owed, then more than one was given too much: one period of it is remembered."""
    tb = Chain(dut)
    duty, late = period // 2, period * 3 // 4  # late: a clock at which the pulse is over
    await tb.start(period=PERIOD, commutation=CSC)
    await tb.update(period=period, duty_q8=duty << 8)
    row = await tb.run(1, {})
    while not row.start[0] or row.last_length[0] == 0:
        row = await tb.run(1, {})
    start = tb.now - 1  # of the first long carrier

    async def widths(count: int) -> list[int]:
        """Clocks of the pulse of this carrier and the next ones, read in the third clock of the carrier after each."""
        nonlocal start
        found = []
        for _ in range(count):
            start += period
            await tb.skip(start + 2 - tb.now)
            found.append(int((await tb.run(1, {})).last_on[0]))
        return found

    async def announce(clock: int, valid: int) -> None:
        """A commutation that is overdue and never comes, from this clock of the running carrier on."""
        await tb.skip(start + clock - tb.now)
        await tb.run(1, {0: {"sched_valid_i": valid, "comm_sched_i": tb.now % (1 << 32)}})

    await announce(late, 1)
    assert await widths(3) == [duty, 0, 0]
    await announce(late, 0)
    extra = sum(await widths(4)) - 3 * duty
    assert abs(extra - period) <= 4, f"{extra} clocks came back"  # a pulse is planned 3 clocks ahead
    await announce(8, 1)
    assert await widths(3) == [period] * 3
    await announce(late, 0)
    missing = 3 * duty - sum((await widths(4))[1:])
    assert abs(missing - period) <= 4, f"{missing} clocks were taken back"


def test_fl_carrier() -> None:
    """Carrier block test.

    Verifies: PWM-01, PWM-02, PWM-03, PWM-04, PWM-05, PWM-08, PWM-09, PWM-11
    """
    run_block_test("fl_pwm_chain", SOURCES, __name__)


if __name__ == "__main__":
    pytest.main([__file__])
