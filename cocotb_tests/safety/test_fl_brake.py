# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The brake chopper against a model that looks back over all clocks; a link that stays high, falls or goes unseen."""

from __future__ import annotations

import random
from typing import Any

import cocotb
import pytest
from cocotb.triggers import FallingEdge

from cocotb_tests.soc.bench import Bench
from fluxlock.cosim.block import run_block_test

ON, OFF = 3000, 2800
CODE_TO_SWITCH = 1  # clocks, published by the pages
Clock = tuple[int, int | None]  # enable, code if there is one


def expected(history: list[Clock], longest: int, age: int, on: int = ON, off: int = OFF) -> list[tuple[int, int]]:
    """Brake and overload after each of these clocks since a reset, from the intervals between codes below `off`."""
    result: list[tuple[int, int]] = []
    start = 0  # of the interval
    over = False
    for t, (enable, code) in enumerate(history):
        if code is not None and code < off:
            start, over = t + 1, False
            result.append((0, 0))
            continue
        # The last reason to be on, and whether all since then speaks for staying on.
        since = next((u for u in range(t, start - 1, -1) if (history[u][1] or 0) > on), None)
        wanted = since is not None and all(history[u][0] for u in range(since, t + 1))
        seen = since
        for u in range(t if since is None else since, t + 1):
            seen = u if history[u][1] is not None else seen
            wanted &= seen is not None and u - seen < max(age, 1)
        burnt = sum(brake for brake, _ in result[start:t])
        over |= bool(wanted) and burnt >= longest
        result.append((int(bool(wanted) and not over), int(over)))
        assert enable or not result[-1][0]
    return result


class TB(Bench):
    """The block with a code when one is given."""

    @property
    def endless(self) -> int:
        """The longest time that can be set."""
        return (1 << len(self.dut.cfg_longest_cycles_i)) - 1

    async def begin(self, longest: int, age: int, on: int = ON, off: int = OFF) -> None:
        await self.start(
            enable_i=0, cfg_on_lsb_i=on, cfg_off_lsb_i=off, cfg_longest_cycles_i=longest, cfg_age_cycles_i=age,
            adc_valid_i=0, vdc_i=0,
        )  # fmt: skip

    async def clock(self, enable: int, code: int | None) -> tuple[int, int]:
        """Brake and overload after a clock."""
        self.dut.enable_i.value = enable
        self.dut.adc_valid_i.value = int(code is not None)
        self.dut.vdc_i.value = random.getrandbits(12) if code is None else code
        await self.clocks(CODE_TO_SWITCH)
        return int(self.dut.brake_o.value), int(self.dut.overload_o.value)


@cocotb.test
async def follows_the_model(dut: Any) -> None:
    """With constant thresholds, and with any: the lower one may be the one for "on"."""
    tb = TB(dut)
    seen = set()
    runs = [(longest, age, ON, OFF) for longest, age in ((0, 5), (1, 4), (7, 0), (12, 3), (40, 6), (tb.endless, 9))]
    runs += [(*random.choice(runs)[:2], random.getrandbits(12), random.getrandbits(12)) for _ in range(8)]
    for longest, age, on, off in runs:
        longest = min(longest, tb.endless)
        await tb.begin(longest, age, on, off)
        history: list[Clock] = []
        got: list[tuple[int, int]] = []
        enable, level = 1, (on + off) // 2
        for _ in range(400):
            enable = enable if random.random() < 0.98 else 1 - enable
            if random.random() < 0.15:
                edges = (off - 1, off, off + 1, on - 1, on, on + 1, 0, 4095)
                near = random.choice(edges) if random.random() < 0.6 else random.randint(*sorted((on, off)))
                level = min(max(near, 0), 4095)
            code = level if random.random() < 0.5 else None
            history.append((enable, code))
            got.append(await tb.clock(enable, code))
        for t, (is_, wanted) in enumerate(zip(got, expected(history, longest, age, on, off), strict=True)):
            assert is_ == wanted, f"longest {longest}, age {age}, on {on}, off {off}, clock {t}: {is_}, not {wanted}"
        seen |= set(got)
    assert seen == {(0, 0), (1, 0), (0, 1)}


@cocotb.test
async def each_bit_of_the_thresholds_counts(dut: Any) -> None:
    """A code that differs from a threshold in one bit is on its right side."""
    tb = TB(dut)
    for _ in range(10):
        threshold = random.getrandbits(12)
        for bit in range(12):
            code = threshold ^ 1 << bit
            await tb.begin(tb.endless, 10, on=threshold, off=0)
            assert await tb.clock(1, code) == (int(code > threshold), 0), f"on {threshold}, code {code}"
            await tb.begin(tb.endless, 10, on=0, off=threshold)
            await tb.clock(1, 4095)
            assert await tb.clock(1, code) == (int(code >= threshold and code > 0), 0), f"off {threshold}, code {code}"


