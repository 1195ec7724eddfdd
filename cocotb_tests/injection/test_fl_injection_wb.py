# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Injection on the vector path through registers: wave on the legs, results, current and steps of the regulators."""

from __future__ import annotations

import math
import random
from dataclasses import dataclass
from typing import Any

import cocotb
import pytest

from cocotb_tests.foc.foc_bench import FULL_SCALE, TURN, Pair, Regulator, clip, park
from cocotb_tests.foc.test_fl_foc_wb import CARRIER, CHAIN_REGISTERS, ONCE, SOURCES, TB, Settings, signed, wave, widths
from cocotb_tests.injection.models import Filter, IqBits, LockInBits, square
from fluxlock.cosim.block import run_block_test

LOCK_IN, _, IQ, SEPARATOR = range(4)
PAUSE = {LOCK_IN: 22, SEPARATOR: 5}  # clocks on top of the latency, published
PERIOD, OFFSET = 600, 60  # clocks
AMPLITUDE = (20_000, -6_000)  # d, q


@dataclass
class Found:
    """Snapshot of the injection."""

    re: Pair
    im: Pair
    theta: int
    results: int
    count: int
    peak: int
    phase: int
    active: int
    hf: Pair


async def snapshot(tb: TB) -> Found:
    async def two(name: str) -> Pair:
        d, q = [signed(await tb.read(f"injection.{name}", i)) for i in range(2)]
        return d, q

    result, state = await tb.read("injection.snap_result"), await tb.read("injection.snap_state")
    assert await tb.read("injection.snap_faults") == 0
    return Found(
        re=await two("snap_re"),
        im=await two("snap_im"),
        theta=await tb.read("injection.snap_theta"),
        results=result & 0xFFFF,
        count=result >> 16 & 0xFFF,
        peak=result >> 30 & 1,
        phase=state & 0xFFF,
        active=state >> 31,
        hf=await two("snap_hf"),
    )


