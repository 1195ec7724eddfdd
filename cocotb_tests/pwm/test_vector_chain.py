# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Modulator, leg carriers and guard together: the vector rebuilt from the gates is the one asked for.

Ground truth is the levels at the pins and, with dead time, legs whose output follows the current while both switches
are off. Voltages are rebuilt by counting clocks; no number inside the chain is read.
"""

from __future__ import annotations

import cmath
import math
import random
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import cocotb
import numpy as np
import pytest
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, ReadOnly
from numpy.typing import NDArray

from cocotb_tests.foc.test_fl_modulator import FULL, Settings, pack
from cocotb_tests.measured import measured
from fluxlock.base.paths import ROOT
from fluxlock.cosim.block import run_block_test

RESET_WAIT = 1023  # clocks for which the guard holds everything off after a reset
Vector = Callable[[float], list[int]]  # clock to numbers of the phases
Levels = NDArray[np.int64]

SOURCES = [
    "foc/fl_modulator.sv",
    "pwm/fl_leg_carrier.sv",
    "safety/fl_gate_guard.sv",
    ROOT / "cocotb_tests" / "pwm" / "fl_vector_chain.sv",
]


class Trace:
    """One array a signal, one element a clock."""

    def __init__(self, words: Sequence[int], phases: int) -> None:
        self.phases = phases
        shift = 0
        self.data: dict[str, Levels] = {}
        fields = {"req_h": phases, "req_l": phases, "gate_h": phases, "gate_l": phases}
        fields |= {"update": 1, "start": 1, "second": 1, "fault": 1, "missed": 16, "count": 16}
        for name, width in fields.items():
            self.data[name] = np.array([(w >> shift) & ((1 << width) - 1) for w in words], dtype=np.int64)
            shift += width

    def __getattr__(self, name: str) -> Levels:
        return self.data[name]

    def leg(self, name: str, x: int) -> Levels:
        return (self.data[name] >> x) & 1

    def output(self, x: int, current: Levels) -> Levels:
        """Potential of a leg in vdc: of the switch that is on, else of the diode that carries the current."""
        high, low = self.leg("gate_h", x), self.leg("gate_l", x)
        assert not np.any(high & low), f"leg {x} shorts the link"
        return np.where(high == 1, 1, np.where(low == 1, 0, (current < 0).astype(np.int64)))

    def carriers(self) -> list[tuple[int, int]]:
        """First clock at the pins and the clock after the last of every whole carrier: the guard is one clock late."""
        return list(pairwise((np.flatnonzero(self.start) + 1).tolist()))


class TB:
    """Settings, a vector that depends on time, and a record."""

    def __init__(self, dut: Any) -> None:
        self.dut = dut
        self.phases = len(dut.v_q17_i.value) // 18

    async def start(self, s: Settings, dead_time: int = 2, **settings: int) -> None:
        inputs = {
            "enable_i": 0, "trip_i": 0, "sample_i": 0, "v_q17_i": 0, "i_q17_i": 0, "cfg_double_i": 0,
            "cfg_miss_limit_i": 0, "dead_time_i": dead_time, "rst_i": 1, **s.registers(), **settings,
        }  # fmt: skip
        for name, value in inputs.items():
            getattr(self.dut, name).value = value
        Clock(self.dut.clk_i, 20, "ns").start()
        for _ in range(3):
            await FallingEdge(self.dut.clk_i)
        self.dut.rst_i.value = 0
        for _ in range(RESET_WAIT + 10):
            await FallingEdge(self.dut.clk_i)
        self.dut.enable_i.value = 1

    async def run(self, cycles: int, v: Vector, i: Vector | None = None, late: int = 4) -> Trace:
        """Convert v and i of the update's clock `late` clocks after every update."""
        words: list[int] = []
        todo: dict[int, int] = {}
        update_bit = 4 * self.phases
        for clock in range(cycles):
            asked = todo.pop(clock, None)
            self.dut.sample_i.value = asked is not None
            if asked is not None:
                self.dut.v_q17_i.value = pack(v(asked), 18)
                self.dut.i_q17_i.value = pack(i(asked) if i else [0] * self.phases, 18)
            await ReadOnly()
            words.append(int(self.dut.trace_o.value))
            if words[-1] >> update_bit & 1:
                todo[clock + late] = clock
            await FallingEdge(self.dut.clk_i)
        return Trace(words, self.phases)


def rotating(amplitude: float, turns_per_clock: float, phases: int, phase: float = 0.0) -> Vector:
    """Sinusoids of the phases, units of 2^-17 of full scale."""

    def at(clock: float) -> list[int]:
        angle = 2 * math.pi * (turns_per_clock * clock + phase)
        return [round(FULL * amplitude * math.cos(angle - 2 * math.pi * x / phases)) for x in range(phases)]

    return at


def space_vector(values: Sequence[float], order: int = 1) -> complex:
    """Amplitude-invariant space vector of a subspace."""
    n = len(values)
    return 2 / n * sum(v * cmath.exp(2j * math.pi * order * x / n) for x, v in enumerate(values))


