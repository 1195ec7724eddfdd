# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Sequencer: sector table, chopping patterns in both directions, manual commands, synchronous rectification.

The oracle is the list of sectors as text and the rule "first or last 60 degrees of a switch's conduction",
worked out from the order in which the sectors were visited.
"""

from __future__ import annotations

import cocotb
import numpy as np

from cocotb_tests.pwm.chain import (
    CSC,
    H_ON_L_PWM,
    H_PWM_L_ON,
    MANUAL,
    OFF,
    ON_PWM,
    PWM_ON,
    RSC,
    SIX_STEP,
    SOURCES,
    Chain,
    Drive,
    Dut,
    pulse,
)
from fluxlock.cosim.block import run_block_test

SECTORS = ["A+B-", "A+C-", "B+C-", "B+A-", "C+A-", "C+B-"]
PERIOD = 60


def conducting(sector: int) -> set[str]:
    """Switches that conduct while the pulse is on, such as {"A+", "B-"}."""
    return {SECTORS[sector][:2], SECTORS[sector][2:]}


def requested(req_h: int, req_l: int) -> set[str]:
    """Requested switches of one clock."""
    return {f"{leg}+" for x, leg in enumerate("ABC") if req_h >> x & 1} | {
        f"{leg}-" for x, leg in enumerate("ABC") if req_l >> x & 1
    }


@cocotb.test()
@cocotb.parametrize(pattern=[ON_PWM, H_PWM_L_ON, PWM_ON, H_ON_L_PWM], reverse=[0, 1], start_sector=[0, 3])
async def patterns(dut: Dut, pattern: int, reverse: int, start_sector: int) -> None:
    tb = Chain(dut)
    await tb.start(period=PERIOD, duty_q8=25 * 256, commutation=CSC, mode=OFF)
    await tb.update(mode=SIX_STEP, pattern=pattern, reverse=reverse, start_sector=start_sector)
    visits = 14
    drive: Drive = {}
    pulse(drive, [(k + 1) * 2 * PERIOD for k in range(visits - 1)], "comm_valid_i")
    trace = await tb.run(visits * 2 * PERIOD, drive)
    step = -1 if reverse else 1
    expected_sector = [(start_sector + step * k) % 6 for k in range(visits)]
    previous: set[str] = set()
    for k, sector in enumerate(expected_sector):
        window = range(k * 2 * PERIOD + 1, (k + 1) * 2 * PERIOD)
        assert {int(trace.sector[i]) for i in window} == {sector}, f"visit {k}: sectors {expected_sector[: k + 1]}"
        on = {frozenset(requested(trace.req_h[i], trace.req_l[i])) for i in window if trace.pulse[i]}
        off = {frozenset(requested(trace.req_h[i], trace.req_l[i])) for i in window if not trace.pulse[i]}
        switches = conducting(sector)
        assert on == {frozenset(switches)}, f"visit {k}, pulse on: {on}"
        assert len(off) == 1, f"visit {k}, pulse off: {off}"
        chopped = switches - next(iter(off))
        if k > 0:
            first60, last60 = switches - previous, switches & previous
            assert len(first60) == len(last60) == 1
            rule = {
                ON_PWM: last60,
                PWM_ON: first60,
                H_PWM_L_ON: {s for s in switches if s[1] == "+"},
                H_ON_L_PWM: {s for s in switches if s[1] == "-"},
            }[pattern]
            assert chopped == rule, (
                f"pattern {pattern}, reverse {reverse}, sector {sector}: {chopped} chops, not {rule}"
            )
        previous = switches


@cocotb.test()
async def entry_and_leaving(dut: Dut) -> None:
    tb = Chain(dut)
    await tb.start(period=PERIOD, duty_q8=25 * 256, mode=OFF)
    trace = await tb.run(3 * PERIOD, {5: {"comm_valid_i": 1}, 6: {"comm_valid_i": 0}})
    assert not np.any(trace.req_h | trace.req_l | trace.active | trace.comm_applied), "OFF requests a gate"
    for wanted, loaded in ((0, 0), (1, 1), (2, 2), (3, 3), (4, 4), (5, 5), (6, 0), (7, 0)):
        await tb.update(mode=SIX_STEP, start_sector=wanted)
        trace = await tb.run(PERIOD, {})
        assert set(trace.sector) == {loaded} and np.all(trace.active)
        assert not np.any(trace.comm_applied), "the entry is no commutation"
        await tb.update(start_sector=(wanted + 2) % 6)  # still in SIX_STEP: no effect
        assert set((await tb.run(PERIOD, {})).sector) == {loaded}
        # A commutation in the very clock of the entry is no step of the new mode.
        await tb.update(mode=OFF)
        drive: Drive = {0: {"cfg_mode_i": SIX_STEP, "cfg_start_sector_i": wanted}}
        pulse(drive, [0], "update_i")
        pulse(drive, [0], "comm_valid_i")
        trace = await tb.run(PERIOD, drive)
        assert set(trace.sector[1:]) == {loaded} and not np.any(trace.comm_applied)
        # A setting that was not committed changes nothing.
        tb.dut.cfg_mode_i.value = OFF
        assert np.all((await tb.run(PERIOD, {})).active)
        await tb.update(mode=OFF)
        trace = await tb.run(PERIOD, {})
        assert not np.any(trace.req_h | trace.req_l | trace.active | trace.gate)


@cocotb.test()
@cocotb.parametrize(reverse=[0, 1], commutation=[RSC, CSC])
async def sector_of_the_sensors(dut: Dut, reverse: int, commutation: int) -> None:
    """Entry in the Hall sensors' sector for the direction of that update; loading commutations go where they say."""
    tb = Chain(dut)
    await tb.start(period=PERIOD, duty_q8=25 * 256, mode=OFF, commutation=commutation)
    for position in range(6):
        for ok in (0, 1):
            dut.hall_position_i.value, dut.hall_ok_i.value = position, ok
            await tb.update(mode=SIX_STEP, start_sector=1, start_hall=1, reverse=reverse)
            entered = (position + 3 * reverse) % 6 if ok else 1
            trace = await tb.run(PERIOD, {})
            assert set(trace.sector) == {entered} and not np.any(trace.comm_applied)
            for target in (position, (position + 4) % 6):
                drive: Drive = {7: {"load_i": 1, "load_sector_i": target}}
                pulse(drive, [7], "comm_valid_i")
                trace = await tb.run(3 * PERIOD, drive)
                assert trace.sector[-1] == target and np.count_nonzero(trace.comm_applied) == 1
            dut.load_i.value = 0
            trace = await tb.run(3 * PERIOD, {7: {"comm_valid_i": 1}, 8: {"comm_valid_i": 0}})
            assert trace.sector[-1] == (target + (5 if reverse else 1)) % 6, "a plain commutation steps"
            await tb.update(mode=OFF, start_hall=0, reverse=0)


