# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Injection path on a machine: its own voltage makes the HF current in which each method finds the angle error."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass, field, replace
from typing import Any

import cocotb
import pytest

from cocotb_tests.injection.bench import Bench
from cocotb_tests.injection.models import FULL_SCALE, SOURCES, TURN, Filter, pack, unpack
from fluxlock.cosim.block import run_block_test
from fluxlock.theory.injection.chain import ExactHfCurrent, HfMachine

SPACING = 110  # clocks from update to update
SAMPLE_CLOCKS = 3  # strobe to sample
LOCK_IN, CONVENTIONAL, IQ, SEPARATOR = range(4)
LATENCY = {LOCK_IN: 40, CONVENTIONAL: 40, IQ: 41, SEPARATOR: 2}
CURRENT_LATENCY = 19  # SEPARATOR with remove: that of its result
BUSY_CLOCKS = 48
U_V, VOLTAGE_SCALE_V, CURRENT_SCALE_A = 20.0, 250.0, 20.0
TIAN = HfMachine(r_ohm=0.0, ld_h=6.54e-3, lq_h=8.32e-3)
PATH_SOURCES = [
    "common/fl_sine_pkg.sv",
    "common/fl_sincos.sv",
    *SOURCES,
    *(f"injection/{name}.sv" for name in ("fl_injection", "fl_lock_in", "fl_iq_demod", "fl_separator")),
    "injection/fl_injection_path.sv",
]


@dataclass
class Settings:
    """Fields of settings_t, the highest first."""

    enable: int = 1
    method: int = LOCK_IN
    remove: int = 1
    period: int = 40
    first: int = 10
    delay: int = 2
    rate: int = round(TURN * 16 / (40 * SPACING))
    amplitude: list[int] = field(default_factory=lambda: [round(U_V / VOLTAGE_SCALE_V * FULL_SCALE), 0, 0, 0])
    lag: int = TURN // 4
    sine: int = 1
    band: Filter = field(default_factory=lambda: Filter.design(257.5, 10_300, 0.45))
    low: Filter = field(default_factory=lambda: Filter.design(51.5, 10_300, math.sqrt(2)))
    shift: int = 3

    @property
    def bits(self) -> int:
        value = 0
        for part, width in (
            (self.enable, 1),
            (self.method, 2),
            (self.remove, 1),
            (self.period, 12),
            (self.first, 12),
            (self.delay, 12),
            (self.rate, 32),
            (pack(self.amplitude, 18), 72),
            (self.lag, 32),
            (self.sine, 1),
            (self.band.bits, 55),
            (self.band.k & 0x3FFFF, 18),
            (self.low.bits, 55),
            (self.shift, 3),
        ):
            value = value << width | part
        return value


@dataclass
class Sample:
    """What one sample brought: complex d + jq."""

    current: complex
    regulated: complex | None
    hf: complex
    result: tuple[complex, complex] | None  # of d and of q, re + j im
    count: int
    peak: int


