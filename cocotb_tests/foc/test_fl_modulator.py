# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Modulator against a model in volts and seconds, the fundamental against closed integrals, rules at their corners."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import cocotb
import pytest
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, Timer

from cocotb_tests.measured import measured
from fluxlock.cosim.block import run_block_test

CLOCK_NS = 20
FULL = 1 << 17


def pack(values: Sequence[int], bits: int) -> int:
    return sum((v & ((1 << bits) - 1)) << (bits * k) for k, v in enumerate(values))


def mantissa_and_shift(value: float) -> tuple[int, int]:
    """A factor as the registers hold it: 17-bit mantissa, shift 1..31; the error is at most 2^-17 of the factor."""
    shift = 16 - math.floor(math.log2(value))
    if round(value * 2.0**shift) >= FULL:
        shift -= 1
    shift = min(31, max(1, shift))
    mantissa = round(value * 2.0**shift)
    assert mantissa < FULL, f"{value} does not fit"
    assert shift == 31 or abs(mantissa / 2.0**shift - value) <= value * 2**-17
    return mantissa, shift


@dataclass(frozen=True)
class Settings:
    """Settings, clocks; band and zone over the current's full scale, dead_time is reached at their sum."""

    period: int = 2500
    full_scale_over_vdc: float = 1.2
    dead_time: int = 0
    zone: float = 0.01
    band: float = 0.0
    min_pulse: int = 0
    margin: int = 0

    def scale_registers(self) -> tuple[int, int]:
        return mantissa_and_shift(self.period * self.full_scale_over_vdc / FULL)

    def slope_registers(self) -> tuple[int, int]:
        return mantissa_and_shift(self.dead_time / (self.zone * FULL)) if self.dead_time else (0, 0)

    def band_register(self) -> int:
        return round(self.band * FULL)

    @property
    def scale(self) -> float:
        """Clocks a unit of voltage, as the registers have it."""
        mantissa, shift = self.scale_registers()
        return mantissa / 2.0**shift

    @property
    def slope(self) -> float:
        """Clocks a unit of current, as the registers have it."""
        mantissa, shift = self.slope_registers()
        return mantissa / 2.0**shift

    def gained(self, current: int) -> float:
        """Compensation of a leg with edges, clocks."""
        beyond = math.copysign(max(abs(current) - self.band_register(), 0), current)
        return max(-self.dead_time, min(self.dead_time, beyond * self.slope))

    def registers(self) -> dict[str, int]:
        return {
            "cfg_period_i": self.period,
            "cfg_scale_i": self.scale_registers()[0],
            "cfg_scale_shift_i": self.scale_registers()[1],
            "cfg_band_i": self.band_register(),
            "cfg_slope_i": self.slope_registers()[0],
            "cfg_slope_shift_i": self.slope_registers()[1],
            "cfg_dead_time_i": self.dead_time,
            "cfg_min_pulse_i": self.min_pulse,
            "cfg_margin_i": self.margin,
        }


def widths(s: Settings, v: Sequence[int], i: Sequence[int]) -> list[tuple[float, float]]:
    """Exact width of every leg's pulse without minimum pulse, before and after compensation and clamp; clocks."""
    zero = (max(v) + min(v)) / 2
    found = []
    for voltage, current in zip(v, i, strict=True):
        raw = s.period / 2 + (voltage - zero) * s.scale
        gained = s.gained(current) if 0 < raw < s.period else 0.0
        found.append((raw, max(s.margin, min(s.period - s.margin, raw + gained))))
    return found