@cocotb.test()
@cocotb.parametrize(period=[400, 401])
async def vector_from_the_gates(dut: Any, period: int) -> None:
    """Volt-seconds of every leg and the vectors of all subspaces, carrier by carrier, from the requests."""
    tb = TB(dut)
    s = Settings(period=period, full_scale_over_vdc=1.25)
    await tb.start(s)
    wanted = rotating(0.42, 1 / 20000.3, tb.phases)
    trace = await tb.run(60 * period, wanted)
    checked = 0
    starts = np.flatnonzero(trace.start).tolist()
    for before, first, after in zip(starts[2:], starts[3:], starts[4:], strict=False):
        v = wanted(before)
        zero = (max(v) + min(v)) / 2
        counts = [int(trace.leg("req_h", x)[first:after].sum()) for x in range(tb.phases)]
        lower = [int(trace.leg("req_l", x)[first:after].sum()) for x in range(tb.phases)]
        assert after - first == period and all(h + w == period for h, w in zip(counts, lower, strict=True))
        for x in range(tb.phases):
            exact = period / 2 + (v[x] - zero) * s.scale
            assert abs(counts[x] - exact) <= 1.0, f"leg {x}: {counts[x]} clocks, exact {exact:.2f}"
        in_clocks = [c - period / 2 for c in counts]
        for order in (1, 3)[: tb.phases // 2]:
            got = space_vector(in_clocks, order)
            asked = space_vector([x * s.scale for x in v], order)
            # Every leg is off by half a clock at most, half a unit cancels.
            assert abs(got - asked) <= 1.0, f"subspace {order}: {got:.2f}, asked {asked:.2f} clocks"
        checked += 1
    assert checked > 50


def drawn(seed: int, amplitude: float, phases: int) -> Vector:
    """Another random vector at every clock, no longer than `amplitude` of full scale."""

    def at(clock: float) -> list[int]:
        rng = random.Random(f"{seed} {clock}")
        return rotating(amplitude * math.sqrt(rng.random()), 0.0, phases, rng.random())(clock)

    return at


@cocotb.test()
async def random_vectors_from_the_gates(dut: Any) -> None:
    """Random vectors of the first subspace to the edge of the polygon: rebuilt from the requests within a clock."""
    seed = cocotb.RANDOM_SEED
    dut._log.info("seed %d", seed)
    tb = TB(dut)
    period = 600
    s = Settings(period=period, full_scale_over_vdc=1.25)
    await tb.start(s)
    edge = 1 / math.sqrt(3) if tb.phases == 3 else 1 / (2 * math.cos(math.radians(18)))
    wanted = drawn(seed, 0.999 * edge / s.full_scale_over_vdc, tb.phases)
    trace = await tb.run(120 * period, wanted)
    starts = np.flatnonzero(trace.start).tolist()
    errors = []
    for before, first, after in zip(starts[2:], starts[3:], starts[4:], strict=False):
        counts = [int(trace.leg("req_h", x)[first:after].sum()) - period / 2 for x in range(tb.phases)]
        errors.append(abs(space_vector(counts) - space_vector([x * s.scale for x in wanted(before)])))
    dut._log.info("worst of %d vectors: %.3f clocks", len(errors), max(errors))
    measured("vector_clocks", max(errors))
    assert len(errors) > 100 and max(errors) <= 1.0


@cocotb.test()
async def double_update_follows_each_half(dut: Any) -> None:
    """With an update at the middle each half has the volt-seconds of its own vector, and the pulse is one piece."""
    tb = TB(dut)
    period = 500
    s = Settings(period=period, full_scale_over_vdc=1.25)
    await tb.start(s, cfg_double_i=1)
    wanted = rotating(0.4, 1 / 5000.7, tb.phases)
    trace = await tb.run(40 * period, wanted)
    updates = np.flatnonzero(trace.update).tolist()
    different = 0
    for before, first, after in zip(updates[4:], updates[5:], updates[6:], strict=False):
        assert after - first == period // 2
        v = wanted(before)
        zero = (max(v) + min(v)) / 2
        for x in range(tb.phases):
            level = trace.leg("req_h", x)[first:after]
            exact = (period / 2 + (v[x] - zero) * s.scale) / 2
            assert abs(int(level.sum()) - exact) <= 0.75, f"leg {x}: {level.sum()} clocks, exact {exact:.2f}"
            assert np.count_nonzero(np.diff(level)) <= 1
        different += int(trace.leg("req_h", 0)[first:after].sum()) != int(trace.leg("req_h", 0)[before:first].sum())
    assert different > 50, "the halves never differed"
    assert trace.missed[-1] == 0


@cocotb.test()
@cocotb.parametrize(double=[0, 1])
async def dead_time_is_given_back(dut: Any, double: int) -> None:
    """A leg's mean with dead time: off by the dead time without compensation, within one clock with it."""
    tb = TB(dut)
    period, dead = 800, 30
    s = Settings(period=period, full_scale_over_vdc=1.25, dead_time=dead, zone=0.001)
    wanted = rotating(0.3, 1 / 23171.7, tb.phases)
    flowing = rotating(0.25, 1 / 23171.7, tb.phases, phase=-0.09)
    found: dict[bool, list[tuple[float, int]]] = {}
    await tb.start(s, dead_time=dead, cfg_double_i=double)
    for compensated in (False, True):
        for name, value in (s if compensated else replace(s, dead_time=0)).registers().items():
            getattr(dut, name).value = value
        await tb.run(4 * period, wanted, flowing)
        trace = await tb.run(60 * period, wanted, flowing)
        clocks = range(len(trace.start))
        currents = np.array([flowing(c) for c in clocks]).T
        starts = np.flatnonzero(trace.start).tolist()
        found[compensated] = []
        for before, first, after in zip(starts[2:], starts[3:], starts[4:], strict=False):
            v = [wanted(before)]
            if double:
                v = [wanted(before + period // 2), wanted(first)]
            for x in range(tb.phases):
                # The current must not change its sign from the sample to the end of the carrier.
                part = currents[x][before - 1 : after + dead + 2]
                if np.abs(part).min() < 0.002 * FULL or np.ptp(np.sign(part)):
                    continue
                exact = float(np.mean([period / 2 + (u[x] - (max(u) + min(u)) / 2) * s.scale for u in v]))
                # The guard is one clock late, and so is every edge.
                on = int(trace.output(x, currents[x])[first + 1 : after + 1].sum())
                found[compensated].append((on - exact, int(np.sign(part[0]))))
    plain = [error * -sign for error, sign in found[False]]
    assert len(plain) > 100 and min(plain) > dead - 2.1 and max(plain) < dead + 2.1, "the bench shows no dead time"
    errors = [error for error, _ in found[True]]
    worst = max(errors, key=abs)
    dut._log.info("worst %.2f clocks of %d, mean %.3f", worst, len(errors), np.mean(errors))
    assert abs(worst) <= 1.0 + s.scale, f"{worst:.2f} clocks off with compensation"


@cocotb.test()
async def deadline_and_trip(dut: Any) -> None:
    """Vectors that come too late keep the old pulses and raise the fault; a trip turns the pins off at once."""
    tb = TB(dut)
    period = 300
    s = Settings(period=period, full_scale_over_vdc=1.25)
    await tb.start(s, cfg_miss_limit_i=3)
    constant = rotating(0.2, 0.0, tb.phases, 0.1)
    await tb.run(4 * period, constant)
    trace = await tb.run(8 * period, constant, late=10 * period)
    assert trace.fault[-1] and trace.missed[-1] >= 3
    counts = {tuple(int(trace.leg("gate_h", x)[a:b].sum()) for x in range(tb.phases)) for a, b in trace.carriers()}
    assert len(counts) == 1 and max(counts.pop()) > period // 2, "the old pulses did not go on"
    dut.trip_i.value = 1
    trace = await tb.run(2 * period, constant)
    assert not trace.gate_h[1:].any() and not trace.gate_l[1:].any()
    assert trace.req_h.any(), "nothing to trip"


@cocotb.test()
async def period_changes_with_its_compares(dut: Any) -> None:
    """Random changes of period and scale at any clock: every carrier has the duty that was asked for."""
    rng = random.Random(11)
    tb = TB(dut)
    periods = (300, 411, 523, 702)
    s = {p: Settings(period=p, full_scale_over_vdc=1.25) for p in periods}
    await tb.start(s[300])
    steady = rotating(0.3, 0.0, tb.phases, 0.05)
    v = steady(0)
    exact = [0.5 + (u - (max(v) + min(v)) / 2) * 1.25 / FULL for u in v]
    seen = set()
    for _ in range(25):
        period = rng.choice(periods)
        for name, value in s[period].registers().items():
            getattr(dut, name).value = value
        trace = await tb.run(rng.randrange(900, 2500), steady, late=rng.randrange(2, 200))
        starts = np.flatnonzero(trace.start).tolist()
        for first, after in pairwise(starts):
            if not trace.req_h[first] and not trace.req_l[first]:
                continue
            n = after - first
            assert n in periods
            seen.add(n)
            for x in range(tb.phases):
                on = int(trace.leg("req_h", x)[first:after].sum())
                assert abs(on - exact[x] * n) <= 1.0, f"carrier of {n}: leg {x} has {on} clocks, exact {exact[x] * n}"
    assert seen == set(periods)


@pytest.mark.parametrize("phases", [3, 5])
def test_vector_chain(phases: int) -> None:
    """The vector at the gates.

    Verifies: VPWM-02, VPWM-04, VPWM-07, VPWM-08, MOD-04
    """
    run_block_test("fl_vector_chain", SOURCES, __name__, parameters={"Phases": phases})


if __name__ == "__main__":
    pytest.main([__file__])