@cocotb.test
async def a_link_that_stays_high_ends_after_the_longest_time(dut: Any) -> None:
    tb = TB(dut)
    await tb.begin(longest=50, age=20)
    for _ in range(2):
        on = [await tb.clock(1, 4095 if t % 10 == 0 else None) for t in range(500)]
        assert [brake for brake, _ in on] == [1] * 50 + [0] * 450
        assert [over for _, over in on] == [0] * 50 + [1] * 450
        assert await tb.clock(1, OFF) == (0, 1), "at the threshold is not below it"
        assert await tb.clock(1, OFF - 1) == (0, 0)


@cocotb.test
async def a_longer_time_comes_too_late(dut: Any) -> None:
    """Changed while the switch is on, the longest time counts at once; once it is over, only the link gives it back."""
    tb = TB(dut)
    await tb.begin(longest=20, age=5)
    for _ in range(10):
        assert await tb.clock(1, 4095) == (1, 0)
    dut.cfg_longest_cycles_i.value = 10
    assert await tb.clock(1, 4095) == (0, 1)
    dut.cfg_longest_cycles_i.value = tb.endless
    for _ in range(10):
        assert await tb.clock(1, 4095) == (0, 1)
    assert await tb.clock(1, OFF - 1) == (0, 0)
    assert await tb.clock(1, 4095) == (1, 0)


@cocotb.test
async def pauses_give_the_resistor_nothing_back(dut: Any) -> None:
    """Switched off by enable or by missing samples, not by the link: the time goes on where it was."""
    tb = TB(dut)
    await tb.begin(longest=30, age=4)
    brake = [
        (await tb.clock(int(t % 50 != 25), 4095 if t % 10 in (0, 2) and t % 100 < 80 else None))[0] for t in range(900)
    ]
    assert sum(brake) == 30
    assert brake[0] == 1
    assert 0 in brake[:30]


@cocotb.test
async def samples_that_stop_turn_it_off(dut: Any) -> None:
    tb = TB(dut)
    for age in (1, 2, 17, 1000):
        await tb.begin(tb.endless, age=age)
        assert await tb.clock(1, ON + 1) == (1, 0)
        left = 0
        while left < age + 5 and (await tb.clock(1, None))[0]:
            left += 1
        assert left == age - 1
        later = [(await tb.clock(1, None))[0] for _ in range(5)]
        assert not any(later), "older than the counter of the age reaches: still off"
        assert await tb.clock(1, ON) == (0, 0), "a fresh code in the hysteresis does not turn it on"
        assert await tb.clock(1, ON + 1) == (1, 0)


@cocotb.test
async def the_age_in_full(dut: Any) -> None:
    """One age an octave, run out, and the largest: off at that clock and still after it."""
    tb = TB(dut)
    bits = len(dut.cfg_age_cycles_i)
    ages = [(1 << bit) + random.randrange((1 << bit) // 8 + 1) for bit in range(1, bits)]
    for age in (*ages, (1 << bits) - 1):
        await tb.begin(tb.endless, age=age)
        assert await tb.clock(1, ON + 1) == (1, 0)
        dut.adc_valid_i.value = 0
        passed = await tb.sleep(age, FallingEdge(dut.brake_o))
        assert passed == age, f"age {age}: {passed} clocks"
        later = [await tb.clock(1, None) for _ in range(30)]
        assert later == [(0, 0)] * 30


@cocotb.test
async def the_longest_time_in_full(dut: Any) -> None:
    """One time an octave, run out, up to 2^21 clocks and an eighth more."""
    tb = TB(dut)
    for bit in range(1, min(len(dut.cfg_longest_cycles_i), 22)):
        longest = (1 << bit) + random.randrange((1 << bit) // 8 + 1)
        await tb.begin(longest, age=10)
        assert await tb.clock(1, 4095) == (1, 0)
        dut.vdc_i.value = 4095
        passed = await tb.sleep(longest, FallingEdge(dut.brake_o))
        assert passed == longest, f"longest time {longest}: {passed} clocks"
        assert dut.overload_o.value == 1


@cocotb.test
async def all_bits_of_the_longest_time_count(dut: Any) -> None:
    tb = TB(dut)
    await tb.begin(tb.endless, age=10)
    assert await tb.clock(1, 4095) == (1, 0)
    dut.used_q.value = tb.endless - 3
    on = [await tb.clock(1, 4095) for _ in range(20)]
    assert [brake for brake, _ in on] == [1] * 3 + [0] * 17
    dut.rst_i.value = 1
    assert await tb.clock(1, 4095) == (0, 0)
    dut.rst_i.value = 0
    assert await tb.clock(1, 4095) == (1, 0)


@pytest.mark.parametrize(("width", "testcase"), [(32, None), (1, "follows_the_model")])
def test_fl_brake(width: int, testcase: str | None) -> None:
    """Thresholds, longest on-time, age of the samples, enable and reset.

    Verifies: SAFE-17, SAFE-18
    """
    run_block_test("fl_brake", ["safety/fl_brake.sv"], __name__, parameters={"LongestWidth": width}, testcase=testcase)