class TB:
    """Vectors in, compares out."""

    def __init__(self, dut: Any) -> None:
        self.dut = dut
        self.phases = len(dut.clipped_o.value)
        self.latency = 2 * self.phases + 6
        self.early_clocks = self.phases + 4

    async def clocks(self, n: int) -> None:
        if n > 0:
            await Timer(n * CLOCK_NS, "ns")

    def set(self, s: Settings) -> None:
        for name, value in s.registers().items():
            getattr(self.dut, name).value = value

    async def start(self, s: Settings | None = None) -> None:
        self.dut.early_i.value = 0
        self.dut.valid_i.value = 0
        self.dut.pair_i.value = 0
        self.dut.v_q17_i.value = 0
        self.dut.i_q17_i.value = 0
        self.set(s or Settings())
        Clock(self.dut.clk_i, CLOCK_NS, unit="ns").start()
        self.dut.rst_i.value = 1
        await FallingEdge(self.dut.clk_i)
        await self.clocks(3)
        self.dut.rst_i.value = 0
        await self.clocks(1)

    async def pulse(self, v: Sequence[int], i: Sequence[int]) -> None:
        self.dut.v_q17_i.value = pack(v, 18)
        self.dut.i_q17_i.value = pack(i, 18)
        self.dut.valid_i.value = 1
        await self.clocks(1)
        self.dut.valid_i.value = 0
        self.dut.v_q17_i.value = pack([0x15555] * self.phases, 18)
        self.dut.i_q17_i.value = pack([-0x12345] * self.phases, 18)

    async def early(self, i: Sequence[int]) -> None:
        """Currents of the other edge, as early as they must come."""
        self.dut.i_q17_i.value = pack(i, 18)
        self.dut.early_i.value = 1
        await self.clocks(1)
        self.dut.early_i.value = 0
        await self.clocks(self.early_clocks - 1)

    def compares(self) -> list[int]:
        word = int(self.dut.compare_o.value)
        return [(word >> (16 * x)) & 0xFFFF for x in range(self.phases)]

    async def convert(self, v: Sequence[int], i: Sequence[int] | None = None) -> list[int]:
        """One vector; checks the latency."""
        await self.pulse(v, i or [0] * self.phases)
        await self.clocks(self.latency - 2)
        assert not int(self.dut.valid_o.value), "early"
        await self.clocks(1)
        assert int(self.dut.valid_o.value), f"no output after {self.latency} clocks"
        return self.compares()


def rotating(amplitude: float, angle: float, phases: int) -> list[int]:
    """Phase voltages of a vector, units of 2^-17."""
    return [
        max(-FULL, min(FULL - 1, round(FULL * amplitude * math.cos(angle - 2 * math.pi * x / phases))))
        for x in range(phases)
    ]