@cocotb.test()
@cocotb.parametrize(sync_rect=[0, 1])
async def manual_commands(dut: Dut, sync_rect: int) -> None:
    """Every command on every leg; codes without meaning leave the leg open; commutations have no effect."""
    tb = Chain(dut)
    await tb.start(period=PERIOD, duty_q8=20 * 256, mode=MANUAL, sync_rect=sync_rect, commutation=RSC)
    by_code = {
        0: ("", ""),
        1: ("+", "+"),
        2: ("-", "-"),
        3: ("+", "-" * sync_rect),
        4: ("-", "+" * sync_rect),
    }
    for code in range(8):
        for leg in range(3):
            others = (code + 1) % 5
            codes = [others] * 3
            codes[leg] = code
            await tb.update(manual=sum(c << (3 * x) for x, c in enumerate(codes)))
            trace = await tb.run(2 * PERIOD, {7: {"comm_valid_i": 1}, 8: {"comm_valid_i": 0}})
            for i in range(len(trace)):
                expected = {
                    f"{name}{sign}"
                    for name, c in zip("ABC", codes, strict=True)
                    for sign in by_code.get(c, ("", ""))[0 if trace.pulse[i] else 1]
                }
                assert requested(trace.req_h[i], trace.req_l[i]) == expected, f"codes {codes}, pulse {trace.pulse[i]}"
            assert not np.any(trace.comm_applied) and np.all(trace.active)


@cocotb.test()
@cocotb.parametrize(pattern=[ON_PWM, H_PWM_L_ON])
async def synchronous_rectification(dut: Dut, pattern: int) -> None:
    """While the pulse is off the chopping leg's other switch conducts, with the dead time around it."""
    tb = Chain(dut)
    dead = 5
    tb.dut.dead_time_i.value = dead
    await tb.start(period=PERIOD, duty_q8=25 * 256, sync_rect=1, pattern=pattern)
    tb.dut.dead_time_i.value = dead
    drive: Drive = {}
    pulse(drive, [(k + 1) * 3 * PERIOD for k in range(11)], "comm_valid_i")
    trace = await tb.run(12 * 3 * PERIOD, drive)
    flipped = {"+": "-", "-": "+"}
    for i in range(len(trace)):
        now = requested(trace.req_h[i], trace.req_l[i])
        assert len(now) == 2, f"clock {i}: {now}"
        both = conducting(int(trace.sector[i]))
        if trace.pulse[i]:
            assert now == both
        else:
            stays, other = now & both, now - both
            assert len(stays) == 1
            chopped = next(iter(both - stays))
            assert other == {chopped[0] + flipped[chopped[1]]}
    for x in range(3):
        upper, lower = trace.gate >> (2 * x) & 1, trace.gate >> (2 * x + 1) & 1
        for first, second in ((upper, lower), (lower, upper)):
            for edge in np.flatnonzero(np.diff(second) == 1) + 1:
                assert not np.any(first[max(0, edge - dead) : edge]), f"leg {x}: gap too short at {edge}"
        assert np.any(upper) and np.any(lower)


def test_fl_sequencer() -> None:
    """Sequencer block test.

    Verifies: SEQ-01, SEQ-02, SEQ-03, SEQ-04, SEQ-05, SEQ-06
    """
    run_block_test("fl_pwm_chain", SOURCES, __name__)
