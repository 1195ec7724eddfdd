# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Correction, stamps, auto-zero and snapshot of the sensing block against exact integer arithmetic."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import floor
from typing import Any

import cocotb
import pytest
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, Timer

from fluxlock.cosim.block import run_block_test

CLOCK_NS = 20
MASK32 = 0xFFFFFFFF


def signed(value: int, bits: int) -> int:
    value &= (1 << bits) - 1
    return value - (1 << bits) if value >> (bits - 1) else value


def clip(value: int, bits: int) -> int:
    return max(-(1 << (bits - 1)), min((1 << (bits - 1)) - 1, value))


def pack(values: Sequence[int], bits: int) -> int:
    return sum((v & ((1 << bits) - 1)) << (bits * i) for i, v in enumerate(values))


def unpack(value: int, bits: int, count: int) -> list[int]:
    return [signed(value >> (bits * i), bits) for i in range(count)]


def correct(code: int, offset_q4: int, gain_q15: int, current: bool) -> int:
    """Corrected sample: code minus offset, times gain, so that full scale is 2^17; one rounding, half up."""
    lsb_q4 = clip((16 * code - offset_q4) * (2 if current else 1), 18)
    return clip(floor(Fraction(lsb_q4 * gain_q15, 1 << 14) + Fraction(1, 2)), 18)


@dataclass(frozen=True)
class Pwm:
    """PWM state as packed in fl_pkg::pwm_state_t."""

    on: int = 0
    sector: int = 0
    age: int = 0
    comm_age: int = 0

    def word(self) -> int:
        return self.on << 35 | self.sector << 32 | self.age << 16 | self.comm_age


class TB:
    """Strobes and converter answers in, published sets out."""

    def __init__(self, dut: Any) -> None:
        self.dut = dut
        self.channels = len(dut.az_mask_i.value)
        self.phases = (self.channels - 3) // 2
        self.latency = self.channels + 4
        self.current_latency = self.phases + 4
        self.offsets = [0] * self.channels
        self.gains = [0x8000] * self.channels

    def is_current(self, channel: int) -> bool:
        return self.phases <= channel < 2 * self.phases or channel == 2 * self.phases + 1

    def expected(self, codes: Sequence[int]) -> list[int]:
        return [correct(code, self.offsets[c], self.gains[c], self.is_current(c)) for c, code in enumerate(codes)]

    def configure(self) -> None:
        self.dut.cfg_offset_i.value = pack(self.offsets, 18)
        self.dut.cfg_gain_i.value = pack(self.gains, 16)

    async def clocks(self, n: int) -> None:
        if n > 0:
            await Timer(n * CLOCK_NS, "ns")

    async def start(self) -> None:
        dut = self.dut
        Clock(dut.clk_i, CLOCK_NS, unit="ns").start()
        for name in (
            "strobe_i",
            "now_i",
            "pwm_state_i",
            "adc_valid_i",
            "adc_code_i",
            "cfg_delay_i",
            "az_start_i",
            "az_log2_i",
            "az_mask_i",
            "tick_i",
        ):
            getattr(dut, name).value = 0
        self.configure()
        dut.rst_i.value = 1
        await FallingEdge(dut.clk_i)
        await self.clocks(3)
        dut.rst_i.value = 0
        await self.clocks(1)

    async def pulse(self, name: str) -> None:
        """High for the rest of this clock, low from the next one on."""
        getattr(self.dut, name).value = 1
        await self.clocks(1)
        getattr(self.dut, name).value = 0

    async def strobe(self, now: int = 0, pwm: Pwm | None = None) -> None:
        self.dut.now_i.value = now & MASK32
        self.dut.pwm_state_i.value = (pwm or Pwm()).word()
        await self.pulse("strobe_i")
        self.dut.now_i.value = 0x5555_5555
        self.dut.pwm_state_i.value = Pwm(1, 7, 0x5555, 0x5555).word()

    async def valid(self, codes: Sequence[int]) -> None:
        self.dut.adc_code_i.value = pack(codes, 12)
        await self.pulse("adc_valid_i")
        self.dut.adc_code_i.value = pack([0x5A5] * self.channels, 12)

    def sample(self) -> list[int]:
        return unpack(int(self.dut.sample_o.value), 18, self.channels)

    async def convert(self, codes: Sequence[int]) -> list[int]:
        """One whole set; returns the published one."""
        await self.strobe()
        await self.valid(codes)
        await self.clocks(self.latency - 1)
        assert int(self.dut.sample_valid_o.value) == 1, f"no set {self.latency} clocks after the codes"
        return self.sample()

    def random_codes(self, rng: random.Random) -> list[int]:
        return [rng.choice([0, 1, 2047, 2048, 4094, 4095, rng.randrange(4096)]) for _ in range(self.channels)]