@cocotb.test()
async def random_vectors(dut: Any) -> None:
    """Any voltages, currents and settings: within one clock of the exact width, clipped where it says so."""
    seed = cocotb.RANDOM_SEED
    dut._log.info("seed %d", seed)
    rng = random.Random(seed)
    tb = TB(dut)
    await tb.start()
    clipped_seen = worst = 0.0
    for _ in range(1500):
        period = rng.choice([rng.randrange(16, 400), rng.randrange(400, 4000), rng.randrange(4000, 65536), 16, 65535])
        s = Settings(
            period=period,
            full_scale_over_vdc=math.exp(rng.uniform(math.log(0.5), math.log(8.0))),
            dead_time=rng.choice([0, rng.randrange(1, min(1024, period // 4))]),
            zone=math.exp(rng.uniform(math.log(0.002), 0.0)),
            band=rng.choice([0.0, rng.uniform(0.0, 0.2), rng.uniform(0.0, 0.999)]),
            margin=rng.choice([0, 0, rng.randrange(1, period // 2)]),
        )
        tb.set(s)
        size = rng.choice([0.05, 0.3, 1.0]) * FULL
        v = [max(-FULL, min(FULL - 1, round(rng.uniform(-size, size)))) for _ in range(tb.phases)]
        if rng.random() < 0.1:
            v = [rng.choice([-FULL, FULL - 1]) for _ in range(tb.phases)]
        i = [rng.randrange(-FULL, FULL) for _ in range(tb.phases)]
        if rng.random() < 0.5:
            reach = min(1.0, s.band + s.zone * 1.5)
            i = [max(-FULL, min(FULL - 1, round(x * reach))) for x in i]
        got = await tb.convert(v, i)
        # Half a clock a rounding, half a unit for the zero sequence.
        tolerance = 0.5 + 0.5 * s.scale + (0.5 if s.dead_time else 0.0) + 1e-6
        for x, (raw, exact) in enumerate(widths(s, v, i)):
            # Where the leg begins to have edges the compensation steps in: both sides of the step are right.
            if s.dead_time and min(abs(raw), abs(raw - s.period)) <= tolerance:
                continue
            error = abs(got[x] - exact)
            worst = max(worst, error - 0.5 * s.scale)
            assert error <= tolerance, f"leg {x}: {got[x]}, exact {exact:.3f}; {s}, v {v}, i {i}"
        flags = int(dut.clipped_o.value)
        for x in range(tb.phases):
            clipped = flags >> x & 1
            clipped_seen += clipped
            if clipped:
                assert got[x] in (s.margin, s.period - s.margin), f"leg {x} clipped at {got[x]}; {s}"
            else:
                assert s.margin <= got[x] <= s.period - s.margin
    dut._log.info("largest error %.3f clocks above half a unit of voltage", worst)
    measured("compare_clocks", worst)
    assert clipped_seen > 100


@cocotb.test()
async def zero_sequence_is_common(dut: Any) -> None:
    """Differences of two legs are those of the voltages, and the outer legs lie symmetrically around the middle."""
    rng = random.Random(7)
    tb = TB(dut)
    s = Settings(period=60001, full_scale_over_vdc=1.3)
    await tb.start(s)
    for _ in range(200):
        v = [rng.randrange(-40000, 40000) for _ in range(tb.phases)]
        got = await tb.convert(v)
        for x in range(1, tb.phases):
            assert abs((got[x] - got[0]) - (v[x] - v[0]) * s.scale) <= 1.0 + 1e-6, f"{got} for {v}"
        assert abs(max(got) + min(got) - s.period) <= 1.0 + s.scale, f"{got} for {v}"


@cocotb.test()
async def settings_are_of_the_valid_clock(dut: Any) -> None:
    """Settings that change while a vector is in work do not touch it; outputs stay until the next valid."""
    tb = TB(dut)
    a = Settings(period=1000, dead_time=30, zone=0.5, band=0.03, min_pulse=20, margin=50)
    b = Settings(period=777, full_scale_over_vdc=3.0, dead_time=10, band=0.2, min_pulse=5)
    await tb.start(a)
    v, i = rotating(0.3, 0.3, tb.phases), rotating(0.2, 1.0, tb.phases)
    expected = await tb.convert(v, i)
    assert int(dut.period_o.value) == a.period
    await tb.clocks(5)
    for wait in range(tb.latency):
        tb.set(a)
        await tb.pulse(v, i)
        await tb.clocks(wait)
        tb.set(b)
        await tb.clocks(tb.latency - 1 - wait)
        assert int(dut.valid_o.value) and tb.compares() == expected, f"changed {wait} clocks after the valid"
        assert int(dut.period_o.value) == a.period
        await tb.clocks(1)
        assert not int(dut.valid_o.value)
        await tb.clocks(50)
        assert tb.compares() == expected and int(dut.period_o.value) == a.period
    # Back to back at the least spacing.
    tb.set(a)
    for _ in range(5):
        assert await tb.convert(v, i) == expected
    # A reset in the middle forgets the vector.
    await tb.pulse(v, i)
    await tb.clocks(3)
    dut.rst_i.value = 1
    await tb.clocks(1)
    dut.rst_i.value = 0
    for _ in range(2 * tb.latency):
        assert not int(dut.valid_o.value)
        await tb.clocks(1)
    assert await tb.convert(v, i) == expected


@cocotb.test()
async def minimum_pulse(dut: Any) -> None:
    """Every width around the limits: pulses and gaps below the minimum become none, others stay."""
    tb = TB(dut)
    period = 400
    for min_pulse, margin in ((0, 0), (1, 0), (20, 0), (20, 5), (20, 20), (20, 30), (300, 0), (4095, 7)):
        await check_minimum(tb, period, min_pulse, margin)


async def check_minimum(tb: TB, period: int, min_pulse: int, margin: int) -> None:
    free = Settings(period=period, full_scale_over_vdc=1.0)
    s = Settings(period=period, full_scale_over_vdc=1.0, min_pulse=min_pulse, margin=margin)
    if margin == 0 and min_pulse == 0:
        await tb.start(free)
    shortest = min(min_pulse, period // 2)
    least = min(period // 2, max(margin, shortest)) if margin else 0
    seen = set()
    for step in range(-10, period // 2 + 12, 1 if period <= 400 else 3):
        # The outer legs at period/2 +- step.
        v = [0] * tb.phases
        v[0], v[1] = (round(k * step * FULL / period) for k in (1, -1))
        tb.set(free)
        widest = await tb.convert(v)
        tb.set(s)
        got = await tb.convert(v)
        for x, ideal in enumerate(widest):
            expected = max(least, min(period - least, ideal))
            if expected < shortest:
                expected = 0
            elif expected > period - shortest:
                expected = period
            assert got[x] == expected, f"{ideal} clocks became {got[x]}, min {min_pulse}, margin {margin}"
            seen.add(got[x])
    if margin == 0:
        assert 0 in seen and period in seen


@cocotb.test()
@cocotb.parametrize(band=[0.0, 0.008])
async def dead_time_has_a_band_and_a_linear_zone(dut: Any, band: float) -> None:
    """Nothing within the band; beyond it the width grows by slope up to the dead time, on legs with edges."""
    tb = TB(dut)
    s = Settings(period=2000, dead_time=40, zone=0.012, band=band)
    plain = Settings(period=2000)
    await tb.start(s)
    for raw in range(-3000, 3001, 150):
        v = rotating(0.2, 0.1, tb.phases)
        tb.set(plain)
        without = await tb.convert(v)
        tb.set(s)
        i = [raw if x % 2 else -raw for x in range(tb.phases)]
        got = await tb.convert(v, i)
        for x in range(tb.phases):
            size = abs(i[x]) / FULL
            exact = math.copysign(40.0 * max(0.0, min(1.0, (size - band) / 0.012)), i[x])
            assert abs(got[x] - without[x] - exact) <= 0.5 + 0.5 * s.slope + 1e-3, (
                f"leg {x} at {i[x]}: {got[x]} instead of {without[x]}"
            )
    # A leg that rests has no dead time to make up for.
    v = rotating(0.99, 0.0, tb.phases)
    got = await tb.convert(v, [FULL // 2] * tb.phases)
    assert got[0] == s.period and min(got) == 0
    got = await tb.convert(v, [-FULL // 2] * tb.phases)
    assert got[0] == s.period and min(got) == 0


@cocotb.test()
async def both_edges_have_their_current(dut: Any) -> None:
    """With the currents of both edges: half of what each would have alone, with a clock of rounding, in the same time.

    Early currents without pair_i, or of a vector before, change nothing.
    """
    seed = cocotb.RANDOM_SEED
    dut._log.info("seed %d", seed)
    rng = random.Random(seed)
    tb = TB(dut)
    await tb.start()
    for n in range(400):
        s = Settings(
            period=rng.randrange(1000, 5000),
            dead_time=rng.randrange(1, 200),
            zone=rng.uniform(0.005, 0.2),
            band=rng.choice([0.0, rng.uniform(0.0, 0.02)]),
        )
        tb.set(s)
        v = rotating(0.2, rng.uniform(0.0, 7.0), tb.phases)
        one, other = ([round(FULL * rng.uniform(-0.1, 0.1)) for _ in range(tb.phases)] for _ in range(2))
        before = tb.compares()
        await tb.early(one)
        assert tb.compares() == before
        pair = n % 4 != 0
        dut.pair_i.value = int(pair)
        got = await tb.convert(v, other)
        for x, (raw, _) in enumerate(widths(s, v, other)):
            gained = 0.5 * (s.gained(one[x]) + s.gained(other[x])) if pair else s.gained(other[x])
            error = got[x] - raw - gained
            assert abs(error) <= 1.5 + 0.5 * s.scale + 1e-6, f"leg {x}: {got[x]}, {raw} + {gained}; {s}"


def leg_wave(phases: int) -> list[tuple[float, Callable[[float], float]]]:
    """Leg voltage less the rail middle for a unit vector, 0..90 degrees: (end of the piece in degrees, wave)."""

    def cos(x: float) -> float:
        return math.cos(math.radians(x))

    if phases == 3:
        return [(60, lambda a: math.sqrt(3) / 2 * cos(a - 30)), (90, lambda a: 1.5 * cos(a))]
    return [
        (36, lambda a: cos(18) * cos(a - 18)),
        (72, lambda a: cos(a) + cos(72) * cos(a + 36)),
        (90, lambda a: cos(a) * (1 - cos(72))),
    ]


def fundamental(amplitude: float, phases: int, limit: float = 0.5) -> float:
    """Fundamental of a leg in vdc: the wave of space-vector modulation in closed form, clamped to the rails."""
    from scipy.integrate import quad  # slow to import: many other benches import this one

    total, begin = 0.0, 0.0
    for end, wave in leg_wave(phases):

        def integrand(a: float, wave: Callable[[float], float] = wave) -> float:
            return max(-limit, min(limit, amplitude * wave(a))) * math.cos(math.radians(a))

        total += quad(integrand, begin, end, limit=200)[0]
        begin = end
    return 4 / math.pi * math.radians(total)


@cocotb.test()
@cocotb.parametrize(margin=[0, 150])
async def fundamental_up_to_six_step(dut: Any, margin: int) -> None:
    """Linear to the edge of the polygon, then the closed integral, at last square waves."""
    tb = TB(dut)
    period, gain = 3000, 16.0
    limit = 0.5 - margin / period
    edge = 2 * limit * (1 / math.sqrt(3) if tb.phases == 3 else 1 / (2 * math.cos(math.radians(18))))
    s = Settings(period=period, full_scale_over_vdc=gain, margin=margin)
    await tb.start(s)
    steps = 180 * tb.phases
    last = 0.0
    for amplitude in (0.1, 0.5 * edge, 0.97 * edge, 1.05 * edge, 1.15 * edge, 1.3 * edge, 2 * edge, 15.9):
        first = 0.0 + 0.0j
        widest, narrowest = 0, period
        for k in range(steps):
            angle = 2 * math.pi * (k + 0.5) / steps
            got = await tb.convert(rotating(amplitude / gain, angle, tb.phases))
            first += 2 / steps * (got[0] / period - 0.5) * complex(math.cos(angle), -math.sin(angle))
            widest, narrowest = max(widest, got[0]), min(narrowest, got[0])
        expected = fundamental(amplitude, tb.phases, limit)
        dut._log.info("margin %d: %.4f vdc gives %.5f, expected %.5f", margin, amplitude, abs(first), expected)
        assert abs(first.real - expected) <= 5e-4, f"{amplitude} vdc: {first.real:.5f}, expected {expected:.5f}"
        assert abs(first.imag) <= 5e-4
        assert narrowest >= margin and widest <= period - margin
        if amplitude < edge:
            assert abs(expected - amplitude) < 1e-9, "the model is not linear below the edge"
        else:
            assert first.real > last
        last = first.real
    square = 4 / math.pi * limit
    assert abs(last - square) <= 2e-3, f"{last:.5f} vdc at the end, square waves have {square:.5f}"


@cocotb.test()
async def spacing_and_saturation(dut: Any) -> None:
    """The largest numbers of every input saturate, they do not wrap."""
    tb = TB(dut)
    await tb.start()
    dut.cfg_period_i.value = 65535
    dut.cfg_scale_i.value = FULL - 1
    dut.cfg_scale_shift_i.value = 0
    dut.cfg_band_i.value = 0
    dut.cfg_slope_i.value = FULL - 1
    dut.cfg_slope_shift_i.value = 0
    dut.cfg_dead_time_i.value = 1023
    for high in range(tb.phases):
        v = [-FULL] * tb.phases
        v[high] = FULL - 1
        got = await tb.convert(v, [FULL - 1] * tb.phases)
        assert got == [65535 if x == high else 0 for x in range(tb.phases)]
        got = await tb.convert(v, [-FULL] * tb.phases)
        assert got == [65535 if x == high else 0 for x in range(tb.phases)]
    got = await tb.convert([0] * tb.phases, [FULL - 1, -FULL] + [0] * (tb.phases - 2))
    assert got == [32768 + 1023, 32768 - 1023] + [32768] * (tb.phases - 2)
    dut.cfg_band_i.value = FULL - 1
    got = await tb.convert([0] * tb.phases, [FULL - 1, -FULL] + [0] * (tb.phases - 2))
    assert got == [32768, 32768 - 1023] + [32768] * (tb.phases - 2)


@pytest.mark.parametrize("phases", [3, 5])
def test_fl_modulator(phases: int) -> None:
    """Modulator alone.

    Verifies: MOD-01, MOD-02, MOD-03, MOD-04, MOD-05, MOD-06
    """
    run_block_test("fl_modulator", ["foc/fl_modulator.sv"], __name__, parameters={"Phases": phases})


def test_too_close_is_asserted(capfd: pytest.CaptureFixture[str]) -> None:
    """The assertion on the spacing is alive, and the published latency is the least spacing.

    Verifies: MOD-05
    """
    with pytest.raises(AssertionError):
        run_block_test("fl_modulator", ["foc/fl_modulator.sv"], "cocotb_tests.foc.too_close", parameters={"Phases": 3})
    assert "vectors closer than 12 clocks" in "".join(capfd.readouterr())


if __name__ == "__main__":
    pytest.main([__file__])
