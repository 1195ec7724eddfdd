# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""PWM state for sensing, against a reference worked out from the recorded gates."""

from __future__ import annotations

import random
from itertools import product

import cocotb
import numpy as np

from cocotb_tests.pwm.chain import CSC, MANUAL, NSC, OFF, RSC, SIX_STEP, SOURCES, Chain, Drive, Dut, pulse
from cocotb_tests.pwm.test_fl_sequencer import SECTORS
from fluxlock.cosim.block import run_block_test

PERIOD = 90


def gates_of(sector: int) -> int:
    """Gate word of a sector while its pulse is on."""
    name = SECTORS[sector]
    return 1 << (2 * "ABC".index(name[0])) | 1 << (2 * "ABC".index(name[2]) + 1)


@cocotb.test()
@cocotb.parametrize(commutation=[RSC, NSC, CSC], sync_rect=[0, 1])
async def state_describes_the_gates(dut: Dut, commutation: int, sync_rect: int) -> None:
    rng = random.Random(commutation + 10 * sync_rect)
    tb = Chain(dut)
    await tb.start(period=PERIOD, commutation=commutation, sync_rect=sync_rect, pattern=rng.randrange(4))
    for duty in (0, 7, 33, 70, 88, 120):
        await tb.update(duty_q8=duty * 256)
        drive: Drive = {}
        comms, t = [], 150
        while t < 2800:
            comms.append(t)
            t += rng.randrange(100, 400)
        pulse(drive, comms, "comm_valid_i")
        pulse(drive, [1501], "trip_i")
        trace = await tb.run(3000, drive)
        changed = np.flatnonzero(np.diff(trace.gate)) + 1
        applied = np.flatnonzero(trace.comm_applied) + 1  # the guard's register
        for i in range(600, len(trace)):
            sector = int(trace.sector[i - 1])
            assert trace.state_sector[i] == sector
            assert trace.on[i] == (trace.gate[i] == gates_of(sector)), f"duty {duty}, clock {i}"
            since_comm = i - int(applied[applied <= i][-1])
            assert trace.comm_age[i] == since_comm, f"clock {i}: comm_age {trace.comm_age[i]}, not {since_comm}"
            since = changed[changed <= i]
            if since.size:
                assert trace.age[i] == i - int(since[-1]), f"clock {i}: age {trace.age[i]}"
    assert np.all(trace.on[-100:] == 1), "100 % duty and no on-state"


@cocotb.test()
async def on_means_exactly_the_two_gates(dut: Dut) -> None:
    """Manual commands with the sector register at I: only A+ and B- alone are its on-state."""
    tb = Chain(dut)
    await tb.start(period=PERIOD, duty_q8=0, mode=MANUAL)
    high, low = 1, 2
    for a, b, c in product((0, high, low), repeat=3):
        await tb.update(manual=a | b << 3 | c << 6)
        trace = await tb.run(PERIOD, {})
        assert trace.state_sector[-1] == 0 and trace.gate[-1] == sum(v << 2 * x for x, v in enumerate((a, b, c)))
        assert trace.on[-1] == ((a, b, c) == (high, low, 0)), f"legs {a, b, c}: on = {trace.on[-1]}"


@cocotb.test()
async def ages_saturate_and_restart(dut: Dut) -> None:
    tb = Chain(dut)
    await tb.start(period=PERIOD, duty_q8=0)
    trace = await tb.run(66_500, {})
    assert trace.age[-1] == trace.comm_age[-1] == 65535
    assert np.all(np.diff(trace.age) >= 0) and np.all(np.diff(trace.comm_age) >= 0)
    await tb.update(mode=OFF)
    trace = await tb.run(20, {})
    assert not np.any(trace.on)
    await tb.update(mode=SIX_STEP)
    trace = await tb.run(20, {})
    assert trace.comm_age[-1] <= 22, "entering a mode does not restart comm_age"


def test_fl_pwm_state() -> None:
    """PWM state block test.

    Verifies: PWM-10
    """
    run_block_test("fl_pwm_chain", SOURCES, __name__)
