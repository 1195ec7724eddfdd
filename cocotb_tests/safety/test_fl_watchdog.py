# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The watchdog against a model that looks back over all reports, and two stuck handlers."""

from __future__ import annotations

import random
from typing import Any

import cocotb
import pytest
from cocotb.triggers import RisingEdge

from cocotb_tests.soc.bench import Bench
from fluxlock.cosim.block import run_block_test

Clock = tuple[int, int, int, int]  # enable, period, feed, step


def expected(history: list[Clock]) -> tuple[int, int]:
    """Expired and wrong after these clocks of one period, from the clocks since the enable rose."""
    enable, period = history[-1][:2]
    if not enable or not period:
        return 0, 0
    since = max((i + 1 for i, (on, *_) in enumerate(history) if not on), default=0)
    before = [step for _, _, feed, step in history[:since] if feed]
    last = before[-1] if before else 0
    wrong, waited, expired = 0, 0, 0
    for _, _, feed, step in history[since:]:
        waited += 1
        expired |= waited >= period
        if feed:
            waited = 0 if step == (last + 1) % 256 else waited
            wrong |= step != (last + 1) % 256
            last = step
    return expired, wrong


@cocotb.test
async def follows_the_model(dut: Any) -> None:
    bench = Bench(dut)
    await bench.start(enable_i=0, cfg_cycles_i=0, feed_i=0, step_i=0)
    seen = set()
    for period in sorted({min(period, (1 << len(dut.cfg_cycles_i)) - 1) for period in (0, 1, 2, 7, 20)}):
        dut.rst_i.value = 1
        await bench.clocks()
        dut.rst_i.value = 0
        history: list[Clock] = []
        step, on = 0, 0
        for _ in range(1600):
            on = on if random.random() < 0.98 else 1 - on
            feed = int(random.random() < 0.2)
            if feed:
                step = (step + 1) % 256 if random.random() < 0.8 else random.getrandbits(8)
            # Without a report the next number may stand there all the same.
            clock = (on, period, feed, step if feed else (step + random.randrange(3)) % 256)
            dut.enable_i.value, dut.cfg_cycles_i.value, dut.feed_i.value, dut.step_i.value = clock
            history.append(clock)
            await bench.clocks()
            got = int(dut.expired_o.value), int(dut.wrong_o.value)
            assert got == expected(history), f"period {period}, after {history[-period - 3 :]}"
            seen.add((period > 0, *got))
    # A period of 1 is over in the first clock: with it nothing is wrong that has not expired.
    possible = 5 if len(dut.cfg_cycles_i) > 1 else 4
    assert len(seen) == possible, f"only {seen} were seen"


@cocotb.test
async def expires_at_its_period(dut: Any) -> None:
    """One period an octave up to 2^20 clocks, run out in full: not a clock early or late.

    Longer ones are the proof's (`a_expires`, of which a copy with a period of 16 bits is found).
    """
    bench = Bench(dut)
    await bench.start(enable_i=0, cfg_cycles_i=0, feed_i=0, step_i=0)
    bits = min(len(dut.cfg_cycles_i), 20)
    for period in (*(random.randrange(1 << bit, 2 << bit) for bit in range(bits - 1)), (1 << bits) - 1):
        dut.cfg_cycles_i.value, dut.enable_i.value = period, 1
        waited = await bench.sleep(period + 1, RisingEdge(dut.expired_o))
        assert waited == period, f"period {period}: {waited} clocks"
        await bench.clocks(3)
        assert dut.expired_o.value == 1
        dut.enable_i.value = 0
        await bench.clocks()
        assert dut.expired_o.value == 0


@cocotb.test
async def every_period_but_none_runs(dut: Any) -> None:
    """One bit of the period is enough for the numbers to count."""
    bench = Bench(dut)
    await bench.start(enable_i=1, cfg_cycles_i=0, feed_i=1, step_i=5)
    for bit in range(len(dut.cfg_cycles_i)):
        dut.cfg_cycles_i.value = 0
        await bench.clocks()
        assert dut.wrong_o.value == 0
        dut.cfg_cycles_i.value = 1 << bit
        await bench.clocks()
        assert dut.wrong_o.value == 1, f"period {1 << bit}"


@cocotb.test
async def only_the_next_number_is_right(dut: Any) -> None:
    """From each number on: the next is right and starts the time anew, one with another bit is wrong and does not."""
    period = 5
    bench = Bench(dut)
    await bench.start(enable_i=0, cfg_cycles_i=period, feed_i=0, step_i=0)
    for last in range(256):
        for flip in (0, 1 << random.randrange(8)):
            dut.feed_i.value, dut.step_i.value = 1, last
            await bench.clocks()
            dut.feed_i.value, dut.enable_i.value = 0, 1
            await bench.clocks(period - 2)
            dut.feed_i.value, dut.step_i.value = 1, (last + 1) % 256 ^ flip
            await bench.clocks()
            assert dut.wrong_o.value == bool(flip), f"{last}, then {dut.step_i.value}"
            dut.feed_i.value = 0
            await bench.clocks()
            assert dut.expired_o.value == bool(flip), f"{last}, then {dut.step_i.value}"
            dut.enable_i.value = 0
            await bench.clocks()
            assert dut.expired_o.value == dut.wrong_o.value == 0


@cocotb.test
async def a_stuck_handler_cannot_feed_it(dut: Any) -> None:
    """A loop that reports the same number at any rate trips at the second report; none at all, after the period."""
    bench = Bench(dut)
    for spacing in (1, 3, 15):
        await bench.start(enable_i=0, cfg_cycles_i=16, feed_i=0, step_i=random.getrandbits(8))
        dut.feed_i.value = 1
        await bench.clocks()
        dut.feed_i.value, dut.enable_i.value = 0, 1
        await bench.clocks(spacing - 1)
        dut.feed_i.value = 1
        await bench.clocks()
        assert dut.wrong_o.value == 1
    await bench.start(enable_i=1, cfg_cycles_i=16, feed_i=0, step_i=0)
    for _ in range(15):
        await bench.clocks()
        assert dut.expired_o.value == 0
    await bench.clocks()
    assert dut.expired_o.value == 1


@pytest.mark.parametrize(("width", "testcase"), [(24, None), (1, "follows_the_model")])
def test_fl_watchdog(width: int, testcase: str | None) -> None:
    """Reports in time and in order, and all others.

    Verifies: SAFE-13
    """
    run_block_test("fl_watchdog", ["safety/fl_watchdog.sv"], __name__, parameters={"Width": width}, testcase=testcase)
