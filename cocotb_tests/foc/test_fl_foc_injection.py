# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What the injection path needs of fl_foc: turn of Park, pause for a filtered current, skipped step, added voltage."""

from __future__ import annotations

import random
from typing import Any

import cocotb
import pytest

from cocotb_tests.foc.foc_bench import FULL_SCALE, LATENCY, SOURCES, TB, TURN, Pair, clip, pack, park, phases_of, unpack
from cocotb_tests.foc.test_fl_foc import draw, pair, seeded
from fluxlock.cosim.block import run_block_test

FIRST_LATENCY = {3: 14, 5: 18}  # clocks, published by the module
PAUSE_CLOCKS = 3


async def run(
    tb: TB, currents: list[int], theta: int, turn: int, lead: int, pause: int, skip: int, inject: list[Pair]
) -> tuple[Pair, Pair]:
    """One run; the current that was measured in subspace 1, and the one given in its place in the one clock for it."""
    dut = tb.dut
    tb.configure()
    dut.current_i.value = pack(currents, 18)
    dut.theta_i.value, dut.park_i.value, dut.lead_i.value = theta % TURN, turn % TURN, lead % TURN
    dut.pause_i.value, dut.skip_i.value = pause, skip
    dut.inject_i.value = pack([x for v in inject for x in v], 18)
    dut.start_i.value = 1
    await tb.clocks(1)
    for name in ("start", "park", "pause", "skip", "inject", "current", "theta", "lead"):
        getattr(dut, f"{name}_i").value = 0
    d, q = (random.randrange(-FULL_SCALE, FULL_SCALE) for _ in range(2))
    measured = (0, 0)
    latency = LATENCY[tb.phases] + (pause + PAUSE_CLOCKS if pause else 0)
    for clock in range(1, latency):
        assert int(dut.valid_o.value) == 0 and int(dut.busy_o.value) == 1, f"clock {clock}"
        if int(dut.first_o.value):
            assert clock == FIRST_LATENCY[tb.phases], f"current after {clock} clocks"
            measured = tuple(unpack(int(dut.current_o.value), 18, 2))
        there = clock == FIRST_LATENCY[tb.phases] + pause
        dut.filtered_i.value = pack((d, q) if there else (~d, ~q), 18)
        await tb.clocks(1)
    assert int(dut.valid_o.value) == 1, f"not done after {latency} clocks"
    return measured, (d, q)


@cocotb.test()
async def steps_follow_the_contract(dut: Any) -> None:
    """Random runs with every combination; regulators bit by bit, transforms within 1 LSB, clocks as published.

    Verifies: FOC-12
    """
    rng = seeded(dut)
    random.seed(rng.getrandbits(32))
    tb = TB(dut)
    await tb.start()
    for n in range(1200):
        if n % 10 == 0:
            for r in tb.regulators:
                r.shift = rng.randrange(8, 18)
                r.gain, r.hold, r.ratio = pair(rng), pair(rng), pair(rng)
                r.limit = rng.randrange(1, FULL_SCALE // 2)
                r.enable = int(rng.random() < 0.9)
        for r in tb.regulators:
            r.preset, r.forward, r.reference = pair(rng, 16), pair(rng, 12), pair(rng)
        currents = [draw(rng, 17) for _ in range(tb.phases)]
        theta, turn, lead = (rng.randrange(TURN) for _ in range(3))
        pause, skip = rng.choice([0, 0, 2, 26, 1, 31]), int(n % 10 > 0 and rng.random() < 0.5)
        inject = [rng.choice([(0, 0), pair(rng, 16)]) for _ in tb.regulators]
        measured, filtered = await run(tb, currents, theta, turn, lead, pause, skip, inject)
        out = tb.outputs()
        context = f"run {n}, pause {pause}, skip {skip}: {tb.regulators}, {out}"
        vectors = [measured, *out.current[1:]]
        for s, vector in enumerate(vectors):
            exact = park(currents, (theta + turn) % TURN, 1 + 2 * s)
            for value, real in zip(vector, (exact.real, exact.imag), strict=True):
                assert abs(value - max(-FULL_SCALE, min(FULL_SCALE - 1, real))) <= 1.0, f"{vector}, {exact}: {context}"
        assert out.current[0] == (filtered if pause else measured), context
        for s, r in enumerate(tb.regulators):
            if s or not skip:
                r.step(out.current[s])
            assert (out.state[s], out.limited[s]) == (r.state, r.limited), f"subspace {s}: {context}"
            assert out.applied[s] == r.applied(0), f"subspace {s}: {context}"
        vectors_v = [
            complex(*(clip(v + x, 18) for v, x in zip(r.applied(0), added, strict=True)))
            for r, added in zip(tb.regulators, inject, strict=True)
        ]
        for value, real in zip(out.voltage, phases_of(vectors_v, theta + lead, tb.phases), strict=True):
            assert abs(value - max(-FULL_SCALE, min(FULL_SCALE - 1, real))) <= 1.0, context
        await tb.clocks(3)
        assert int(dut.busy_o.value) == 0


@pytest.mark.parametrize("phases", [3, 5])
def test_fl_foc_injection(phases: int) -> None:
    """Runs with what the injection path asks for."""
    run_block_test("fl_foc", SOURCES, __name__, parameters={"Phases": phases})