class TB(Bench):
    """The machine stands `error` ahead of the estimate; `strobes` samples an update; latencies are checked."""

    def __init__(self, dut: Any, error: float, period_s: float, strobes: int = 1) -> None:
        super().__init__(dut)
        self.error = error
        self.strobes = strobes
        self.machine = ExactHfCurrent(TIAN, 0.0, period_s / strobes)
        self.acting = 0.0
        self.samples: list[Sample] = []

    async def start(self, settings: Settings) -> None:
        self.settings = settings
        ports = ("clear_i", "update_i", "second_i", "strobe_i", "sample_valid_i", "current_i")
        await self.reset(*ports, settings_i=settings.bits)

    def voltage(self) -> float:
        """Voltage on the estimated d axis (V); the other axes carry none."""
        d, *others = unpack(int(self.dut.voltage_o.value), 18, len(self.dut.voltage_o.value) // 18)
        assert not any(others)
        return d / FULL_SCALE * VOLTAGE_SCALE_V

    async def update(self, fundamental: complex = 0j) -> None:
        """One update and its samples."""
        dut = self.dut
        computed = self.voltage()
        dut.update_i.value = 1
        await self.clocks(1)
        dut.update_i.value = 0
        each = SPACING // self.strobes
        for k in range(self.strobes):
            # A sample at the update sees what acted before it.
            hf = self.machine.step(self.acting, -self.error, 0.0) * cmath.exp(1j * self.error)
            if k == 0:
                self.acting = computed
            await self.sample(hf + fundamental, each - (k == 0))

    async def sample(self, current: complex, clocks: int) -> None:
        dut = self.dut
        dut.strobe_i.value = 1
        await self.clocks(1)
        dut.strobe_i.value = 0
        await self.clocks(SAMPLE_CLOCKS - 1)
        codes = [round(x / CURRENT_SCALE_A * FULL_SCALE) for x in (current.real, current.imag)]
        dut.current_i.value = pack(codes, 18)
        dut.sample_valid_i.value = 1
        await self.clocks(1)
        dut.sample_valid_i.value = 0
        dut.current_i.value = pack((0x15555, 0x15555), 18)
        method = self.settings.method
        found = Sample(complex(*codes), None, 0j, None, 0, 0)
        early = LATENCY[SEPARATOR] if method == SEPARATOR and self.settings.remove else CURRENT_LATENCY
        for clock in range(1, BUSY_CLOCKS + 2):
            if int(dut.current_valid_o.value):
                assert clock == early, f"current after {clock} clocks"
                found.regulated = complex(*unpack(int(dut.current_o.value), 18, 2))
                found.hf = complex(*unpack(int(dut.hf_o.value), 18, 2))
            if int(dut.result_valid_o.value):
                assert clock == LATENCY[method], f"result after {clock} clocks"
                values = unpack(int(dut.result_o.value), 32, 4)
                found.result = (complex(values[0], values[2]), complex(values[1], values[3]))
                found.count, found.peak = int(dut.count_o.value), int(dut.peak_o.value)
            if clock <= LATENCY[LOCK_IN]:
                assert int(dut.busy_o.value) == 1
            await self.clocks(1)
        assert int(dut.busy_o.value) == 0, "busy too long"
        await self.clocks(clocks - SAMPLE_CLOCKS - BUSY_CLOCKS - 2)
        self.samples.append(found)


def expected_ratio(error: float) -> float:
    """I_qh / I_dh in the estimated frame."""
    return TIAN.difference_h * math.sin(2 * error) / (TIAN.sum_h + TIAN.difference_h * math.cos(2 * error))


@cocotb.test()
@cocotb.parametrize(case=[(LOCK_IN, 1, 1), (CONVENTIONAL, 1, 1), (IQ, 1, 1), (IQ, 0, 2)], degrees=[3.0, -8.0])
async def methods_find_the_error(dut: Any, case: tuple[int, int, int], degrees: float) -> None:
    """Lock-in, conventional and I/Q with sine and, oversampled, square reference beside a fundamental; removal.

    Verifies: INJ-09, INJ-11
    """
    method, sine, strobes = case
    error = math.radians(degrees)
    settings = Settings(method=method, sine=sine)
    tb = TB(dut, error, 1 / 10_300, strobes)
    await tb.start(settings)
    for _ in range(800 if method != IQ else 250):
        await tb.update(fundamental=1 + 3j)
    results = [(s.count, s.result) for s in tb.samples if s.result is not None]
    d, q = results[-1][1]
    if method == IQ:
        assert {count for count, _ in results} == {40 * strobes} and len(results) >= 4
        ratio = q / d
    else:
        assert len(results) == len(tb.samples)
        ratio = q.real / (1 << settings.shift) / d.real + 0j
    expected = expected_ratio(error)
    assert abs(ratio - expected) < 0.01 * abs(expected), f"{ratio} not {expected}"
    # In the last period: hf is the triangle's fundamental, what goes to the regulators the rest.
    last = tb.samples[-40 * strobes :]
    regulated = [s.regulated for s in last if s.regulated is not None]
    assert regulated == [s.current - s.hf for s in last]
    if strobes == 1:
        swing = max(s.current.real for s in last) - min(s.current.real for s in last)
        left = max(i.real for i in regulated) - min(i.real for i in regulated)
        assert left < 0.25 * swing, f"{left} of {swing} left"
    assert int(dut.overrun_o.value) == 0 and int(dut.clipped_o.value) == 0


@cocotb.test()
@cocotb.parametrize(remove=[0, 1], degrees=[3.0, -8.0])
async def separator_finds_the_error(dut: Any, remove: int, degrees: float) -> None:
    """Period 4: amplitudes twice an injection period, the fundamental for the regulators.

    Verifies: INJ-09, INJ-11
    """
    error = math.radians(degrees)
    t_s = 125e-6
    tb = TB(dut, error, t_s)
    await tb.start(replace(Settings(), method=SEPARATOR, remove=remove, period=4, first=1))
    fundamental = 1.0 + 3.0j
    for _ in range(40):
        await tb.update(fundamental)
    scale = FULL_SCALE / CURRENT_SCALE_A
    results = [(s, s.result) for s in tb.samples[8:] if s.result is not None]
    peaks = [s.peak for s, _ in results]
    assert peaks == [k % 2 ^ peaks[0] for k in range(16)]
    volt_seconds = U_V * t_s
    expected = volt_seconds * complex(
        math.cos(error) ** 2 / TIAN.ld_h + math.sin(error) ** 2 / TIAN.lq_h,
        math.sin(2 * error) / 2 * TIAN.difference_h / (TIAN.ld_h * TIAN.lq_h),
    )
    for _, (d, q) in results:
        assert abs(complex(d.real, q.real) / 2 / scale - expected) < 2 / scale, f"{d}, {q}, not {expected * scale * 2}"
    for s in tb.samples[8:]:
        if remove:
            assert s.regulated is None or abs(s.regulated - fundamental * scale) < 2, f"{s}"
        else:
            assert s.regulated == s.current


@cocotb.test()
@cocotb.parametrize(updates=[40, 41, 42, 43])
async def separator_goes_on_until_the_wave_has_gone(dut: Any, updates: int) -> None:
    """The sample at which the wave ends is a peak: the regulators get the zero crossing before it, then samples.

    Verifies: INJ-25
    """
    tb = TB(dut, math.radians(3.0), 125e-6)
    settings = replace(Settings(), method=SEPARATOR, period=4, first=1)
    await tb.start(settings)
    fundamental = 1.0 + 3.0j
    for _ in range(updates):
        await tb.update(fundamental)
    assert int(dut.active_o.value) == 1
    dut.settings_i.value = replace(settings, enable=0).bits
    scale = FULL_SCALE / CURRENT_SCALE_A
    delays, ended = [], 0
    while ended < 4:
        await tb.update(fundamental)
        ended += 1 - int(dut.active_o.value)
        delays.append(int(dut.current_delay_o.value))
        seen = complex(*unpack(int(dut.current_o.value), 18, 2))
        assert abs(seen - fundamental * scale) < 3, f"{ended} after the end: {seen}, not {fundamental * scale}"
        if ended == 1:
            peak = abs(tb.samples[-1].current - fundamental * scale)
            assert peak > 0.5 * U_V * 125e-6 / TIAN.lq_h * scale, f"no peak: {peak}"
    assert delays[-4:] == [LATENCY[SEPARATOR], 0, 0, 0]


@cocotb.test()
async def samples_too_close_are_counted(dut: Any) -> None:
    """A sample while one is in work is ignored and counted; without remove the current passes unchanged.

    Verifies: INJ-10
    """
    tb = TB(dut, 0.0, 1 / 10_300)
    await tb.start(Settings(remove=0))
    dut.sample_valid_i.value = 1
    dut.current_i.value = pack((1000, -1000), 18)
    await tb.clocks(1)
    dut.current_i.value = 0
    await tb.clocks(5)
    dut.sample_valid_i.value = 0
    await tb.clocks(CURRENT_LATENCY - 6)
    assert int(dut.current_valid_o.value) == 1
    assert unpack(int(dut.current_o.value), 18, 2) == [1000, -1000]
    assert int(dut.overrun_o.value) == 5


@pytest.mark.parametrize("subspaces", [1, 2])
def test_fl_injection_path(subspaces: int) -> None:
    """The whole path for one and two subspaces."""
    run_block_test("fl_injection_path", PATH_SOURCES, __name__, parameters={"Subspaces": subspaces})
