# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Test bench of fl_zcd: samples in, crossings out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, Timer

CLOCK_NS = 20
MASK32 = 0xFFFFFFFF
ZCD_SOURCES = [
    f"zcd/{name}.sv" for name in ("fl_asin_pkg", "fl_angle_time", "fl_interpolator", "fl_crossing_time", "fl_zcd")
]
FLOATING = (2, 1, 0, 2, 1, 0)  # phase by sector index: C, B, A, C, B, A
DIRECT_LATENCY, INTERPOLATED_LATENCY, BACK_LATENCY = 5, 23, 30  # clocks, published by the module
FIRST, INTERPOLATED, AVERAGED = range(3)
TERMINAL, STAR_POINT, MEAN = range(3)


def signed(value: int, bits: int) -> int:
    value &= (1 << bits) - 1
    return value - (1 << bits) if value >> (bits - 1) else value


@dataclass(frozen=True)
class Settings:
    """Settings of the detection as its ports take them."""

    enable: int = 1
    method: int = INTERPOLATED
    need_previous: int = 1
    settle: int = 30  # clocks
    blank: int = 0  # clocks
    margin: int = 4096  # 2^17 = full scale
    threshold: Sequence[int] = (0x10000,) * 6  # Q0.17 of vdc
    reverse: int = 0
    compute_back: int = 0
    linear: int = 0
    use_mean: int = 0
    source: int = TERMINAL
    peak: int = 0  # 2^17 = full scale
    wait_q8: int = 0x20  # of an interval


@dataclass(frozen=True)
class Sample:
    """One corrected sample set with the floating phase's voltage and the PWM state of its instant."""

    time: int  # clocks, not wrapped
    value: int
    vdc: int
    on: bool
    sector: int
    age: int
    comm_age: int


@dataclass(frozen=True)
class Crossing:
    """What the detection reports."""

    time: int  # wrapped to 32 bits
    late: bool
    sector: int
    value: int
    before: int
    back: bool = False
    averaged: bool = False


@dataclass
class TB:
    """Drives settings and samples, collects crossings. `gap` is the number of clocks a sample is given."""

    dut: Any
    gap: int = 30
    found: list[Crossing] = field(default_factory=list)
    clocks_to_valid: list[int] = field(default_factory=list)  # from the last sample_valid_i
    clock: int = 0

    async def start(self, settings: Settings) -> None:
        dut = self.dut
        Clock(dut.clk_i, CLOCK_NS, unit="ns").start()
        for name in (
            "update_i",
            "comm_applied_i",
            "sample_valid_i",
            "sample_i",
            "sample_time_i",
            "sample_pwm_i",
            "now_i",
            "interval_i",
            "mean_i",
            "known_i",
        ):
            getattr(dut, name).value = 0
        self.stage(settings)
        dut.rst_i.value = 1
        await FallingEdge(dut.clk_i)
        await self.clocks(3)
        dut.rst_i.value = 0
        await self.clocks(1)
        await self.update(settings)

    async def clocks(self, n: int) -> None:
        await Timer(n * CLOCK_NS, "ns")

    def stage(self, settings: Settings) -> None:
        dut = self.dut
        dut.cfg_enable_i.value = settings.enable
        dut.cfg_method_i.value = settings.method
        dut.cfg_compute_back_i.value = settings.compute_back
        dut.cfg_linear_i.value = settings.linear
        dut.cfg_use_mean_i.value = settings.use_mean
        dut.cfg_source_i.value = settings.source
        dut.cfg_peak_i.value = settings.peak
        dut.cfg_wait_q8_i.value = settings.wait_q8
        dut.cfg_need_previous_i.value = settings.need_previous
        dut.cfg_settle_i.value = settings.settle
        dut.cfg_blank_i.value = settings.blank
        dut.cfg_margin_i.value = settings.margin
        dut.cfg_threshold_i.value = sum(t << (17 * i) for i, t in enumerate(settings.threshold))
        dut.cfg_reverse_i.value = settings.reverse

    async def update(self, settings: Settings) -> None:
        self.stage(settings)
        self.dut.update_i.value = 1
        await self.clocks(1)
        self.dut.update_i.value = 0

    async def commutate(self) -> None:
        self.dut.comm_applied_i.value = 1
        await self.clocks(1)
        self.dut.comm_applied_i.value = 0

    async def sample(self, s: Sample) -> Crossing | None:
        """One sample set; the crossing that it gives, if any. Other channels hold what would mislead."""
        dut = self.dut
        channels = [131071] * 9
        channels[FLOATING[s.sector]] = s.value
        channels[6] = s.vdc
        dut.sample_i.value = sum((v & 0x3FFFF) << (18 * i) for i, v in enumerate(channels))
        dut.sample_time_i.value = s.time & MASK32
        dut.sample_pwm_i.value = int(s.on) << 35 | s.sector << 32 | s.age << 16 | s.comm_age
        dut.sample_valid_i.value = 1
        await self.clocks(1)
        dut.sample_valid_i.value = 0
        dut.sample_i.value = 0
        dut.sample_time_i.value = 0x1234_5678
        dut.sample_pwm_i.value = 1 << 35 | ((s.sector + 1) % 6) << 32  # the state after a commutation
        crossing = None
        for clock in (DIRECT_LATENCY, INTERPOLATED_LATENCY):
            await self.clocks(clock - (1 if clock == DIRECT_LATENCY else DIRECT_LATENCY))
            if int(dut.zc_valid_o.value):
                crossing = self.read()
                self.found.append(crossing)
                self.clocks_to_valid.append(clock)
        await self.clocks(max(1, self.gap - INTERPOLATED_LATENCY))
        return crossing

    def read(self) -> Crossing:
        dut = self.dut
        return Crossing(
            int(dut.zc_time_o.value),
            bool(int(dut.zc_late_o.value)),
            int(dut.zc_sector_o.value),
            signed(int(dut.zc_value_o.value), 18),
            signed(int(dut.zc_value_before_o.value), 18),
            bool(int(dut.zc_back_o.value)),
            bool(int(dut.zc_averaged_o.value)),
        )

    def check_counters(self) -> None:
        """The module's own counters agree with what was seen at the expected clocks: none came at another."""
        assert int(self.dut.crossings_o.value) == len(self.found) & 0xFFFF
        assert int(self.dut.late_o.value) == sum(c.late for c in self.found) & 0xFFFF
        assert int(self.dut.back_o.value) == sum(c.back for c in self.found) & 0xFFFF
        assert int(self.dut.averaged_o.value) == sum(c.averaged for c in self.found) & 0xFFFF