@cocotb.test()
async def correction_is_exact(dut: Any) -> None:
    """Offset, gain, scaling, rounding and saturation of every channel, over random and extreme settings.

    Verifies: SENSE-04
    """
    rng = random.Random(4)
    tb = TB(dut)
    await tb.start()
    for _ in range(400):
        for c in range(tb.channels):
            usual = 2048 * 16 if tb.is_current(c) else 0
            tb.offsets[c] = rng.choice([usual, usual + rng.randrange(-800, 800), rng.randrange(-(1 << 17), 1 << 17)])
            tb.gains[c] = rng.choice([0x8000, rng.randrange(0x7000, 0x9000), 0, 0xFFFF, rng.randrange(1 << 16)])
        tb.configure()
        codes = tb.random_codes(rng)
        got = await tb.convert(codes)
        assert got == tb.expected(codes), f"codes {codes}, offsets {tb.offsets}, gains {tb.gains}"


@cocotb.test()
async def full_scale_is_two_to_the_17(dut: Any) -> None:
    """With nominal settings a voltage code v is 32 v and a current code i is 64 (i - 2048).

    Verifies: SENSE-04
    """
    tb = TB(dut)
    tb.offsets = [2048 * 16 if tb.is_current(c) else 0 for c in range(tb.channels)]
    await tb.start()
    for code in (0, 1, 1000, 2047, 2048, 2049, 4095):
        got = await tb.convert([code] * tb.channels)
        assert got == [64 * (code - 2048) if tb.is_current(c) else 32 * code for c in range(tb.channels)]


@cocotb.test()
async def stamps_belong_to_the_strobe(dut: Any) -> None:
    """Time less delay and PWM state are those of the strobe's clock; latencies are constant; sets stay.

    Verifies: SENSE-05, SENSE-06
    """
    rng = random.Random(5)
    tb = TB(dut)
    await tb.start()
    for number in range(1, 151):
        delay = rng.choice([0, 1, 50, 65535, rng.randrange(1000)])
        dut.cfg_delay_i.value = delay
        now = rng.choice([rng.randrange(1 << 32), rng.randrange(70000), 0xFFFF_FFF0 + rng.randrange(16)])
        pwm = Pwm(rng.randrange(2), rng.randrange(6), rng.randrange(1 << 16), rng.randrange(1 << 16))
        codes = tb.random_codes(rng)
        before = tb.sample()
        await tb.strobe(now, pwm)
        await tb.clocks(rng.choice([0, 1, 30, 44]))
        await tb.valid(codes)
        for clock in range(1, tb.latency):
            assert int(dut.sample_valid_o.value) == 0
            assert tb.sample() == before, "the published set changed before sample_valid"
            assert int(dut.current_valid_o.value) == int(clock == tb.current_latency), f"clock {clock}"
            if clock == tb.current_latency:
                currents = unpack(int(dut.current_o.value), 18, tb.phases)
                assert currents == tb.expected(codes)[tb.phases : 2 * tb.phases]
                assert int(dut.current_time_o.value) == (now - delay) & MASK32
            await tb.clocks(1)
        assert int(dut.current_valid_o.value) == 0
        assert int(dut.sample_valid_o.value) == 1
        assert tb.sample() == tb.expected(codes)
        assert int(dut.sample_time_o.value) == (now - delay) & MASK32, f"now {now}, delay {delay}"
        assert int(dut.sample_pwm_o.value) == pwm.word()
        assert int(dut.sample_number_o.value) == number
        await tb.clocks(1)
        assert int(dut.sample_valid_o.value) == 0


@cocotb.test()
async def back_to_back_at_the_least_period(dut: Any) -> None:
    """Sets at the least spacing, each strobe in the clock of the valid before it: no set or stamp is lost.

    Verifies: SENSE-05, SENSE-06
    """
    rng = random.Random(6)
    tb = TB(dut)
    await tb.start()
    sets = [(tb.random_codes(rng), rng.randrange(1 << 32), Pwm(i & 1, i % 6, i, 2 * i)) for i in range(200)]
    got: list[tuple[list[int], int, int]] = []

    async def watch() -> None:
        while True:
            await FallingEdge(dut.sample_valid_o)  # the clock after: everything is still there
            got.append((tb.sample(), int(dut.sample_time_o.value), int(dut.sample_pwm_o.value)))

    cocotb.start_soon(watch())
    spacing = tb.channels + 3
    assert spacing <= 16
    await tb.strobe(sets[0][1], sets[0][2])
    await tb.clocks(15)
    for i, (codes, _, _) in enumerate(sets):
        dut.adc_code_i.value = pack(codes, 12)
        dut.adc_valid_i.value = 1
        if i + 1 < len(sets):
            dut.now_i.value = sets[i + 1][1]
            dut.pwm_state_i.value = sets[i + 1][2].word()
            dut.strobe_i.value = 1
        await tb.clocks(1)
        dut.adc_valid_i.value = 0
        dut.strobe_i.value = 0
        await tb.clocks(spacing - 1)
    await tb.clocks(20)
    assert got == [(tb.expected(c), t, p.word()) for c, t, p in sets]


