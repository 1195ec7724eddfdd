# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Carrier under commutation: instants of RSC, NSC and CSC, and the minimum-pulse rule with announced commutations.

The oracle is the pulse that the rules give (`carrier_model`). No internal state is read.
"""

from __future__ import annotations

import random

import cocotb
import numpy as np
import pytest

from cocotb_tests.pwm.carrier_model import cut, levels, owed, plain
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
ALIGNMENTS = (RSC, NSC, CSC)


@cocotb.test()
async def any_minimum_before_a_commutation(dut: Dut) -> None:
    """NSC, a commutation after a carrier's start: the pulse begins there if it gets its minimum, else with it.

    A commutation that is far ahead holds nothing back, one that is overdue does.
    """
    tb = Chain(dut)
    await tb.start(period=PERIOD, commutation=NSC)
    await tb.align(PERIOD)
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
@cocotb.parametrize(alignment=[RSC, NSC, CSC])
async def commutation_instant(dut: Dut, alignment: int) -> None:
    """Unannounced commutations at every phase of the carrier."""
    tb = Chain(dut)
    await tb.start(period=PERIOD, duty_q8=40 * 256, commutation=alignment, min_pulse=8)
    cycle, comms = 50, []
    drive: Drive = {}
    for phase in range(PERIOD + 1):
        cycle += 3 * PERIOD + (phase if alignment == CSC else 1)
        comms.append(cycle)
    pulse(drive, comms, "comm_valid_i")
    trace = await tb.run(cycle + 3 * PERIOD, drive)
    applied = np.flatnonzero(trace.comm_applied)
    starts = np.flatnonzero(trace.start)
    assert len(applied) == len(comms)
    assert np.count_nonzero(np.diff(trace.sector)) == len(comms)
    phases = {int(trace.count[c]) for c in comms}
    assert phases == set(range(PERIOD)), "the stimulus does not cover every phase"
    if alignment == RSC:
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
    if alignment == CSC:
        assert np.all(trace.count[applied] == 0) and np.all(trace.start[applied] == 1)
        assert np.all(trace.pulse[applied] == 1), "no new pulse at a commutation"
    else:
        assert set(np.diff(starts).tolist()) == {PERIOD}, "a commutation moved the carrier"


@cocotb.test()
@cocotb.parametrize(alignment=[RSC, NSC, CSC], chop=[ON_PWM, H_PWM_L_ON, PWM_ON, H_ON_L_PWM])
async def look_ahead(dut: Dut, alignment: int, chop: int) -> None:
    """Random scheduled commutations: no short pulse or gap, none is delayed, volt-seconds return."""
    rng = random.Random(1000 * alignment + chop)
    tb = Chain(dut)
    minimum = 12
    await tb.start(period=PERIOD, commutation=alignment, pattern=chop, min_pulse=minimum)
    shortest = PERIOD + minimum if alignment == RSC else 4 * minimum
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
            if alignment != RSC:
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
    if alignment == CSC:
        assert cut_too_short > 10, "the stimulus never came to the rule"


@cocotb.test()
@cocotb.parametrize(
    alignment=[NSC, CSC], stamp=[0x5555_5555, 0xAAAA_AAAA, 0x8000_0000 - 3 * PERIOD, 0x1_0000_0000 - 3 * PERIOD]
)
async def held_back_pulse_returns(dut: Dut, alignment: int, stamp: int) -> None:
    """A commutation shortly after every carrier start: nothing short is started, and the mean is exact.

    stamp: time at the beginning, so that time stamps have all their bits and pass their largest value.
    """
    tb = Chain(dut)
    minimum, duty = 12, 30
    await tb.start(period=PERIOD, commutation=alignment, min_pulse=minimum, duty_q8=duty * 256)
    dut.now.value = tb.now = stamp
    trace = await tb.run(PERIOD, {})
    first = int(np.flatnonzero(trace.start)[0]) + 0  # the next carriers start at first + k * PERIOD
    drive: Drive = {}
    instants = []
    if alignment == NSC:
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
    """NSC, one announced commutation in a carrier: every clock of its pulse, and whether the carrier is counted."""
    tb = Chain(dut)
    minimum = 12
    await tb.start(period=PERIOD, commutation=NSC, min_pulse=minimum, duty_q8=duty << 8)
    await tb.align(PERIOD)
    ends = {minimum, duty, duty - minimum, duty + minimum, PERIOD - minimum}
    near = {end + d for end in ends for d in (-1, 0, 1)}
    for p in sorted({0, 2, 50, 70, PERIOD - 1, *(p for p in near if 2 <= p < PERIOD)}):
        drive: Drive = {}
        # The clock before pulse_o changes is that of comm_valid_i.
        schedule(drive, tb.now, PERIOD + p - 1 + COMM_TO_GATE, PERIOD + p - 3 * minimum, True)
        trace = await tb.run(2 * PERIOD + 2, drive)
        expected = levels(PERIOD, duty, minimum, p)
        found = trace.pulse[PERIOD : 2 * PERIOD].tolist()
        wrong = [c for c in range(PERIOD) if found[c] != expected[c]]
        assert not wrong, f"duty {duty}, commutation at {p}: clocks {wrong} differ"
        counted = (trace.dropped[2 * PERIOD] - trace.dropped[PERIOD]) % 65536
        assert counted == (expected != plain(PERIOD, duty)), f"duty {duty}, commutation at {p}: {counted} counted"
        await tb.skip(6 * PERIOD - 2)  # what is owed has returned


@cocotb.test()
@cocotb.parametrize(duty=[0, 14, 40, 88, PERIOD])
async def carrier_cut_at_any_clock(dut: Dut, duty: int) -> None:
    """CSC, one announced commutation: the pulse of the carrier that it cuts, and whether the carrier is counted."""
    tb = Chain(dut)
    minimum = 12
    await tb.start(period=PERIOD, commutation=CSC, min_pulse=minimum, duty_q8=duty << 8)
    await tb.align(PERIOD)
    ends = {minimum, duty, duty + minimum}
    for p in sorted({2, 5, 70, PERIOD - 1, *(e + d for e in ends for d in (-1, 0, 1) if 2 <= e + d < PERIOD)}):
        drive: Drive = {}
        schedule(drive, tb.now, PERIOD + p - 1 + COMM_TO_GATE, PERIOD + p - 3 * minimum, True)
        trace = await tb.run(PERIOD + p + 1, drive)
        assert trace.start[PERIOD] and trace.start[PERIOD + p]
        found, expected = trace.pulse[PERIOD : PERIOD + p].tolist(), cut(PERIOD, duty, minimum, p)
        assert found == expected, f"duty {duty}, cut at {p}: {found}"
        counted = (trace.dropped[PERIOD + p] - trace.dropped[PERIOD]) % 65536
        assert counted == (expected != plain(p, duty)), f"duty {duty}, cut at {p}: {counted} counted"
        await tb.skip(6 * PERIOD - 1)


@cocotb.test()
@cocotb.parametrize(
    (("duty", "at", "on"), [(88, PERIOD - 5, 12), (PERIOD, PERIOD + 6, 6), (PERIOD, 2 * PERIOD + 50, 0)])
)
async def pulse_runs_into_a_carrier_without_one(dut: Dut, duty: int, at: int, on: int) -> None:
    """Duty set to 0 while the pulse is on at a carrier's end, because of a commutation at clock `at` (NSC).

    Begun early at a commutation, it gets its minimum in the next carrier; held on over the carrier's start for a
    commutation that follows, it ends there; without one near it ends with the carrier.
    """
    tb = Chain(dut)
    minimum = 12
    await tb.start(period=PERIOD, commutation=NSC, min_pulse=minimum, duty_q8=duty << 8)
    await tb.align(PERIOD)
    drive: Drive = {}
    add(drive, 60, cfg_duty_q8_i=0)
    pulse(drive, [60], "update_i")
    schedule(drive, tb.now, at - 1 + COMM_TO_GATE, at - 3 * minimum, True)
    trace = await tb.run(3 * PERIOD, drive)
    wrong = np.flatnonzero(trace.pulse != (np.arange(3 * PERIOD) < PERIOD + on))
    assert not wrong.size, f"clocks {wrong.tolist()} differ"
    counted = [int(trace.dropped[k * PERIOD] - trace.dropped[(k - 1) * PERIOD]) for k in (1, 2)]
    assert counted == [at < PERIOD, on > 0], f"{counted} counted"


@cocotb.test()
async def tail_at_any_period(dut: Dut) -> None:
    """NSC: a rest of the carrier of the minimum is left, one of a clock less is filled and counted."""
    dut._log.info("seed %d", cocotb.RANDOM_SEED)
    rng = random.Random(cocotb.RANDOM_SEED)
    tb = Chain(dut)
    await tb.start(period=PERIOD, commutation=NSC)
    await tb.align(PERIOD)
    start, length = tb.now, PERIOD

    async def next_carrier() -> None:
        nonlocal start
        start += length
        await tb.skip(start - tb.now)

    for bits in range(6, 16):
        for short in (0, 1):
            period = rng.randrange(1 << bits, 2 << bits)
            minimum, duty = min(period // 8, 4095), period // 2
            p = period - minimum + short
            # What is owed is cleared by a carrier without a pulse.
            await tb.update(period=period, min_pulse=minimum, duty_q8=0)
            await next_carrier()
            length = period
            await tb.update(duty_q8=duty << 8)
            await next_carrier()
            before = await tb.run(1, {})
            drive: Drive = {}
            await tb.skip(p - 10 - 1)
            schedule(drive, tb.now, 10 - 1 + COMM_TO_GATE, 0, True)
            await tb.run(12, drive)
            await next_carrier()
            after = await tb.run(3, {})
            where = f"period {period}, duty {duty}, minimum {minimum}, commutation at {p}"
            on, expected = int(after.last_on[2]), sum(levels(period, duty, minimum, p))
            assert (int(after.last_length[2]), on) == (period, expected), f"{where}: {on} clocks, not {expected}"
            assert (after.dropped[0] - before.dropped[0]) % 65536 == short, f"{where}: counted is not {short}"


@cocotb.test()
async def carrier_changed_twice_counts_once(dut: Dut) -> None:
    """NSC: too little is owed for a pulse, then the carrier's rest is filled at a commutation."""
    tb = Chain(dut)
    await tb.start(period=PERIOD, commutation=NSC, min_pulse=12, duty_q8=8 << 8)
    await tb.align(PERIOD)
    while not (await tb.run(PERIOD, {})).pulse.any():
        pass
    drive: Drive = {}
    schedule(drive, tb.now, 95 - 1 + COMM_TO_GATE, 60, True)
    trace = await tb.run(PERIOD + 1, drive)
    assert trace.pulse[:PERIOD].tolist() == [int(c >= 95) for c in range(PERIOD)]
    assert (trace.dropped[PERIOD] - trace.dropped[0]) % 65536 == 1


@cocotb.test()
async def ended_pulse_stays_off(dut: Dut) -> None:
    """NSC: a pulse ended for its short rest does not return at a second commutation, though its rest is now allowed."""
    tb = Chain(dut)
    await tb.start(period=PERIOD, commutation=NSC, min_pulse=12, duty_q8=40 << 8)
    await tb.align(PERIOD)
    drive: Drive = {}
    add(drive, 31, cfg_min_pulse_i=2)
    pulse(drive, [31], "update_i")
    pulse(drive, [31, 35], "comm_valid_i")
    trace = await tb.run(PERIOD, drive)
    assert trace.pulse.tolist() == [int(c < 32) for c in range(PERIOD)]


def test_fl_carrier_commutation() -> None:
    """Carrier block test, commutations.

    Verifies: PWM-04, PWM-06, PWM-07, PWM-08, PWM-11
    """
    run_block_test("fl_pwm_chain", SOURCES, __name__)


if __name__ == "__main__":
    pytest.main([__file__])
