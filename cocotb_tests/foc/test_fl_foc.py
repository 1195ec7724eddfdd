# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Current control: transforms against floating point, regulators against integers, the loop against its theory."""

from __future__ import annotations

import random
from typing import Any

import cocotb
import pytest

from cocotb_tests.foc.foc_bench import FULL_SCALE, GO_LATENCY, SOURCES, TB, TURN, Pair, park, phases_of
from cocotb_tests.measured import measured
from fluxlock.cosim.block import run_block_test


def draw(rng: random.Random, bits: int) -> int:
    """Signed number: extremes, uniform, and small ones."""
    top = 1 << (bits - 1)
    small = 1 << rng.randint(1, bits - 1)
    return rng.choice(
        [-top, top - 1, 0, rng.randrange(-top, top), rng.randrange(-top, top), rng.randrange(-small, small)]
    )


def pair(rng: random.Random, bits: int = 18) -> Pair:
    return draw(rng, bits), draw(rng, bits)


def seeded(dut: Any) -> random.Random:
    seed = random.randrange(1 << 32)
    dut._log.info("seed %d", seed)
    return random.Random(seed)


@cocotb.test()
async def transforms_are_within_one_lsb(dut: Any) -> None:
    """Phase currents to i and v to phase voltages, over random vectors, angles and leads; constant latency.

    Verifies: FOC-03, FOC-06
    """
    rng = seeded(dut)
    tb = TB(dut)
    await tb.start()
    tb.bypass = 1
    worst_i = worst_v = 0.0
    for _ in range(3000):
        currents = [draw(rng, 18) for _ in range(tb.phases)]
        theta = rng.choice([rng.randrange(TURN), rng.randrange(16) << 28])
        lead = rng.choice([0, rng.randrange(-TURN // 2, TURN // 2), rng.randrange(-TURN // 8, TURN // 8)])
        for regulator in tb.regulators:
            regulator.forward = pair(rng)
        out = await tb.run(currents, theta, lead)
        context = f"currents {currents}, theta {theta}, lead {lead}"
        for s, got in enumerate(out.current):
            exact = park(currents, theta, 1 + 2 * s)
            for value, real in zip(got, (exact.real, exact.imag), strict=True):
                expected = max(-FULL_SCALE, min(FULL_SCALE - 1, real))
                assert abs(value - expected) <= 1.0, f"subspace {s}: {got} instead of {exact}: {context}"
                worst_i = max(worst_i, abs(value - expected))
        assert out.applied == [r.forward for r in tb.regulators]
        voltages = phases_of([complex(*r.forward) for r in tb.regulators], theta + lead, tb.phases)
        for value, real in zip(out.voltage, voltages, strict=True):
            expected = max(-FULL_SCALE, min(FULL_SCALE - 1, real))
            assert abs(value - expected) <= 1.0, f"{out.voltage} instead of {voltages}: {context}, {out.applied}"
            worst_v = max(worst_v, abs(value - expected))
    dut._log.info("worst error: currents %.3f LSB, voltages %.3f LSB", worst_i, worst_v)
    measured("current_lsb", worst_i)
    measured("voltage_lsb", worst_v)
    assert min(worst_i, worst_v) > 0.5, "the vectors miss what happens"


@cocotb.test()
@cocotb.parametrize(limits=[(FULL_SCALE - 1, FULL_SCALE - 1), (1, FULL_SCALE - 1)])
async def regulators_are_exact(dut: Any, limits: tuple[int, int]) -> None:
    """Errors, recurrence, limit and its carry, saturation, preset, feed-forward equal the contract in integers.

    Verifies: FOC-04, FOC-05, FOC-06
    """
    rng = seeded(dut)
    tb = TB(dut)
    await tb.start()
    limited = free = saturated = 0
    for n in range(2500):
        if n % 10 == 0:
            tb.bypass = int(rng.random() < 0.1)
            for r in tb.regulators:
                # Gains from those that hardly move the state to those that saturate it.
                r.shift = rng.choice([0, 31, rng.randrange(32), rng.randrange(8, 18), rng.randrange(8, 18)])
                r.gain, r.hold, r.ratio = pair(rng), pair(rng), pair(rng)
                r.limit = (
                    rng.choice([limits[0], limits[1], rng.randint(*limits)]) if limits[0] < limits[1] else limits[0]
                )
                r.enable = int(rng.random() < 0.9)
        for r in tb.regulators:
            r.preset, r.forward = pair(rng), pair(rng, rng.choice([18, 12]))
            r.reference = pair(rng)
        out = await tb.run([draw(rng, 18) for _ in range(tb.phases)], rng.randrange(TURN))
        for s, r in enumerate(tb.regulators):
            context = f"run {n}, subspace {s}: {r}, current {out.current[s]}"
            r.step(out.current[s])
            assert out.state[s] == r.state, f"{out.state[s]} instead of {r.state}: {context}"
            assert out.limited[s] == r.limited, context
            assert out.applied[s] == r.applied(tb.bypass), context
            limited += r.limited
            free += not r.limited
            saturated += FULL_SCALE - 1 in map(abs, r.error)
    assert min(limited, free, saturated) > 100, f"{limited} limited, {free} free, {saturated} errors saturated"


@cocotb.test()
async def limit_is_exact_everywhere(dut: Any) -> None:
    """Circle limit over lengths from 0 to the largest preset and around u_max, for every direction.

    Verifies: FOC-05
    """
    rng = seeded(dut)
    tb = TB(dut)
    await tb.start()
    for _ in range(2500):
        for r in tb.regulators:
            r.enable = 0
            r.limit = rng.choice([0, 1, FULL_SCALE - 1, rng.randrange(FULL_SCALE), rng.randrange(1, 100)])
            r.preset = pair(rng) if rng.random() < 0.5 else (r.limit + rng.randint(-2, 2), rng.randint(-3, 3))
            r.preset = (min(r.preset[0], FULL_SCALE - 1), r.preset[1])
        out = await tb.run([0] * tb.phases, 0)
        for s, r in enumerate(tb.regulators):
            r.step(out.current[s])
            assert out.state[s] == r.state and out.limited[s] == r.limited, f"{r}: {out}"
            length = abs(complex(*out.state[s])) / 256
            assert length < r.limit + 1.5, f"{length} beyond {r.limit}"


@cocotb.test()
async def takes_over_without_a_step(dut: Any) -> None:
    """A regulator that is enabled continues from its preset and from the error before.

    An error that stands gives no kick: with g = h nothing moves, else only its integral, (g - h) e a step.

    Verifies: FOC-06
    """
    tb = TB(dut)
    await tb.start()
    for r in tb.regulators:
        r.gain = r.hold = (60_000, 10_000)
        r.shift, r.enable = 8, 0
        r.preset, r.reference = (30_000, -20_000), (500, -300)
    for _ in range(3):
        out = await tb.run([100] * tb.phases, 0)
    for r in tb.regulators:
        r.enable = 1
    for _ in range(3):
        out = await tb.run([100] * tb.phases, 0)
        assert out.applied == [(30_000, -20_000)] * tb.subspaces
    for r in tb.regulators:
        r.enable, r.hold = 0, (59_000, 10_500)
    await tb.run([100] * tb.phases, 0)
    for r in tb.regulators:
        r.enable = 1
    for k in range(1, 4):
        out = await tb.run([100] * tb.phases, 0)
        # (1000 - 500j) (500 - 300j) 2^-8
        moved = complex(k * round(350_000 / 256), k * round(-550_000 / 256))
        wanted = (30_000 * 256 + round(moved.real), -20_000 * 256 + round(moved.imag))
        assert out.state == [wanted] * tb.subspaces, f"step {k}"


@cocotb.test()
async def start_while_busy_is_counted(dut: Any) -> None:
    """A start at any clock of a run changes nothing but the count; the next is taken 3 clocks after valid_o.

    Verifies: FOC-07
    """
    tb = TB(dut)
    await tb.start()
    tb.bypass = 1
    for r in tb.regulators:
        r.forward = (50_000, 20_000)
    currents = [30_000 - 20_000 * k for k in range(tb.phases)]
    good = await tb.run(currents, TURN // 3)
    for after in range(1, tb.spacing):
        dut.current_i.value = sum((x & 0x3FFFF) << 18 * i for i, x in enumerate(currents))
        dut.theta_i.value, dut.lead_i.value = TURN // 3, 0
        dut.start_i.value = 1
        await tb.clocks(1)
        dut.current_i.value = dut.theta_i.value = 0
        dut.start_i.value = 0
        if after > 1:
            await tb.clocks(after - 1)
        dut.start_i.value = 1
        await tb.clocks(1)
        dut.start_i.value = 0
        if after < tb.latency - 1:
            await tb.clocks(tb.latency - 1 - after)
            assert int(dut.valid_o.value) == 1, f"start in clock {after}"
        if after < tb.spacing - 1:
            await tb.clocks(tb.spacing - max(after + 1, tb.latency))
        assert int(dut.busy_o.value) == 0
        got = tb.outputs()
        assert (got.voltage, got.current) == (good.voltage, good.current), f"start in clock {after}"
        assert int(dut.overrun_o.value) == after
    for _ in range(3):
        assert (await tb.run(currents, TURN // 3)).voltage == good.voltage
    await tb.clocks(1)
    assert int(dut.valid_o.value) == 0 and int(dut.overrun_o.value) == tb.spacing - 1


@cocotb.test()
async def core_is_the_regulator(dut: Any) -> None:
    """Direct: the currents wait, the voltage of the core is limited, turned back and applied, however late it comes.

    Regulators, their settings and presets do not count. An answer for another run is ignored.

    Verifies: FOC-11
    """
    rng = seeded(dut)
    tb = TB(dut)
    await tb.start()
    limited = 0
    for n in range(1000):
        for r in tb.regulators:
            r.enable, r.limit = rng.randrange(2), rng.choice([FULL_SCALE - 1, rng.randint(1, FULL_SCALE - 1)])
            r.shift, r.gain, r.hold, r.ratio = rng.randrange(32), pair(rng), pair(rng), pair(rng)
            r.reference, r.preset, r.forward = pair(rng), pair(rng), pair(rng, rng.choice([18, 12]))
        currents = [draw(rng, 18) for _ in range(tb.phases)]
        theta, lead = rng.randrange(TURN), rng.randrange(-TURN // 8, TURN // 8)
        await tb.begin(currents, theta, lead)
        number = int(dut.number_o.value)
        assert number == (n + 1) % 65536
        got = tb.outputs().current
        for s, value in enumerate(got):
            exact = park(currents, theta, 1 + 2 * s)
            for x, real in zip(value, (exact.real, exact.imag), strict=True):
                assert abs(x - max(-FULL_SCALE, min(FULL_SCALE - 1, real))) <= 1.0, f"{got} instead of {exact}"
        await tb.clocks(rng.choice([0, 1, rng.randrange(30)]))
        if rng.random() < 0.3:
            await tb.answer([pair(rng, 28) for _ in tb.regulators], number + rng.choice([-1, 1, 1 << 15]))
            await tb.clocks(rng.randrange(5))
        assert (int(dut.waiting_o.value), int(dut.valid_o.value)) == (1, 0)
        wanted = [pair(rng, 28) for _ in tb.regulators]
        await tb.answer(wanted, number)
        assert int(dut.waiting_o.value) == 0
        await tb.clocks(GO_LATENCY[tb.phases] - 2)
        assert int(dut.valid_o.value) == 0
        await tb.clocks(1)
        assert int(dut.valid_o.value) == 1
        out = tb.outputs()
        for s, r in enumerate(tb.regulators):
            r.bound(wanted[s])
            assert (out.state[s], out.limited[s]) == (r.state, r.limited), f"run {n}: {wanted[s]}, {r}"
            assert out.applied[s] == r.applied(0)
            limited += r.limited
        assert out.current == got
        exact_v = phases_of([complex(*v) for v in out.applied], theta + lead, tb.phases)
        for value, real in zip(out.voltage, exact_v, strict=True):
            assert abs(value - max(-FULL_SCALE, min(FULL_SCALE - 1, real))) <= 1.0, f"{out.voltage}, {exact_v}"
        await tb.clocks(tb.spacing - tb.latency)
        assert int(dut.busy_o.value) == 0
    assert limited > 200


@cocotb.test()
async def late_core_is_left_behind(dut: Any) -> None:
    """A direct run that is abandoned in any clock ends without results; its answer does nothing to the next run.

    Without direct_i nothing is abandoned.

    Verifies: FOC-11
    """
    rng = seeded(dut)
    tb = TB(dut)
    await tb.start()
    for r in tb.regulators:
        r.forward = (50_000, 20_000)
    wanted = [(1 << 20, -(1 << 21))] * tb.subspaces
    currents = [30_000 - 20_000 * k for k in range(tb.phases)]
    for after in [*range(GO_LATENCY[tb.phases]), None]:
        await tb.begin(currents, TURN // 3)
        number = int(dut.number_o.value)
        if after is not None:
            await tb.clocks(rng.randrange(4))
            dut.abandon_i.value = int(after == 0)
            await tb.answer(wanted, number)
            if after > 0:
                await tb.clocks(after - 1)
                dut.abandon_i.value = 1
                await tb.clocks(1)
        else:
            dut.abandon_i.value = 1
            await tb.clocks(1)
        dut.abandon_i.value = 0
        assert (int(dut.busy_o.value), int(dut.valid_o.value)) == (0, 0), f"abandoned {after} clocks after the answer"
        for _ in range(3):
            assert int(dut.valid_o.value) == 0
            await tb.clocks(1)
        await tb.begin(currents, TURN // 3)
        await tb.answer([(0, 0)] * tb.subspaces, number)
        await tb.clocks(3)
        assert int(dut.waiting_o.value) == 1, "an answer to the run before was taken"
        await tb.answer(wanted, number + 1)
        await tb.clocks(GO_LATENCY[tb.phases] - 1)
        assert int(dut.valid_o.value) == 1 and tb.outputs().state == wanted
        await tb.clocks(tb.spacing - tb.latency)
    dut.direct_i.value = 0
    tb.bypass = 1
    dut.abandon_i.value = 1
    out = await tb.run(currents, TURN // 3)
    assert out.applied == [(50_000, 20_000)] * tb.subspaces


@pytest.mark.parametrize("phases", [3, 5])
def test_fl_foc(phases: int) -> None:
    """Current control block test for both phase counts."""
    run_block_test("fl_foc", SOURCES, __name__, parameters={"Phases": phases})