@cocotb.test()
async def lost_and_stray_conversions(dut: Any) -> None:
    """A valid without a strobe gives no set; after a lost conversion the next set has its own stamp again.

    Verifies: SENSE-06
    """
    tb = TB(dut)
    await tb.start()
    await tb.valid([100] * tb.channels)
    await tb.clocks(40)
    assert int(dut.sample_number_o.value) == 0, "a valid without a strobe was published"
    await tb.strobe(1000)  # its answer never comes
    await tb.clocks(50)
    await tb.strobe(2000)
    await tb.clocks(20)
    await tb.valid([200] * tb.channels)
    await tb.clocks(20)
    await tb.valid([300] * tb.channels)
    await tb.clocks(40)
    assert int(dut.sample_number_o.value) == 1
    assert int(dut.sample_time_o.value) == 2000
    assert tb.sample() == tb.expected([200] * tb.channels)


async def average(tb: TB, rng: random.Random, log2: int, mask: int) -> tuple[dict[int, int], list[list[int]]]:
    """Run an auto-zero; offsets written by channel, and the codes that were averaged."""
    dut = tb.dut
    written: dict[int, int] = {}
    dut.az_log2_i.value = log2
    dut.az_mask_i.value = mask
    await tb.pulse("az_start_i")
    dut.az_log2_i.value = 3
    dut.az_mask_i.value = 0
    assert int(dut.az_busy_o.value) == 1
    count = 1 << min(log2, 10)
    base = [rng.randrange(20, 4070) for _ in range(tb.channels)]
    codes = [[b + rng.randrange(-20, 21) for b in base] for _ in range(count)]
    for i, row in enumerate(codes):
        assert int(dut.az_busy_o.value) == 1, f"over after {i} of {count} sets"
        assert not written
        await tb.strobe()
        await tb.valid(row)
        for _ in range(tb.channels + 4 if i == count - 1 else 0):
            write_enable = int(dut.az_offset_we_o.value)
            for c in range(tb.channels):
                if write_enable >> c & 1:
                    assert c not in written
                    written[c] = unpack(int(dut.az_offset_o.value), 18, tb.channels)[c]
            await tb.clocks(1)
        await tb.clocks(tb.channels + 3)
    assert int(dut.az_busy_o.value) == 0
    return written, codes


@cocotb.test()
@cocotb.parametrize(log2=[0, 1, 2, 4, 6, 9, 10, 13])
async def auto_zero_averages(dut: Any, log2: int) -> None:
    """Means of 2^log2 codes, rounded to 1/16 LSB, are written to exactly the masked channels.

    Verifies: SENSE-07
    """
    rng = random.Random(log2)
    tb = TB(dut)
    await tb.start()
    for mask in ((1 << tb.channels) - 1, rng.randrange(1 << tb.channels)):
        written, codes = await average(tb, rng, log2, mask)
        expected = {
            c: floor(Fraction(16 * sum(row[c] for row in codes), len(codes)) + Fraction(1, 2))
            for c in range(tb.channels)
            if mask >> c & 1
        }
        assert written == expected


@cocotb.test()
async def auto_zero_restarts(dut: Any) -> None:
    """A start in the middle of an average, even in the middle of a set, begins anew with the next whole set.

    Verifies: SENSE-07
    """
    tb = TB(dut)
    await tb.start()
    full = (1 << tb.channels) - 1
    dut.az_log2_i.value = 2
    dut.az_mask_i.value = full
    await tb.pulse("az_start_i")
    for _ in range(2):
        await tb.convert([4000] * tb.channels)
    await tb.strobe()
    await tb.valid([4000] * tb.channels)
    await tb.clocks(4)
    await tb.pulse("az_start_i")  # four channels of this set have passed
    await tb.clocks(20)
    writes = []
    for i in range(4):
        await tb.strobe()
        await tb.valid([100 + i] * tb.channels)
        for _ in range(tb.channels + 6):
            if int(dut.az_offset_we_o.value):
                writes.append((i, int(dut.az_offset_we_o.value), int(dut.az_offset_o.value) & 0x3FFFF))
            await tb.clocks(1)
    order = [*range(tb.phases, 2 * tb.phases), *range(tb.phases), *range(2 * tb.phases, tb.channels)]
    assert writes == [(3, 1 << c, 16 * 100 + 24) for c in order]
    assert int(dut.az_busy_o.value) == 0


