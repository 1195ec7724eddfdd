# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Vector path through its registers: codes in, requests of the legs out, beside the models of its blocks.

The bench is the converter and the firmware: codes follow the time of the strobe, settings go over the bus, the snapshot
is read after every tick. Angles are an exact sum of the speeds in use.
"""

from __future__ import annotations

import itertools
import random
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import cocotb
import pytest
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, RisingEdge, Timer

from cocotb_tests.foc.foc_bench import FULL_SCALE, GO_LATENCY, TURN, Pair, Regulator, pack, park, phases_of, unpack
from cocotb_tests.foc.foc_bench import LATENCY as FOC_LATENCY
from cocotb_tests.foc.foc_bench import SOURCES as FOC_SOURCES
from cocotb_tests.foc.foc_bench import SPACING as FOC_SPACING
from cocotb_tests.foc.test_fl_modulator import Settings, widths
from cocotb_tests.injection.test_fl_injection_path import PATH_SOURCES
from cocotb_tests.sense.test_fl_current_window import mean
from cocotb_tests.soc.bench import request
from fluxlock.base.paths import ROOT
from fluxlock.cosim.block import run_block_test
from fluxlock.firmware.host import register_offsets

CLOCK_NS = 20
# From the codes of a window's only sample to the compares in the shadow registers: sensing, window, regulators,
# modulator, register. The mean of a window takes more.
CODES_TO_COMPARES = {3: 73, 5: 126}
MEAN_MORE = 7
CONTINUOUS, CARRIER, ONCE = 1, 2, 3  # fl_pkg::sched_mode_e
CHAIN_REGISTERS = ["timer", "foc", "injection"]
CHAIN_WINDOWS = [0x2, 0xC, 0xE]
SOURCES = [
    "soc/fl_bus_pkg.sv",
    "soc/fl_interval.sv",
    "soc/fl_timer.sv",
    "soc/fl_timer_wb.sv",
    "sense/fl_sample_scheduler.sv",
    "sense/fl_auto_zero.sv",
    "sense/fl_sense.sv",
    "sense/fl_current_window.sv",
    "foc/fl_angle_nco.sv",
    *FOC_SOURCES,
    "foc/fl_edge_current.sv",
    "foc/fl_modulator.sv",
    "pwm/fl_leg_carrier.sv",
    "soc/fl_vector_pkg.sv",
    "soc/fl_vector.sv",
    *(name for name in PATH_SOURCES if name not in FOC_SOURCES),
    "soc/fl_foc_wb.sv",
    "soc/fl_injection_wb.sv",
    ROOT / "cocotb_tests" / "foc" / "fl_foc_chain.sv",
]


def signed(value: int, bits: int = 32) -> int:
    value &= (1 << bits) - 1
    return value - (1 << bits) if value >> (bits - 1) else value


@dataclass
class Angle:
    """The accumulator: speeds and corrections with the clock from which they act."""

    clock: int = 0
    theta: int = 0  # 2^36 = one turn
    omega: int = 0
    past: list[tuple[int, int, int]] = field(default_factory=lambda: [(0, 0, 0)])

    def change(self, clock: int, omega: int, correction: int) -> None:
        """An update event in a clock: it still adds the speed of before."""
        self.theta += (clock + 1 - self.clock) * self.omega + (correction << 4)
        self.clock, self.omega = clock + 1, omega
        self.past.append((self.clock, self.theta, omega))

    def at(self, clock: int) -> int:
        """Angle in a clock, 2^32 = one turn."""
        start, theta, omega = next(entry for entry in reversed(self.past) if entry[0] <= clock)
        return ((theta + (clock - start) * omega) >> 4) % TURN


@dataclass
class Snapshot:
    """What the firmware reads after a tick."""

    current: list[Pair]
    applied: list[Pair]
    state: list[Pair]
    applied_sum: list[Pair]
    steps: int
    samples: int
    limited: int
    theta_sample: int
    theta_update: int
    omega: int
    stamp: int
    missed: int
    overruns: int
    encoder: int


class TB:
    """Converter, bus and a record of every pulse by the chip's own time."""

    def __init__(self, dut: Any) -> None:
        self.dut = dut
        self.phases = len(dut.req_h_o.value)
        self.subspaces = 2 if self.phases == 5 else 1
        self.channels = 2 * self.phases + 3
        self.offsets = register_offsets()
        self.conversion = 20
        self.current: Callable[[int], list[int]] = lambda strobe: [0] * self.phases
        self.times: dict[str, list[int]] = {
            name: [] for name in ("adc_strobe_o", "update_o", "sync_o", "tick_o", "event_o", "instant_o")
        }
        self.valids: list[int] = []
        self.instants: dict[int, int] = {}  # angle of the trace port
        self.counts: dict[int, list[int]] = {}  # clocks with the upper request until an update
        self.written: dict[str, int] = {}
        self.angle = Angle()
        self.to_sync = CODES_TO_COMPARES[self.phases] - 1

    @property
    def now(self) -> int:
        return int(self.dut.now_o.value)

    async def clocks(self, n: int) -> None:
        if n > 0:
            await Timer(n * CLOCK_NS, "ns")

    async def start(self, **ports: int) -> None:
        dut = self.dut
        inputs = {"block_i": 0, "req_i": 0, "stb_i": 0, "adc_valid_i": 0, "adc_code_i": 0, "rst_i": 1}
        settings = {"cfg_mode_i": ONCE, "cfg_spacing_i": 16, "cfg_offset_i": 0, "cfg_delay_i": 0}
        for name, value in (inputs | settings | ports).items():
            getattr(dut, name).value = value
        Clock(dut.clk_i, CLOCK_NS, unit="ns").start()
        await FallingEdge(dut.clk_i)
        await self.clocks(3)
        dut.rst_i.value = 0
        for name in self.times:
            cocotb.start_soon(self._watch(name))
        cocotb.start_soon(self._convert())
        await self.clocks(1)

    async def _watch(self, name: str) -> None:
        signal = getattr(self.dut, name)
        while True:
            await RisingEdge(signal)
            await FallingEdge(self.dut.clk_i)
            # A pulse of one clock: it is still high.
            self.times[name].append(self.now)
            if name == "instant_o":
                self.instants[self.now] = int(self.dut.theta_o.value)
            if name == "update_o":
                cocotb.start_soon(self._count(self.now))

    async def _count(self, update: int) -> None:
        await self.clocks(1)
        high, low = (unpack(int(port.value), 16, self.phases) for port in (self.dut.high_o, self.dut.low_o))
        self.counts[update] = high
        if any(high) and any(low):
            assert len({h + w for h, w in zip(high, low, strict=True)}) == 1, f"requests {high} and {low}"

    async def _convert(self) -> None:
        while True:
            await RisingEdge(self.dut.adc_strobe_o)
            await FallingEdge(self.dut.clk_i)
            cocotb.start_soon(self._answer(self.now))

    async def _answer(self, strobe: int) -> None:
        await self.clocks(self.conversion)
        codes = [0] * self.channels
        for x, value in enumerate(self.current(strobe)):
            codes[self.phases + x] = 2048 + value // 64
        self.dut.adc_code_i.value = pack(codes, 12)
        self.dut.adc_valid_i.value = 1
        self.valids.append(self.now)
        await self.clocks(1)
        self.dut.adc_valid_i.value = 0

    # ---- bus

    def _select(self, name: str, index: int) -> int:
        offset = self.offsets[name] + 4 * index
        self.dut.block_i.value = CHAIN_WINDOWS.index(offset >> 12)
        return offset & 0xFFF

    async def write(self, name: str, value: int, index: int = 0) -> None:
        """One bus write in a clock; the core needs two."""
        self.dut.req_i.value = request(self._select(name, index), value & 0xFFFF_FFFF, we=True)
        self.dut.stb_i.value = 1
        await self.clocks(1)
        self.dut.stb_i.value = 0
        await self.clocks(1)

    async def read(self, name: str, index: int = 0) -> int:
        self.dut.req_i.value = request(self._select(name, index))
        self.dut.stb_i.value = 1
        await Timer(CLOCK_NS // 4, "ns")
        value = int(self.dut.rdat_o.value)
        await Timer(CLOCK_NS - CLOCK_NS // 4, "ns")
        self.dut.stb_i.value = 0
        return value

    async def vector(self, name: str, pairs: list[Pair]) -> None:
        """Write one of the arrays of four."""
        for i, value in enumerate(x for pair in pairs for x in pair):
            await self.write(f"foc.{name}", value, i)

    async def regulators(self, regulators: list[Regulator]) -> None:
        """Write every setting of the regulators but control.regulate."""
        for name in ("reference", "gain", "hold", "ratio", "preset", "forward"):
            await self.vector(name, [getattr(r, name) for r in regulators])
        for s, r in enumerate(regulators):
            await self.write("foc.shift", r.shift, s)
            await self.write("foc.limit", r.limit, s)

    async def modulator(self, s: Settings) -> None:
        (scale, scale_shift), (slope, slope_shift) = s.scale_registers(), s.slope_registers()
        await self.write("foc.period", s.period)
        await self.write("foc.scale", scale | scale_shift << 24)
        await self.write("foc.slope", slope | slope_shift << 24)
        await self.write("foc.band", s.band_register())
        await self.write("foc.dead_time", s.dead_time)
        await self.write("foc.min_pulse", s.min_pulse)
        await self.write("foc.margin", s.margin)

    async def control(self, **fields: int) -> None:
        place = {"source": 0, "enable": 1, "double": 2, "bypass": 3, "regulate": 4, "direct": 6, "miss_limit": 8}
        self.written |= fields
        await self.write("foc.control", sum(value << place[name] for name, value in self.written.items()))

    async def window(self, from_cycles: int, length: int, offset: int) -> None:
        await self.write("foc.window", from_cycles | length << 16)
        self.dut.cfg_offset_i.value = offset

    async def choose(self, rng: random.Random, choice: Choice) -> None:
        """Write and commit; of two corrections the last one counts."""
        await self.regulators(choice.regulators)
        await self.control(regulate=sum(r.enable << s for s, r in enumerate(choice.regulators)))
        await self.write("foc.lead", choice.lead)
        await self.write("foc.omega", choice.omega)
        if choice.correction:
            await self.write("foc.correct", rng.getrandbits(32))
            await self.write("foc.correct", choice.correction)
        await self.commit()

    async def commit(self) -> None:
        await self.write("timer.update", 1)

    async def settle(self) -> None:
        """Commit, let a periodic tick take the settings over, go back to no tick."""
        await self.commit()
        await self.write("timer.tick_samples", 0)
        await self.write("timer.tick_period", 3)
        seen = len(self.times["event_o"])
        while len(self.times["event_o"]) == seen:
            await self.clocks(1)
        await self.write("timer.tick_period", 0)
        await self.clocks(FOC_SPACING[self.phases] + 2)

    async def tick(self, limit: int = 20_000) -> int:
        """Wait for a tick; its time."""
        seen = len(self.times["tick_o"])
        for _ in range(limit):
            if len(self.times["tick_o"]) > seen:
                await self.clocks(1)
                return self.times["tick_o"][-1]
            await self.clocks(1)
        raise AssertionError(f"no tick within {limit} clocks")

    async def snapshot(self) -> Snapshot:
        async def four(name: str) -> list[Pair]:
            values = [signed(await self.read(f"foc.snap_{name}", i)) for i in range(4)]
            return [(values[0], values[1]), (values[2], values[3])]

        count, missed = await self.read("foc.snap_count"), await self.read("foc.snap_missed")
        return Snapshot(
            current=await four("i"),
            applied=await four("v"),
            state=await four("u"),
            applied_sum=await four("v_sum"),
            steps=count & 0xFFFF,
            samples=count >> 16 & 0xFF,
            limited=count >> 24 & 3,
            theta_sample=await self.read("foc.snap_theta_sample"),
            theta_update=await self.read("foc.snap_theta_update"),
            omega=signed(await self.read("foc.snap_omega")),
            stamp=await self.read("foc.snap_time"),
            missed=missed & 0xFFFF,
            overruns=missed >> 16,
            encoder=await self.read("foc.snap_encoder"),
        )


def wave(rng: random.Random, phases: int) -> Callable[[int], list[int]]:
    """Currents that look random and are a function of the strobe's time, in steps of a code."""
    salt = rng.getrandbits(32)
    return lambda strobe: [64 * (random.Random(salt + 8 * strobe + x).randrange(4096) - 2048) for x in range(phases)]


def clip_error(error: int) -> int:
    return max(1 - FULL_SCALE, min(FULL_SCALE - 1, error))


def draw_regulator(rng: random.Random) -> Regulator:
    """A regulator whose state stays in reach of the modulator, now and then at its limit."""

    def pair(size: int) -> Pair:
        return rng.randrange(-size, size), rng.randrange(-size, size)

    return Regulator(
        gain=pair(FULL_SCALE),
        hold=pair(FULL_SCALE),
        ratio=pair(FULL_SCALE),
        shift=rng.randrange(10, 16),
        limit=rng.choice([FULL_SCALE - 1, rng.randrange(1000, 40_000)]),
        enable=int(rng.random() < 0.8),
        preset=pair(30_000),
        reference=pair(60_000),
        forward=pair(5_000),
    )


@dataclass
class Choice:
    """Settings that change with every tick."""

    regulators: list[Regulator]
    lead: int = 0
    omega: int = 0
    correction: int = 0

    @classmethod
    def draw(cls, rng: random.Random, subspaces: int) -> Choice:
        return cls(
            [draw_regulator(rng) for _ in range(subspaces)],
            rng.randrange(-TURN // 4, TURN // 4),
            rng.randrange(-4_000_000, 4_000_000),
            rng.choice([0, rng.randrange(-TURN // 2, TURN // 2)]),
        )


@dataclass(frozen=True)
class Case:
    """Where the samples lie: double update, period, first sample, their number and spacing, conversion time."""

    double: int
    period: int
    offset: int
    samples: int
    spacing: int
    conversion: int

    @property
    def length(self) -> int:
        return 0 if self.samples == 0 else (self.samples - 1) * self.spacing + 1


CASES = [
    Case(0, 1000, 400, 0, 40, 20),
    Case(1, 1000, 300, 0, 40, 20),
    Case(1, 2000, 17, 1, 16, 3),
    Case(0, 1000, 60, 8, 40, 30),
    Case(1, 1200, 50, 9, 50, 30),
]


@cocotb.test()
@cocotb.parametrize(case=CASES)
async def chain_follows_the_models(dut: Any, case: Case) -> None:
    """New random settings every tick: angle, currents, regulators bit by bit, requests within the modulator's error.

    The latency from the codes of the last sample to the compares is constant; with three phases and a conversion of
    20 clocks the shadow registers have them at most 100 clocks after the strobe.
    """
    rng = random.Random(case.period + case.samples)
    tb = TB(dut)
    tb.conversion, tb.current = case.conversion, wave(rng, tb.phases)
    delay = 9
    await tb.start(cfg_mode_i=CARRIER, cfg_spacing_i=case.spacing, cfg_delay_i=delay)
    half = case.period // (1 + case.double)
    modulator = Settings(period=case.period, full_scale_over_vdc=1.2, dead_time=25, zone=0.02, band=0.01)
    # Nothing is carried over from a step that is not followed.
    regulators = [replace(draw_regulator(rng), ratio=(0, 0)) for _ in range(tb.subspaces)]
    await tb.modulator(modulator)
    await tb.regulators(regulators)
    await tb.write("foc.delay", delay)
    await tb.window(case.offset, case.length, case.offset)
    enables = sum(r.enable << s for s, r in enumerate(regulators))
    await tb.control(source=1, enable=1, double=case.double, regulate=enables, miss_limit=2)
    await tb.settle()
    tb.angle.change(tb.times["event_o"][-1], 0, 0)
    # The first step with these settings: its window opened after they acted.
    await tb.clocks(3 * case.period)
    await tb.write("timer.tick_samples", 1)
    await tb.tick()
    first = await tb.snapshot()
    for s, r in enumerate(regulators):
        r.state = first.state[s]
        d, q = (clip_error(a - i) for a, i in zip(r.reference, first.current[s], strict=True))
        r.error = (d, q)
    used = Choice(regulators)
    staged, limited, free, widths_seen = used, 0, 0, 0
    wanted: dict[int, tuple[list[int], list[int], int]] = {}  # by the update that ends it: voltages, currents, step
    for step in range(30):
        if step:
            tick = await tb.tick()
            got = await tb.snapshot()
            assert tb.times["sync_o"][-1] == tick - 1, f"step {step}: tick {tick}, {tb.times['sync_o'][-3:]}"
            # Which samples: those of the window that the update before them opened.
            valid = tick - 1 - tb.to_sync - (MEAN_MORE if case.length else 0)
            assert valid in tb.valids, f"step {step}: no sample {tick - valid} clocks before the tick"
            assert tb.phases == 5 or 20 + tick - valid <= 100
            last = valid - tb.conversion
            strobes = [last - case.spacing * k for k in range(max(1, case.samples))]
            update = strobes[-1] - 1 - case.offset
            assert update in tb.times["update_o"] and set(strobes) <= set(tb.times["adc_strobe_o"])
            instant = strobes[-1] + case.length // 2
            assert got.stamp == instant - delay and got.samples == max(1, case.samples)
            assert got.theta_sample == tb.angle.at(instant), f"step {step}: {got.theta_sample}, {tb.angle.at(instant)}"
            assert tb.instants[instant] == got.theta_sample
            assert got.encoder == instant % 2**18 | (instant >> 5 & 1) << 31, f"step {step}: encoder {got.encoder:#x}"
            latest = max(t for t in tb.times["update_o"] if t + 2 <= tick)
            assert got.theta_update == tb.angle.at(latest + 1), f"step {step}: angle of the pins' change"
            assert (got.omega, got.steps, got.overruns, got.missed) == (used.omega, 1, 0, first.missed)
            currents = [mean(list(values)) for values in zip(*(tb.current(t) for t in strobes), strict=True)]
            for s, r in enumerate(used.regulators):
                exact = park(currents, got.theta_sample, 1 + 2 * s)
                for value, real in zip(got.current[s], (exact.real, exact.imag), strict=True):
                    expected = max(-FULL_SCALE, min(FULL_SCALE - 1, real))
                    assert abs(value - expected) <= 1.0, f"step {step}, subspace {s}: {got.current[s]}, exact {exact}"
                r.step(got.current[s])
                assert got.state[s] == r.state, f"step {step}, subspace {s}: {got.state[s]}, {r}"
                assert got.applied[s] == r.applied(0) == got.applied_sum[s], f"step {step}, subspace {s}: {got}, {r}"
                assert (got.limited >> s & 1) == r.limited
                limited += r.limited
                free += not r.limited
            if tb.subspaces == 1:
                assert got.current[1] == got.applied[1] == got.state[1] == got.applied_sum[1] == (0, 0)
            turned = [complex(*got.applied[s]) for s in range(tb.subspaces)]
            voltages = phases_of(turned, got.theta_sample + used.lead, tb.phases)
            # Made in clock tick - 1, in time for an update three clocks later.
            taken = next(t for t in range(update, update + 100 * half, half) if t >= tick + 2)
            volts = [max(-FULL_SCALE, min(FULL_SCALE - 1, round(v))) for v in voltages]
            wanted[taken + half] = (volts, currents, step)
            tb.angle.change(tick, staged.omega, staged.correction)
            for old, new in zip(used.regulators, staged.regulators, strict=True):
                new.state, new.error, new.carry = old.state, old.error, old.carry
            used = staged
        for end in [t for t in wanted if t in tb.counts]:
            volts, currents, of_step = wanted.pop(end)
            # Half a carrier holds half of the clocks, to half a clock; voltages are rounded twice.
            share = 1 + case.double
            tolerance = (1.0 + 2.0 * modulator.scale) / share + 0.5 * case.double + 1e-6
            for x, (raw, exact_width) in enumerate(widths(modulator, volts, currents)):
                if min(abs(raw), abs(raw - modulator.period)) <= 2.0:
                    continue  # where a leg begins to have edges compensation steps in
                clocks = tb.counts[end][x]
                assert abs(clocks - exact_width / share) <= tolerance, (
                    f"step {of_step}, leg {x}: {clocks}, {exact_width / share}"
                )
                widths_seen += 1
        staged = Choice.draw(rng, tb.subspaces)
        await tb.choose(rng, staged)
    dut._log.info("last sample to compares: %d clocks; %d limited, %d free", tick - valid, limited, free)
    assert limited > 3 and free > 3 and widths_seen > 20 * tb.phases
    assert dut.deadline_o.value == 0


@cocotb.test()
async def nothing_changes_without_commit(dut: Any) -> None:
    """Every setting is written anew and not committed: steps, requests and angle stay; the commit brings them all."""
    tb = TB(dut)
    await tb.start(cfg_mode_i=ONCE, cfg_offset_i=100)
    tb.current = lambda strobe: [6400 * (x + 1) for x in range(tb.phases)]
    modulator = Settings(period=1000, dead_time=20, zone=0.1, band=0.02)
    regulators = [
        Regulator(forward=(9000, -4000), preset=(3000, 5000), enable=0, limit=100_000) for _ in range(tb.subspaces)
    ]
    await tb.modulator(modulator)
    await tb.regulators(regulators)
    await tb.window(100, 0, 100)
    await tb.control(source=1, enable=1)
    await tb.settle()
    await tb.write("timer.tick_samples", 1)
    for _ in range(3):
        await tb.tick()
    before = await tb.snapshot()
    assert before.applied[0] == (12_000, 1000) and before.theta_sample == 0

    other = Settings(period=800, full_scale_over_vdc=0.7, dead_time=0, min_pulse=100, margin=300)
    await tb.modulator(other)
    await tb.regulators(
        [
            Regulator(
                reference=(500, 700),
                gain=(99, 3),
                hold=(5, 6),
                ratio=(7, 9),
                shift=3,
                limit=50_000,
                forward=(1, 2),
                preset=(7, 8),
            )
            for _ in regulators
        ]
    )
    await tb.write("foc.window", 150 | 300 << 16)
    await tb.write("foc.delay", 50)
    await tb.write("foc.lead", TURN // 3)
    await tb.write("foc.omega", 123_456)
    await tb.write("foc.correct", TURN // 5)
    await tb.control(source=0, enable=0, double=1, bypass=1, regulate=3, miss_limit=1)
    for _ in range(4):
        await tb.tick()
        got = await tb.snapshot()
        assert got.stamp - before.stamp == 1000 and got.samples == 1
        before.stamp, before.encoder = got.stamp, got.encoder
        assert got == before, f"{got} instead of {before}"
        assert dut.source_o.value == 1 and int(dut.req_h_o.value) | int(dut.req_l_o.value) == 2**tb.phases - 1
    counts = [tb.counts[t] for t in sorted(tb.counts)[-3:]]
    assert counts[0] == counts[1] == counts[2], counts

    await tb.commit()
    tick = await tb.tick()
    assert tb.times["event_o"][-1] == tick
    await tb.clocks(3)
    assert dut.source_o.value == 0 and int(dut.req_h_o.value) | int(dut.req_l_o.value) == 0
    dut.cfg_mode_i.value = CONTINUOUS
    dut.cfg_spacing_i.value = 40
    dut.cfg_delay_i.value = 50
    for _ in range(4):
        tick = await tb.tick()
    got = await tb.snapshot()
    assert got.applied == [(1, 2)] * tb.subspaces + [(0, 0)] * (2 - tb.subspaces)
    assert got.omega == 123_456 and 7 <= got.samples <= 8
    updates = tb.times["update_o"][-3:]
    assert [b - a for a, b in itertools.pairwise(updates)] == [400, 400]
    event = tb.times["event_o"][-1]
    turned = (tick - 1 - tb.to_sync - MEAN_MORE - event) * 123_456 / 16 / TURN + 0.2
    assert abs((got.theta_sample / TURN - turned + 0.5) % 1.0 - 0.5) < 400 * 123_456 / 16 / TURN


@cocotb.test()
@cocotb.parametrize(n=[1, 2, 5])
async def tick_follows_every_nth_step(dut: Any, n: int) -> None:
    """The tick one clock after the compares of every n-th step; sums and their number are of the steps between."""
    tb = TB(dut)
    await tb.start(cfg_mode_i=ONCE, cfg_offset_i=30)
    await tb.modulator(Settings(period=600))
    await tb.regulators([Regulator(forward=(-131_000, 7000)) for _ in range(tb.subspaces)])
    await tb.window(30, 0, 30)
    await tb.control(source=1, bypass=1, double=1)
    await tb.settle()
    await tb.write("timer.tick_samples", n)
    await tb.tick()
    first = len(tb.times["sync_o"])
    for k in range(1, 5):
        tick = await tb.tick()
        got = await tb.snapshot()
        assert len(tb.times["sync_o"]) == first + k * n and tick == tb.times["sync_o"][-1] + 1
        assert got.steps == n and got.applied_sum[0] == (-131_000 * n, 7000 * n), got
    # Without ticks the sum goes on, one step an update.
    await tb.write("timer.tick_samples", 0)
    await tb.clocks(12_000)
    await tb.write("timer.tick_period", 1)
    await tb.tick()
    await tb.write("timer.tick_period", 0)
    ticks = [t for t in tb.times["tick_o"] if t > tick]
    steps = sum(tick <= t < ticks[0] for t in tb.times["sync_o"])
    assert 35 < steps < 45


@cocotb.test()
async def touching_windows_keep_their_angles(dut: Any) -> None:
    """The mean of a window comes after the next window's instant: the angle is still its own."""
    tb = TB(dut)
    tb.conversion = 140
    await tb.start(cfg_mode_i=CARRIER, cfg_spacing_i=150, cfg_offset_i=149)
    await tb.modulator(Settings(period=300))
    await tb.regulators([Regulator() for _ in range(tb.subspaces)])
    await tb.window(0, 300, 149)
    await tb.write("foc.omega", omega := 5_000_000)
    await tb.control(source=1, bypass=1)
    await tb.settle()
    tb.angle.change(tb.times["event_o"][-1], omega, 0)
    await tb.clocks(1500)
    await tb.write("timer.tick_samples", 1)
    for _ in range(5):
        tick = await tb.tick()
        got = await tb.snapshot()
        last = tick - 1 - tb.to_sync - MEAN_MORE - tb.conversion
        assert last in tb.times["adc_strobe_o"]
        instant = last - 149
        valid = tick - 1 - (tb.to_sync - tb.channels - 5)
        assert valid > instant + 300, "the mean came before the next instant: nothing is tested"
        assert got.stamp == instant and got.samples == 2
        assert got.theta_sample == tb.angle.at(instant)


@cocotb.test()
async def settings_change_between_steps_only(dut: Any) -> None:
    """Commits at any clock of a step, ticks of their own: every step is made with one set of settings."""
    tb = TB(dut)
    await tb.start(cfg_mode_i=ONCE, cfg_offset_i=20)
    tb.current = lambda strobe: [6400 * (x + 1) for x in range(tb.phases)]
    period = 250
    await tb.modulator(Settings(period=period))

    def regulators(k: int) -> list[Regulator]:
        # Two steps with one set are told from one with each by their sums.
        return [
            Regulator(
                gain=(1000 * k, 7 * k),
                hold=(300 * k, k),
                ratio=(40_000 * k, -9_000 * k),
                shift=4,
                limit=FULL_SCALE - 1 if k == 1 else 20_000,
                reference=(100 * k, -50 * k),
                forward=(k, -k),
            )
            for _ in range(tb.subspaces)
        ]

    sets = [regulators(k) for k in (1, 3)]
    await tb.regulators(sets[0])
    await tb.window(20, 0, 20)
    await tb.control(source=1, regulate=2**tb.subspaces - 1)
    await tb.settle()
    model = sets[0]
    foc = FOC_LATENCY[tb.phases]
    mod = 2 * tb.phases + 6
    await tb.write("timer.tick_samples", 1)
    await tb.tick()
    got = await tb.snapshot()
    current = got.current
    for s, r in enumerate(model):
        r.state, r.error = got.state[s], (r.reference[0] - current[s][0], r.reference[1] - current[s][1])
    await tb.write("timer.tick_samples", 0)
    for k in range(1, 40):
        done = len(tb.times["sync_o"])
        await tb.regulators(sets[k % 2])
        await tb.commit()
        # The tick that is the event falls into another clock of a step each time.
        while len(tb.times["sync_o"]) == done:
            await tb.clocks(1)
        await tb.clocks(period - foc - mod - 8 + 2 * k)
        await tb.write("timer.tick_period", 100_000)
        await tb.write("timer.tick_period", 1)
        await tb.tick(10)
        await tb.write("timer.tick_period", 0)
        event = tb.times["event_o"][-1]
        while tb.times["sync_o"][-1] < event + 2 * period:
            await tb.clocks(1)
        await tb.write("timer.tick_period", 1)
        await tb.tick(10)
        await tb.write("timer.tick_period", 0)
        last_tick = tb.times["tick_o"][-1]
        got = await tb.snapshot()
        new = sets[k % 2]
        for sync in [t for t in tb.times["sync_o"][done:] if t <= last_tick]:
            start = sync - foc - mod
            if start > event and model is not new:
                for old, r in zip(model, new, strict=True):
                    r.state, r.error, r.carry = old.state, old.error, old.carry
                model = new
            for s, r in enumerate(model):
                r.step(current[s])
        for s, r in enumerate(model):
            assert got.current[s] == current[s]
            assert got.state[s] == r.state and got.applied[s] == r.applied(0), f"event {k}: {got}, {r}"


@cocotb.test()
async def missed_deadline_is_told(dut: Any) -> None:
    """Without samples no compares come: the fault rises with the set number of updates and falls with enable."""
    tb = TB(dut)
    await tb.start(cfg_mode_i=ONCE, cfg_offset_i=30)
    await tb.modulator(Settings(period=500))
    await tb.window(30, 0, 30)
    await tb.control(source=1, enable=1, miss_limit=3)
    await tb.settle()
    await tb.write("timer.tick_samples", 1)
    for _ in range(4):
        await tb.tick()
    good = await tb.snapshot()
    assert dut.deadline_o.value == 0
    dut.cfg_mode_i.value = 0
    await tb.clocks(500)
    ticks, updates = len(tb.times["tick_o"]), len(tb.times["update_o"])
    while dut.deadline_o.value == 0:
        await tb.clocks(1)
        assert len(tb.times["update_o"]) <= updates + 4
    assert len(tb.times["tick_o"]) == ticks, "a tick without a step"
    await tb.clocks(1200)
    assert dut.deadline_o.value == 1
    await tb.control(enable=0)
    await tb.settle()
    await tb.clocks(5)
    assert dut.deadline_o.value == 0 and int(dut.req_h_o.value) | int(dut.req_l_o.value) == 0
    assert (await tb.snapshot()).missed >= good.missed + 3


async def waiting_step(tb: TB) -> tuple[int, list[Pair]]:
    """Number and currents of the next regulator step that waits for the core."""
    while tb.dut.waiting_o.value == 0:
        await tb.clocks(1)
    run = await tb.read("foc.direct_run")
    assert run >> 31 == 1
    values = [signed(await tb.read("foc.direct_i", i)) for i in range(4)]
    return run & 0xFFFF, [(values[0], values[1]), (values[2], values[3])][: tb.subspaces]


async def answer(tb: TB, number: int, wanted: list[Pair]) -> int:
    """The core's voltages; the clock in which they are there."""
    for i, value in enumerate(x for pair in wanted for x in pair):
        await tb.write("foc.direct_v", value, i)
    await tb.write("foc.direct_go", number)
    return tb.now - 1


@cocotb.test()
async def core_regulates_directly(dut: Any) -> None:
    """Each sample waits for its voltage, which is in the shadow registers a constant time after it was written.

    An answer after the update is ignored: the legs keep their compares, which is counted, and no tick comes; the next
    sample is whole. Without answers the deadline fault rises.
    """
    rng = random.Random(random.randrange(1 << 32))
    tb = TB(dut)
    tb.current = wave(rng, tb.phases)
    await tb.start(cfg_mode_i=ONCE, cfg_offset_i=30)
    period = 1200
    await tb.modulator(Settings(period=period))
    await tb.window(30, 0, 30)
    regulators = [Regulator(limit=60_000) for _ in range(tb.subspaces)]
    await tb.regulators(regulators)
    await tb.control(source=1, enable=1, direct=1, regulate=1, miss_limit=3)
    await tb.settle()
    await tb.write("timer.tick_samples", 1)
    number_before = missed = None
    for step in range(40):
        number, currents = await waiting_step(tb)
        strobe = tb.times["adc_strobe_o"][-1]
        if number_before is not None:
            assert number == (number_before + 1) & 0xFFFF
        number_before = number
        ticks, updates = len(tb.times["tick_o"]), len(tb.times["update_o"])
        wanted = [(rng.randrange(-(1 << 24), 1 << 24), rng.randrange(-(1 << 24), 1 << 24)) for _ in regulators]
        if step % 5 == 4:
            while len(tb.times["update_o"]) == updates:
                await tb.clocks(1)
            await tb.clocks(1)
            assert dut.waiting_o.value == 0
            await answer(tb, number, wanted)
            await tb.clocks(5)
            assert len(tb.times["tick_o"]) == ticks, "a tick for a step without its voltage"
            continue
        await tb.clocks(rng.randrange(200))
        gone = await answer(tb, number, wanted)
        assert dut.waiting_o.value == 0
        await tb.tick()
        assert len(tb.times["update_o"]) == updates
        assert tb.times["sync_o"][-1] - gone == GO_LATENCY[tb.phases] + 2 * tb.phases + 6
        got = await tb.snapshot()
        for s, r in enumerate(regulators):
            r.bound(wanted[s])
            assert (got.current[s], got.state[s]) == (currents[s], r.state), f"step {step}, subspace {s}"
            exact = park(tb.current(strobe), got.theta_sample, 1 + 2 * s)
            for value, real in zip(currents[s], (exact.real, exact.imag), strict=True):
                assert abs(value - max(-FULL_SCALE, min(FULL_SCALE - 1, real))) <= 1.1
        # One step in five was late, each has missed its update.
        if missed is not None:
            assert got.missed - missed == (1 if step % 5 == 0 else 0), f"step {step}"
        missed = got.missed
    assert missed is not None and dut.deadline_o.value == 0
    # What the legs do in the carrier of a late voltage is what they did before.
    late = 0
    updates = tb.times["update_o"]
    for first, second in itertools.pairwise(updates[2:]):
        made = [t for t in tb.times["sync_o"] if first - period <= t < first]
        if not made and second in tb.counts and first in tb.counts:
            late += 1
            assert tb.counts[second] == tb.counts[first], f"update {first}"
    assert late >= 6
    count = len(updates)
    while dut.deadline_o.value == 0:
        await tb.clocks(1)
        assert len(tb.times["update_o"]) <= count + 5


@cocotb.test()
async def overruns_are_counted(dut: Any) -> None:
    """Currents that come while a step runs are ignored and counted; the steps that are made stay whole."""
    tb = TB(dut)
    await tb.start(cfg_mode_i=CONTINUOUS, cfg_spacing_i=20)
    tb.conversion = 3
    tb.current = lambda strobe: [6400 * (x + 1) for x in range(tb.phases)]
    await tb.modulator(Settings(period=40))
    await tb.regulators([Regulator(forward=(900, 80)) for _ in range(tb.subspaces)])
    await tb.control(source=0, bypass=1)
    await tb.settle()
    await tb.clocks(1500)  # the first carrier has the period after reset
    await tb.write("timer.tick_period", 211)
    await tb.tick()
    before = await tb.snapshot()
    for _ in range(6):
        await tb.tick()
    got = await tb.snapshot()
    assert got.overruns > before.overruns + 10, got
    assert got.applied[0] == (900, 80)
    assert got.current == before.current and got.theta_sample == 0


@cocotb.test()
async def registers_hold_every_bit(dut: Any) -> None:
    tb = TB(dut)
    await tb.start()
    masks = {
        "control": 0xFF7F, "period": 0xFFFF, "window": 0xFFFF_FFFF, "delay": 0xFFFF, "lead": 0xFFFF_FFFF,
        "park": 0xFFFF_FFFF,
        "omega": 0xFFFF_FFFF, "correct": 0xFFFF_FFFF, "scale": 0x1F01_FFFF, "slope": 0x1F01_FFFF, "dead_time": 0x3FF,
        "band": 0x1FFFF, "min_pulse": 0xFFF, "margin": 0xFFFF, "direct_go": 0xFFFF,
    }  # fmt: skip
    arrays = dict.fromkeys(("reference", "gain", "hold", "ratio", "preset", "forward"), (4, 0x3FFFF))
    arrays |= {"shift": (2, 0x1F), "limit": (2, 0x1FFFF), "direct_v": (4, 0xFFF_FFFF)}
    places = [(name, 0, mask) for name, mask in masks.items()]
    places += [(name, i, mask) for name, (count, mask) in arrays.items() for i in range(count)]
    for salt in (0xFFFF_FFFF, 0, 0xA5C3_3C5A):
        for k, (name, i, _) in enumerate(places):
            await tb.write(f"foc.{name}", salt ^ k, i)
        for k, (name, i, mask) in enumerate(places):
            assert await tb.read(f"foc.{name}", i) == (salt ^ k) & mask, f"{name}[{i}]"


@pytest.mark.parametrize("phases", [3, 5])
def test_fl_foc_wb(phases: int) -> None:
    """Vector path from codes to requests.

    Verifies: VPATH-01, VPATH-02, VPATH-03, VPATH-04, VPATH-05, VPATH-06, VPATH-07
    """
    run_block_test("fl_foc_chain", SOURCES, __name__, parameters={"Phases": phases}, registers=CHAIN_REGISTERS)
