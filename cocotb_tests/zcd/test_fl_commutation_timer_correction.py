# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Commutation timer: correction A."""

from __future__ import annotations

import random
from dataclasses import replace
from itertools import pairwise
from typing import Any

import cocotb

from cocotb_tests.zcd.timer_bench import (
    CORRECTION_LATENCY,
    GATE,
    MASK32,
    OFF,
    SATURATED,
    TB,
    TIMER_SOURCES,
    Settings,
    diff,
)
from fluxlock.cosim.block import run_block_test


def corrected_delay(settings: Settings, t0: int, t1: int, t2: int) -> float:
    """Thesis ch. 2: (-t[n] + t[n-1] + 3 t[n-2]) / 6 less the advance, with the general delay, limited."""
    delay = t0 * float(settings.fraction) + (-4 * t0 + t1 + 3 * t2) / 6
    return min(max(delay, 0.0), float(t0))


@cocotb.test()
@cocotb.parametrize(seed=list(range(4)))
async def correction_a(dut: Any, seed: int) -> None:
    """Random intervals, misses, late crossings, direction changes: the thesis' delay exactly where it may be used.

    Verifies: COMM-12
    """
    rng = random.Random(seed)
    tb = TB(dut)
    await tb.start(Settings(mode=OFF))
    reverse = 0
    settings = Settings(correction_a=1, timeout_q12=0x1C00, forced_interval=2000)
    await tb.update(settings)
    t = tb.now() + 300
    good: list[int] = []  # times of good crossings in a row
    last: int | None = None
    corrected = plain = 0
    for i in range(90):
        event = rng.random()
        if event < 0.04:
            reverse = 1 - reverse
            good = []
        if rng.random() < 0.2:
            settings = replace(settings, correction_a=rng.randrange(2), advance_q16=rng.choice([0, 0x2000, -0x1000]))
        settings = replace(settings, reverse=reverse)
        await tb.update(settings)
        late = rng.random() < 0.06
        back = late and rng.random() < 0.5
        await tb.until(t + 20)
        count = len(tb.comms)
        await tb.crossing(t, late=late, back=back)
        interval = settings.forced_interval if last is None else t - last
        good = [*good, t] if not late or back else []
        if late and not back:
            good = []
        use = settings.correction_a and len(good) >= 4
        if use:
            t0, t1, t2 = (good[-1 - k] - good[-2 - k] for k in range(3))
            wanted = t + corrected_delay(settings, t0, t1, t2)
        else:
            wanted = t + settings.delay(interval)
        await tb.until(max(round(wanted), tb.now()) + 12)
        assert len(tb.comms) == count + 1
        off = diff(tb.comms[-1].sched, round(wanted) & MASK32)
        assert abs(off) <= (1 if use else 0), f"seed {seed}, crossing {i}: off by {off}, corrected {use}"
        snap = await tb.snapshot()
        assert int(dut.snap_corrected_o.value) == int(bool(use)), f"crossing {i}: {good}"
        corrected += bool(use)
        plain += not use
        last = t
        if rng.random() < 0.04:  # a miss: the timeout commutates and assumes a crossing an interval after the last
            await tb.until(tb.comms[-1].gate + settings.timeout(interval) + 5)
            assert len(tb.comms) == count + 2
            assert snap["interval"] == (interval if i else SATURATED)
            known = i > 0
            last = t + interval if known else t
            good = []
            t = tb.now() + 300
            if not known:
                last = None
            continue
        t += max(1400 + rng.randrange(-250, 250), diff(tb.now(), t) + 30)
    assert corrected > 20 and plain > 10


@cocotb.test()
async def correction_a_is_neutral(dut: Any) -> None:
    """Equal intervals give half an interval to a clock, at any speed; a pattern of three gives even commutations.

    Verifies: COMM-12
    """
    tb = TB(dut)
    for scale in (200, 5000, 300_000):
        await tb.start(Settings(mode=OFF)) if scale == 200 else await tb.update(Settings(mode=OFF))
        await tb.update(Settings(correction_a=1, timeout_q12=0xFFFF, forced_interval=scale))
        # Position errors that sum to zero over three crossings (Yang 2020): 2, -3, 1 % of an interval.
        errors = [round(scale * e) for e in (0.02, -0.03, 0.01)]
        base = tb.now() + 50
        comms: list[int] = []
        for i in range(14):
            for pattern in [errors if i >= 6 else [0, 0, 0]]:
                t = base + scale * i + pattern[i % 3]
            await tb.until(t + 15)
            await tb.crossing(t)
            await tb.until(t + scale - scale // 8 - 15)
            comms.append(tb.comms[-1].sched)
            if 4 <= i < 6:
                assert abs(diff(comms[-1], (t + scale // 2) & MASK32)) <= 1 + scale * 4e-6
        steps = [diff(b, a) for a, b in pairwise(comms[10:])]
        assert all(abs(s - scale) <= 2 for s in steps), f"commutations {steps} apart, wanted {scale}"


@cocotb.test()
async def correction_a_latency(dut: Any) -> None:
    """With the correction an overdue commutation comes a constant number of clocks after its crossing.

    Verifies: COMM-12, COMM-03
    """
    tb = TB(dut)
    await tb.start(Settings(correction_a=1, timeout_q12=0xFFFF))
    t = tb.now() + 50
    for i in range(8):
        now = tb.now()
        late = i >= 4
        await tb.until(t + (900 if late else 20))
        now = await tb.crossing(t)
        await tb.until(max(t + 560, now + 30))
        if late:
            assert tb.comms[-1].overdue and tb.comms[-1].gate == now + CORRECTION_LATENCY + GATE
        t += 1000


def test_fl_commutation_timer_correction() -> None:
    """Commutation timer: correction A."""
    run_block_test("timer_bench", TIMER_SOURCES, __name__)