@cocotb.test()
async def snapshot_is_coherent(dut: Any) -> None:
    """Ticks at random clocks latch one whole set with number and time, and each set is summed once.

    Verifies: SENSE-08
    """
    rng = random.Random(9)
    tb = TB(dut)
    tb.offsets = [2048 * 16 if tb.is_current(c) else 0 for c in range(tb.channels)]
    await tb.start()
    vdc, idc = 2 * tb.phases, 2 * tb.phases + 1
    published: list[tuple[int, list[int]]] = []  # time and set, in order
    used = 0
    ticks = 0
    for i in range(1500):
        codes = tb.random_codes(rng)
        await tb.strobe(50 * i)
        await tb.valid(codes)
        spare = rng.choice([0, 0, 0, 5])
        tick_in = rng.randrange(-1, tb.latency + 3)  # -1: no tick in this set
        for clock in range(1, tb.latency + 3 + spare):
            if clock == tb.latency:
                published.append((50 * i, tb.expected(codes)))
            if clock == tick_in and published:
                await tb.pulse("tick_i")
                ticks += 1
                part = published[used:]
                used = len(published)
                assert int(dut.snap_number_o.value) == len(published)
                assert int(dut.snap_time_o.value) == published[-1][0]
                assert unpack(int(dut.snap_sample_o.value), 18, tb.channels) == published[-1][1]
                assert int(dut.snap_count_o.value) == len(part)
                assert dut.snap_vdc_sum_o.value.to_signed() == sum(p[1][vdc] for p in part)
                assert dut.snap_idc_sum_o.value.to_signed() == sum(p[1][idc] for p in part)
            else:
                await tb.clocks(1)
    assert ticks > 1000


@cocotb.test()
@cocotb.parametrize(code=[0, 4095])
async def sums_saturate(dut: Any, code: int) -> None:
    """Sums stop at the ends of 32 bits instead of wrapping.

    Verifies: SENSE-08
    """
    tb = TB(dut)
    tb.offsets = [2048 * 16 if tb.is_current(c) else 16 * 4095 * (code == 0) for c in range(tb.channels)]
    await tb.start()
    sets = 16_500
    value = tb.expected([code] * tb.channels)
    dut.adc_code_i.value = pack([code] * tb.channels, 12)
    for _ in range(sets):  # strobe and valid in one clock: the valid answers the strobe before
        dut.strobe_i.value = 1
        dut.adc_valid_i.value = 1
        await tb.clocks(1)
        dut.strobe_i.value = 0
        dut.adc_valid_i.value = 0
        await tb.clocks(15)
    await tb.clocks(20)
    await tb.pulse("tick_i")
    assert int(dut.snap_count_o.value) == sets - 1
    for got, channel in ((dut.snap_vdc_sum_o, 2 * tb.phases), (dut.snap_idc_sum_o, 2 * tb.phases + 1)):
        assert got.value.to_signed() == clip((sets - 1) * value[channel], 32)
    assert abs((sets - 1) * value[2 * tb.phases + 1]) > 1 << 31, "the stimulus does not reach saturation"
    await tb.pulse("tick_i")
    assert int(dut.snap_count_o.value) == 0 and dut.snap_idc_sum_o.value.to_signed() == 0


@pytest.mark.parametrize("phases", [3, 5])
def test_fl_sense(phases: int) -> None:
    """Sensing block test, builds for three and five phases."""
    run_block_test("fl_sense", ["sense/fl_auto_zero.sv", "sense/fl_sense.sv"], __name__, parameters={"Phases": phases})


def test_assertions_are_alive(capfd: pytest.CaptureFixture[str]) -> None:
    """Sets closer than the contract allows stop the simulation with the module's own message.

    Verifies: SENSE-05
    """
    with pytest.raises(AssertionError):
        run_block_test("fl_sense", ["sense/fl_auto_zero.sv", "sense/fl_sense.sv"], "cocotb_tests.sense.too_close")
    assert "sample sets closer than Channels + 3 clocks" in "".join(capfd.readouterr())
