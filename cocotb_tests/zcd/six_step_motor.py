# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Terminal voltages of a six-step motor at constant speed, from angles alone: the oracle of the ZCD tests.

No sector table: the conducting phases are those with the largest EMF in the direction of rotation, the
floating phase is the third; its terminal is vdc/2 + 3/2 e in the on-state (`six-step.md`).
"""

from __future__ import annotations

import math
import random
from dataclasses import dataclass, field

from cocotb_tests.zcd.zcd_bench import Sample

SECTORS = ("A+B-", "A+C-", "B+C-", "B+A-", "C+A-", "C+B-")
LSB = 32  # 12-bit converter in 18-bit samples


@dataclass
class Motor:
    """Constant speed, commutation 30 degrees before and after each crossing plus `lag`, edge-aligned PWM."""

    sector_clocks: float  # time of 60 degrees
    amplitude: float  # 3/2 of the EMF's peak, 2^17 = full scale
    vdc: float
    carrier: int  # clocks
    duty: float
    sample_period: int  # clocks
    direction: int = 1
    freewheel_deg: float = 10.0  # after each commutation the floating phase is clamped by a diode
    circulating: int = 0  # clocks after each turn-on in which it is clamped too
    noise: float = 0.0  # bound of uniform noise on every channel
    lag_deg: float = 0.0  # of every commutation
    start: int = 0  # stamp of the first sample
    rng: random.Random = field(default_factory=lambda: random.Random(0))

    def angle(self, t: float) -> float:
        """Theta' of six-step.md in degrees."""
        return 33.0 + self.direction * (t - self.start) * 60.0 / self.sector_clocks

    def emf(self, phase: int, angle_deg: float) -> float:
        """3/2 of the phase's EMF."""
        return self.direction * self.amplitude * math.sin(math.radians(angle_deg - 120.0 * phase))

    def visit(self, t: float) -> int:
        """Running number of the sector visit."""
        travelled = (self.angle(t) - 30.0 * self.direction) * self.direction - self.lag_deg
        return math.floor(travelled / 60.0)

    def visit_start(self, visit: int) -> float:
        wanted = (60.0 * visit + self.lag_deg) + 30.0
        return self.start + (wanted * self.direction - 33.0) * self.direction * self.sector_clocks / 60.0

    def crossing(self, visit: int) -> float:
        """True crossing time of the visit: 30 degrees after the ideal commutation."""
        return self.visit_start(visit) + (30.0 - self.lag_deg) * self.sector_clocks / 60.0

    def phases(self, visit: int) -> tuple[int, int]:
        """Sector index and floating phase of a visit, from the EMFs in its ideal middle."""
        middle = self.angle(self.crossing(visit))
        emfs = [self.emf(p, middle) for p in range(3)]
        high, low = emfs.index(max(emfs)), emfs.index(min(emfs))
        name = f"{'ABC'[high]}+{'ABC'[low]}-"
        return SECTORS.index(name), 3 - high - low

    def quantise(self, v: float) -> int:
        code = math.floor((v + self.rng.uniform(-self.noise, self.noise)) / LSB + 0.5)
        return max(0, min(4095, code)) * LSB

    @property
    def error_bound(self) -> float:
        """Largest error of a sample relative to its threshold of vdc/2."""
        return (self.noise + LSB / 2) * 1.5 + 1.0

    def sample(self, t: int) -> tuple[Sample, bool]:
        """Sample at t, and whether a diode clamps the floating phase."""
        visit = self.visit(t)
        sector, floating = self.phases(visit)
        since_comm = t - self.visit_start(visit)
        in_carrier = (t - self.start) % self.carrier
        width = self.duty * self.carrier
        on = in_carrier < width or self.duty >= 1.0
        since_edge = math.inf if self.duty >= 1.0 else in_carrier if on else in_carrier - width
        age = int(min(since_comm, since_edge, 65535))
        e = self.emf(floating, self.angle(t))
        rising = self.emf(floating, self.angle(self.crossing(visit) + 1)) > 0
        clamped = since_comm < self.freewheel_deg / 60.0 * self.sector_clocks
        v = self.vdc / 2 + e
        if clamped:
            v = self.vdc * 1.02 if rising else -0.02 * self.vdc  # looks like past the crossing
        elif not on:
            v = self.rng.choice([0.0, self.vdc, 2 * e])
        elif since_edge < self.circulating:
            clamped = True
            v = self.rng.choice([-0.02, 1.02]) * self.vdc
        return (
            Sample(t, self.quantise(v), self.quantise(self.vdc), on, sector, age, min(int(since_comm), 65535)),
            clamped,
        )