async def configure(tb: TB, method: int, remove: int, period: int, band: Filter, low: Filter, shift: int) -> None:
    """Everything but enable, which comes with the returned word of control."""
    await tb.write("injection.control", method << 1 | remove << 3)
    await tb.write("injection.wave", period | period // 4 << 16)
    await tb.write("injection.rate", round(2**36 / (period * PERIOD)))
    await tb.write("injection.filter", shift | band.fine << 8 | low.fine << 9)
    for i, value in enumerate((*AMPLITUDE, -AMPLITUDE[1], AMPLITUDE[0])):
        await tb.write("injection.amplitude", value, i)
    for name, form in (("band", band), ("low", low)):
        for part in ("a1", "a2", "g"):
            await tb.write(f"injection.{name}_{part}", getattr(form, part))
    await tb.write("injection.band_k", band.k)


async def check_wave(tb: TB, modulator: Settings, forward: list[Pair], period: int) -> None:
    """Upper requests of a whole injection period against the square wave added to the forward voltage at angle 0."""
    updates = tb.times["update_o"][-2 * period - 1 :]
    for signs in ([square((k + n) % period, period) for k in range(period)] for n in range(period)):
        worst = 0.0
        for update, sign in zip(updates, signs, strict=False):
            vectors = []
            for s, v in enumerate(forward):
                d, q = AMPLITUDE if s == 0 else (-AMPLITUDE[1], AMPLITUDE[0])
                vectors.append(complex(clip(v[0] + sign * d, 18), clip(v[1] + sign * q, 18)))
            volts = [
                round(
                    sum(
                        (v * complex(math.cos(a), math.sin(a))).real
                        for v, a in ((v, -2 * math.pi * (1 + 2 * s) * x / tb.phases) for s, v in enumerate(vectors))
                    )
                )
                for x in range(tb.phases)
            ]
            exact = [width for _, width in widths(modulator, volts, [0] * tb.phases)]
            worst = max(worst, *(abs(a - b) for a, b in zip(tb.counts[update], exact, strict=True)))
        if worst <= 1.5 + 2.0 * modulator.scale:
            return
    raise AssertionError(f"no phase of the wave fits: {[tb.counts[u] for u in updates[:period]]}")


@cocotb.test()
@cocotb.parametrize(case=[(LOCK_IN, 0, 16), (LOCK_IN, 1, 16), (IQ, 1, 8), (SEPARATOR, 0, 4), (SEPARATOR, 1, 4)])
async def steps_and_results_follow_the_models(dut: Any, case: tuple[int, int, int]) -> None:
    """A tick every step: results bit by bit from the currents that were measured, the regulators from theirs.

    Verifies: INJ-21, INJ-22
    """
    method, remove, period = case
    rng = random.Random(random.randrange(1 << 32))
    tb = TB(dut)
    random_current = wave(rng, tb.phases)
    tb.current = lambda strobe: [x // 512 * 64 for x in random_current(strobe)]
    await tb.start(cfg_mode_i=ONCE, cfg_offset_i=OFFSET)
    modulator = Settings(period=PERIOD, full_scale_over_vdc=1.2)
    regulators = [
        Regulator(gain=(40_000, 300), hold=(39_000, 300), ratio=(100_000, 0), shift=14, limit=60_000)
        for _ in range(tb.subspaces)
    ]
    await tb.modulator(modulator)
    await tb.regulators(regulators)
    await tb.window(OFFSET, 0, OFFSET)
    turn = rng.randrange(TURN)
    await tb.write("foc.park", turn)
    await tb.control(source=1, enable=1, regulate=2**tb.subspaces - 1)
    await tb.settle()
    band, low = Filter.design(1 / max(period, 8), 1.0, 0.45), Filter.design(0.005, 1.0, math.sqrt(2))
    await configure(tb, method, remove, period, band, low, 2)
    await tb.clocks(3 * PERIOD)
    await tb.write("timer.tick_samples", 1)
    await tb.tick()
    await tb.write("injection.control", 1 | method << 1 | remove << 3 | 1 << 8)
    bits, sums = LockInBits(band, low, 2), IqBits(period)
    active, results, samples = 0, None, []
    zero: Pair | None = None
    last_state: list[tuple[Pair, Pair, Pair]] = []
    for step in range(5 * period + 6):
        tick = await tb.tick()
        got, found = await tb.snapshot(), await snapshot(tb)
        pauses = PAUSE[SEPARATOR if method == SEPARATOR else LOCK_IN] if remove and found.active else 0
        strobe = tick - 1 - tb.to_sync - pauses - tb.conversion
        assert strobe in tb.times["adc_strobe_o"], f"step {step}: {tick}, {tb.times['adc_strobe_o'][-2:]}"
        exact = park(tb.current(strobe), (got.theta_sample + turn) % TURN, 1)
        raw = (round(exact.real), round(exact.imag))
        if not remove:
            assert abs(complex(*got.current[0]) - exact) < 1.5
            raw = got.current[0]
        skipped = False
        if method == SEPARATOR and remove and found.active:
            # The voltage of this step begins one update after the sample's: at a zero crossing if that is odd.
            skipped = found.phase % 2 == 0
            if found.phase % 2 == 0:
                zero = raw
            wanted = zero if zero is not None else raw
            if step > 1:
                assert all(abs(a - b) <= 1 for a, b in zip(got.current[0], wanted, strict=True)), f"step {step}"
        elif remove and found.active:
            rest = tuple(clip(i - h, 18) for i, h in zip(raw, found.hf, strict=True))
            assert all(abs(a - b) <= 1 for a, b in zip(got.current[0], rest, strict=True)), f"step {step}: {got}"
        for s, r in enumerate(regulators):
            if step:
                r.state, r.error, r.carry = last_state[s]
                if s or not skipped:
                    r.step(got.current[s])
                assert got.state[s] == r.state, f"step {step}, subspace {s}: {got.state[s]}, {r}"
                assert got.applied[s] == r.applied(0)
            else:
                r.state, r.carry = got.state[s], (0, 0)
                d, q = (a - i for a, i in zip(r.reference, got.current[s], strict=True))
                r.error = (d, q)
        last_state = [(r.state, r.error, r.carry) for r in regulators]
        if not found.active:
            continue
        samples.append((found.phase, raw))
        fresh = results is not None and found.results != results
        results, active = found.results, active + 1
        if fresh:
            assert found.theta == got.theta_sample
        if method == LOCK_IN:
            assert fresh or step == 0
            if not remove:
                bits.step(raw)
                assert (found.re, found.hf) == ((bits.magnitude, bits.error), bits.hf), f"step {step}"
        elif method == IQ:
            model = sums.step(raw, found.phase, 0, 0)
            if active > period:
                assert fresh == (model is not None), f"step {step}"
            if model is not None and active > period:
                values, count = model
                assert found.count == count
                shown = (found.re[0], found.im[0], found.re[1], found.im[1])
                # Without the HF part the current is known to 1 LSB only.
                assert all(abs(a - b) <= 4 * count for a, b in zip(shown, values, strict=True)), f"{shown}, {values}"
        elif fresh and len(samples) > 3:
            (_, before), (peak, top), (_, after) = samples[-3:]
            assert (found.peak, found.phase % 2) == (int(peak == 3), 0)
            sign = -1 if found.peak else 1
            for value, t, b, a in zip(found.re, top, before, after, strict=True):
                assert abs(value - sign * (2 * t - b - a)) <= 4 * remove, f"step {step}: {found}, {samples[-3:]}"
            assert found.im == (0, 0)
    assert active > 4 * period
    # What the legs do: regulators off, a fixed voltage, angle 0.
    await tb.write("timer.tick_samples", 0)
    forward: list[Pair] = [(9_000, -4_000), (2_000, 1_000)][: tb.subspaces]
    for s, r in enumerate(regulators):
        r.forward = forward[s]
    await tb.regulators(regulators)
    await tb.control(bypass=1)
    await tb.settle()
    await tb.clocks((3 * period + 2) * PERIOD)
    await check_wave(tb, modulator, forward, period)
    # The end: after a whole period the voltage is the forward one alone.
    await tb.write("injection.control", method << 1 | remove << 3)
    await tb.clocks((period + 4) * PERIOD)
    last = [tb.counts[u] for u in tb.times["update_o"][-4:-1]]
    assert last[0] == last[1] == last[2]


@cocotb.test()
@cocotb.parametrize(case=[(0, 1, 1), (0, 1, -1), (0, -1, 1), (1, 1, 1), (1, 1, -1)])
async def dead_time_follows_the_edges(dut: Any, case: tuple[int, int, int]) -> None:
    """Currents with another sign at the edges than at the samples: the legs get back what they lose there.

    Verifies: INJ-24
    """
    double, rising, falling = case
    current, dead_time, updates = 10_048, 20, 16
    modulator = Settings(period=PERIOD, dead_time=dead_time, zone=0.01, band=0.05)
    tb = TB(dut)

    def at_the_edges(strobe: int) -> list[int]:
        """Sampled at OFFSET; a quarter of the carrier later the edge of its first half, and so on."""
        begins = [0, *(t for t in tb.times["update_o"] if t < strobe)]
        since = strobe - begins[-1]
        half = len(begins) % 2 if double else int(since > PERIOD // 2)
        sign = -1 if since < OFFSET + 20 else (rising, falling)[half]
        return [sign * current] * tb.phases

    tb.current = at_the_edges
    await tb.start(cfg_mode_i=CARRIER, cfg_spacing_i=40, cfg_offset_i=OFFSET)
    await tb.modulator(modulator)
    await tb.regulators([Regulator(limit=FULL_SCALE - 1) for _ in range(tb.subspaces)])
    await tb.window(OFFSET, 0, OFFSET)
    await tb.control(source=1, enable=1, bypass=1, double=double)
    await tb.settle()
    await configure(tb, IQ, 0, 4, Filter.design(0.1, 1.0, 0.45), Filter.design(0.005, 1.0, 1.4), 0)
    for i in range(4):
        await tb.write("injection.amplitude", 0, i)
    await tb.write("injection.control", 1 | IQ << 1 | 1 << 5)
    await tb.clocks(updates * PERIOD)
    halves = 2 if double else 1
    seen = [tb.counts[u] for u in tb.times["update_o"][-5:-1]]
    signs = [rising, falling] if double else [(rising + falling) / 2]
    wanted = {PERIOD // 2 // halves + round(sign * dead_time / halves) for sign in signs}
    assert {x for counts in seen for x in counts} == wanted, f"{seen} instead of {wanted}"
    # Without the wave the edges of a carrier period before say the same.
    await tb.write("injection.control", IQ << 1 | 1 << 5)
    await tb.clocks(updates * PERIOD)
    assert not int(dut.u_injection.active.value)
    seen = [tb.counts[u] for u in tb.times["update_o"][-5:-1]]
    assert {x for counts in seen for x in counts} == wanted, f"{seen} instead of {wanted} without a wave"
    # By the sampled currents, beyond the band.
    await tb.write("injection.control", 1 | IQ << 1)
    await tb.clocks(6 * PERIOD)
    seen = [tb.counts[u] for u in tb.times["update_o"][-3:-1]]
    wanted = {(PERIOD // 2 - dead_time) // halves}
    assert {x for counts in seen for x in counts} == wanted, f"{seen} instead of {wanted}"


@cocotb.test()
async def changed_settings_never_stop_the_steps(dut: Any) -> None:
    """Control of the injection written at any clock, also in a pause: every update has its step.

    Verifies: INJ-23
    """
    rng = random.Random(random.randrange(1 << 32))
    tb = TB(dut)
    tb.current = wave(rng, tb.phases)
    await tb.start(cfg_mode_i=ONCE, cfg_offset_i=20)
    await tb.modulator(Settings(period=400))
    await tb.regulators([Regulator(limit=FULL_SCALE - 1) for _ in range(tb.subspaces)])
    await tb.window(20, 0, 20)
    await tb.control(source=1, enable=1, regulate=1)
    await tb.settle()
    await configure(tb, LOCK_IN, 1, 4, Filter.design(0.1, 1.0, 0.45), Filter.design(0.005, 1.0, 1.4), 0)
    await tb.clocks(2000)
    updates, syncs = len(tb.times["update_o"]), len(tb.times["sync_o"])
    for _ in range(400):
        await tb.write("injection.control", rng.getrandbits(6) | rng.getrandbits(1) << 8)
        await tb.write(*rng.choice([("injection.wave", rng.getrandbits(32)), ("injection.delay", rng.randrange(8))]))
        await tb.clocks(rng.randrange(60))
    assert abs((len(tb.times["update_o"]) - updates) - (len(tb.times["sync_o"]) - syncs)) <= 1
    assert len(tb.times["update_o"]) - updates > 20


@cocotb.test()
@cocotb.parametrize(wrong=[(0, 0, 0), (1, 0, 0), (4, 4, 2), (4, 1, 4), (8, 4095, 2)])
async def no_wave_out_of_range(dut: Any, wrong: tuple[int, int, int]) -> None:
    """Period, first phase, delay: with one out of its range there is no wave, with right ones there is one again.

    Verifies: INJ-26
    """
    tb = TB(dut)
    await tb.start(cfg_mode_i=ONCE, cfg_offset_i=OFFSET)
    await tb.modulator(Settings(period=PERIOD))
    await tb.window(OFFSET, 0, OFFSET)
    await tb.control(source=1, enable=1, regulate=0)
    await tb.settle()
    await configure(tb, LOCK_IN, 0, 4, Filter.design(0.1, 1.0, 0.45), Filter.design(0.005, 1.0, 1.4), 0)
    await tb.write("timer.tick_samples", 1)
    for (period, first, delay), runs in ((wrong, 0), ((4, 1, 2), 1), (wrong, 0)):
        await tb.write("injection.wave", period | first << 16)
        await tb.write("injection.delay", delay)
        await tb.write("injection.control", 1)
        for _ in range(12):
            await tb.tick()
        assert await tb.read("injection.snap_state") >> 31 == runs, f"{period} {first} {delay}"


@pytest.mark.parametrize("phases", [3, 5])
def test_fl_injection_wb(phases: int) -> None:
    """Vector path with injection from codes to requests."""
    run_block_test(
        "fl_foc_chain",
        SOURCES,
        __name__,
        parameters={"Phases": phases},
        registers=CHAIN_REGISTERS,
        seen=["fl_injection_wb"],
    )
