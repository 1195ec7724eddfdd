"""The watchdog against a model that looks back over all reports, and two stuck handlers."""

from __future__ import annotations

import random
from typing import Any

import cocotb

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
    for period in (0, 1, 2, 7, 20):
        dut.rst_i.value = 1
        await bench.clocks()
        dut.rst_i.value = 0
        history: list[Clock] = []
        step, on = 0, 0
        for _ in range(800):
            on = on if random.random() < 0.98 else 1 - on
            feed = int(random.random() < 0.2)
            if feed:
                step = (step + 1) % 256 if random.random() < 0.97 else random.getrandbits(8)
            clock = (on, period, feed, step)
            dut.enable_i.value, dut.cfg_cycles_i.value, dut.feed_i.value, dut.step_i.value = clock
            history.append(clock)
            await bench.clocks()
            got = int(dut.expired_o.value), int(dut.wrong_o.value)
            assert got == expected(history), f"period {period}, after {history[-period - 3 :]}"
            seen.add((period > 0, *got))
    assert len(seen) == 5, f"only {seen} were seen"


@cocotb.test
async def longest_period(dut: Any) -> None:
    """All 24 bits count: neither early nor never."""
    bench = Bench(dut)
    await bench.start(enable_i=1, cfg_cycles_i=(1 << 24) - 1, feed_i=0, step_i=0)
    await bench.clocks(10)
    dut.wait_q.value = (1 << 24) - 5
    await bench.clocks(3)
    assert dut.expired_o.value == 0
    await bench.clocks(2)
    assert dut.expired_o.value == 1
    await bench.clocks(3)
    assert dut.expired_o.value == 1, "the count must not wrap"


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


def test_fl_watchdog() -> None:
    """Reports in time and in order, and all others.

    Verifies: SAFE-13
    """
    run_block_test("fl_watchdog", ["safety/fl_watchdog.sv"], __name__)
