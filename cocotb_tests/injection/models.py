# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What the headers of the injection blocks promise, written a second time in integers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

FULL_SCALE = 1 << 17
TURN = 1 << 32
BENCHES = Path(__file__).parent
SOURCES = [f"injection/{name}.sv" for name in ("fl_injection_pkg", "fl_injection_mac")]

Pair = tuple[int, int]  # d, q


def clip(value: int, bits: int) -> int:
    return max(-(1 << (bits - 1)), min((1 << (bits - 1)) - 1, value))


def pack(values: Sequence[int], bits: int) -> int:
    """Fields of equal width, the first one lowest."""
    return sum((v & ((1 << bits) - 1)) << (bits * i) for i, v in enumerate(values))


def signed(value: int, bits: int) -> int:
    return value - (1 << bits) if value >> (bits - 1) else value


def unpack(value: int, bits: int, count: int) -> list[int]:
    return [signed(value >> (bits * i) & ((1 << bits) - 1), bits) for i in range(count)]


def square(phase: int, period: int) -> int:
    if 2 * phase < period - 1:
        return 1
    return 0 if 2 * phase == period - 1 else -1


@dataclass(frozen=True)
class Filter:
    """Coefficients as the ports take them; k is 2^16 = 1."""

    a1: int
    a2: int
    g: int
    k: int
    fine: int

    @classmethod
    def design(cls, f0_hz: float, fs_hz: float, k: float) -> Filter:
        g = math.tan(math.pi * f0_hz / fs_hz)
        a1 = 1 / (1 + g * (g + k))
        fine = int(g * 32 < 1 - 1 / FULL_SCALE)
        one = FULL_SCALE << (5 * fine)
        return cls(
            min(FULL_SCALE - 1, round(a1 * FULL_SCALE)), round(g * a1 * one), round(g * one), round(k * 65536), fine
        )

    @property
    def bits(self) -> int:
        return self.fine << 54 | pack([self.g, self.a2, self.a1], 18)


@dataclass
class Section:
    """States of one filter on one axis; `step` returns v1, v2 and whether something saturated."""

    s1: int = 0
    s2: int = 0

    def step(self, f: Filter, x: int) -> tuple[int, int, bool]:
        shift = 22 if f.fine else 17
        half = 1 << (shift - 1)
        v1 = (f.a1 * self.s1 * (1 << (shift - 17)) + f.a2 * (x - self.s2) + half) >> shift
        w1 = clip(v1, 24)
        v2 = self.s2 + ((f.g * w1 + half) >> shift)
        w2 = clip(v2, 24)
        n1, n2 = 2 * w1 - self.s1, 2 * w2 - self.s2
        self.s1, self.s2 = clip(n1, 24), clip(n2, 24)
        return w1, w2, (w1, w2, self.s1, self.s2) != (v1, v2, n1, n2)


@dataclass
class LockInBits:
    """fl_lock_in bit by bit."""

    band: Filter
    low: Filter
    shift: int = 0
    sine: int = 0
    hf: Pair = (0, 0)
    error: int = 0
    magnitude: int = 0
    clipped: int = 0
    sections: list[list[Section]] = field(default_factory=lambda: [[Section(), Section()] for _ in range(2)])

    def step(self, current: Pair, reference: int = 0) -> None:
        flags = []
        h = []
        for section, i in zip(self.sections[0], current, strict=True):
            v1, _, flag = section.step(self.band, i << 4)
            y = (self.band.k * v1 + (1 << 15)) >> 16
            h.append(clip(y, 24))
            flags += [flag, h[-1] != y]
        sign = (h[0] > 0) - (h[0] < 0)
        out = []
        for axis, section in enumerate(self.sections[1]):
            gain = self.shift if axis else 0
            sine = (h[axis] * reference * (1 << gain) + (1 << 16)) >> 17
            m = sine if self.sine else h[axis] * sign * (1 << gain)
            x = clip(m, 24)
            _, v2, flag = section.step(self.low, x)
            out.append(v2)
            flags += [flag, x != m]
        self.magnitude, self.error = out
        d, q = (clip((y + 8) >> 4, 18) for y in h)
        self.hf = (d, q)
        self.clipped += any(flags)

    def clear(self) -> None:
        for pair in self.sections:
            for section in pair:
                section.s1 = section.s2 = 0


@dataclass
class IqBits:
    """fl_iq_demod bit by bit: `step` returns the sums (d_re, d_im, q_re, q_im) and count of the period before."""

    period: int
    sine: int = 0
    last: int = 0
    known: bool = False
    overflow: bool = False
    sums: list[int] = field(default_factory=lambda: [0] * 4)
    count: int = 0

    def step(self, current: Pair, phase: int, cosine: int, sine: int) -> tuple[list[int], int] | None:
        result = None
        if phase < self.last:
            if self.known and self.count > 4095:
                self.overflow = True
            elif self.known:
                result = (self.sums, self.count)
            self.known, self.sums, self.count = True, [0] * 4, 0
        self.last = phase
        self.count += 1
        quarter = square((phase + self.period // 4) % self.period, self.period)
        for axis, i in enumerate(current):
            if self.sine:
                c, s = (i * cosine + (1 << 14)) >> 15, (i * sine + (1 << 14)) >> 15
            else:
                c, s = 4 * i * quarter, 4 * i * square(phase, self.period)
            self.sums[2 * axis] += c
            self.sums[2 * axis + 1] -= s
        return result
