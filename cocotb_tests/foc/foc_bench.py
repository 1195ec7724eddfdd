# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Driver of fl_foc and what its header promises, written a second time: integers for the regulator, floats else."""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, Timer

CLOCK_NS = 20
FULL_SCALE = 1 << 17
TURN = 1 << 32
LATENCY = {3: 52, 5: 99}  # clocks, published by the module
SPACING = {phases: latency + 3 for phases, latency in LATENCY.items()}
WAIT_LATENCY = {3: 21, 5: 54}  # direct: from the start until it waits
GO_LATENCY = {3: 32, 5: 75}  # direct: from the answer to the results
SOURCES = [
    *("common/fl_sine_pkg.sv", "common/fl_sincos.sv"),
    *(f"foc/{name}.sv" for name in ("fl_foc_pkg", "fl_mac", "fl_sqrt", "fl_ratio", "fl_foc")),
]

Pair = tuple[int, int]  # d, q


def clip(value: int, bits: int) -> int:
    return max(-(1 << (bits - 1)), min((1 << (bits - 1)) - 1, value))


def shift_round(value: int, shift: int) -> int:
    """Return value * 2^-shift, rounded half up."""
    return (2 * value + (1 << shift)) >> (shift + 1)


def pack(values: Sequence[int], bits: int) -> int:
    return sum((v & ((1 << bits) - 1)) << (bits * i) for i, v in enumerate(values))


def unpack(value: int, bits: int, count: int) -> list[int]:
    fields = [value >> (bits * i) & ((1 << bits) - 1) for i in range(count)]
    return [f - (1 << bits) if f >> (bits - 1) else f for f in fields]


def pairs(values: Sequence[int]) -> list[Pair]:
    return [(values[i], values[i + 1]) for i in range(0, len(values), 2)]


@dataclass
class Regulator:
    """Settings and state of one subspace's regulator; `step` is the contract in integers."""

    gain: Pair = (0, 0)
    hold: Pair = (0, 0)
    ratio: Pair = (0, 0)
    shift: int = 0
    limit: int = FULL_SCALE - 1
    enable: int = 1
    preset: Pair = (0, 0)
    reference: Pair = (0, 0)
    forward: Pair = (0, 0)
    state: Pair = (0, 0)
    error: Pair = (0, 0)
    carry: Pair = (0, 0)
    limited: bool = False

    def step(self, current: Pair) -> None:
        (g_d, g_q), (h_d, h_q), (p_d, p_q) = self.gain, self.hold, self.error
        e_d, e_q = (
            max(1 - FULL_SCALE, min(FULL_SCALE - 1, r - i)) for r, i in zip(self.reference, current, strict=True)
        )
        sums = (g_d * e_d - g_q * e_q - h_d * p_d + h_q * p_q, g_q * e_d + g_d * e_q - h_q * p_d - h_d * p_q)
        self.error = (e_d, e_q)
        if self.enable:
            d, q = (
                clip(u + c + shift_round(x, self.shift), 28)
                for u, c, x in zip(self.state, self.carry, sums, strict=True)
            )
        else:
            d, q = (p << 8 for p in self.preset)
        self.bound((d, q))

    def bound(self, wanted: Pair) -> None:
        """Limit of the circle and what it carries to the next step."""
        d, q = wanted
        m = math.isqrt(shift_round(d, 8) ** 2 + shift_round(q, 8) ** 2)
        self.limited = m > self.limit
        if self.limited:
            factor = (self.limit << 17) // m
            d, q = shift_round(d * factor, 17), shift_round(q * factor, 17)
        self.state = (d, q)
        b_d, b_q = ((w - u) >> 10 if self.enable else 0 for w, u in zip(wanted, self.state, strict=True))
        r_d, r_q = self.ratio
        self.carry = (shift_round(r_d * b_d - r_q * b_q, 7), shift_round(r_q * b_d + r_d * b_q, 7))

    def applied(self, bypass: int) -> Pair:
        d, q = (
            clip(f + (0 if bypass else shift_round(u, 8)), 18) for u, f in zip(self.state, self.forward, strict=True)
        )
        return d, q


def park(currents: Sequence[int], theta: int, harmonic: int) -> complex:
    """Vector d + jq of the subspace at harmonic * theta, amplitude-invariant."""
    m = len(currents)
    angles = (harmonic * (theta / TURN - k / m) for k in range(m))
    return 2 / m * sum(i * cmath.exp(-2j * math.pi * a) for i, a in zip(currents, angles, strict=True))


def phases_of(vectors: Sequence[complex], theta: int, phases: int) -> list[float]:
    """Phase values of the subspaces' vectors at theta."""
    return [
        sum(
            (v * cmath.exp(2j * math.pi * n * (theta / TURN - k / phases))).real
            for n, v in zip((1, 3), vectors, strict=False)
        )
        for k in range(phases)
    ]


@dataclass
class Outcome:
    """Outputs of one run."""

    current: list[Pair]
    applied: list[Pair]
    state: list[Pair]
    limited: list[bool]
    voltage: list[int] = field(default_factory=list)


class TB:
    """One run of the chain a call."""

    def __init__(self, dut: Any) -> None:
        self.dut = dut
        self.phases = len(dut.voltage_o.value) // 18
        self.subspaces = 2 if self.phases == 5 else 1
        self.latency, self.spacing = LATENCY[self.phases], SPACING[self.phases]
        self.regulators = [Regulator() for _ in range(self.subspaces)]
        self.bypass = 0

    async def clocks(self, n: int) -> None:
        if n > 0:
            await Timer(n * CLOCK_NS, "ns")

    def configure(self) -> None:
        dut, regulators = self.dut, self.regulators
        dut.bypass_i.value = self.bypass
        dut.enable_i.value = pack([r.enable for r in regulators], 1)
        dut.shift_i.value = pack([r.shift for r in regulators], 5)
        dut.limit_i.value = pack([r.limit for r in regulators], 17)
        for port, values in (
            (dut.reference_i, [r.reference for r in regulators]),
            (dut.gain_i, [r.gain for r in regulators]),
            (dut.hold_i, [r.hold for r in regulators]),
            (dut.ratio_i, [r.ratio for r in regulators]),
            (dut.preset_i, [r.preset for r in regulators]),
            (dut.forward_i, [r.forward for r in regulators]),
        ):
            port.value = pack([x for pair in values for x in pair], 18)

    async def start(self) -> None:
        dut = self.dut
        Clock(dut.clk_i, CLOCK_NS, unit="ns").start()
        dut.start_i.value = dut.current_i.value = dut.theta_i.value = dut.lead_i.value = 0
        dut.park_i.value = dut.pause_i.value = dut.skip_i.value = dut.filtered_i.value = dut.inject_i.value = 0
        dut.direct_i.value = dut.wanted_i.value = dut.go_i.value = dut.go_number_i.value = dut.abandon_i.value = 0
        self.configure()
        dut.rst_i.value = 1
        await FallingEdge(dut.clk_i)
        await self.clocks(3)
        dut.rst_i.value = 0
        await self.clocks(1)

    def outputs(self) -> Outcome:
        dut, n = self.dut, 2 * self.subspaces
        return Outcome(
            pairs(unpack(int(dut.current_o.value), 18, n)),
            pairs(unpack(int(dut.applied_o.value), 18, n)),
            pairs(unpack(int(dut.state_o.value), 28, n)),
            [bool(int(dut.limited_o.value) >> s & 1) for s in range(self.subspaces)],
            unpack(int(dut.voltage_o.value), 18, self.phases),
        )

    async def run(self, currents: Sequence[int], theta: int, lead: int = 0) -> Outcome:
        """One run to the first clock of the next; checks the latency and when phase currents and angles are taken."""
        dut = self.dut
        self.configure()
        dut.current_i.value = pack(currents, 18)
        dut.theta_i.value, dut.lead_i.value = theta % TURN, lead % TURN
        dut.start_i.value = 1
        await self.clocks(1)
        dut.start_i.value = 0
        dut.current_i.value = pack([0x15555] * self.phases, 18)
        dut.theta_i.value = dut.lead_i.value = 0x5555_5555
        await self.clocks(self.latency - 2)
        assert int(dut.valid_o.value) == 0 and int(dut.busy_o.value) == 1
        await self.clocks(1)
        assert int(dut.valid_o.value) == 1, f"not done after {self.latency} clocks"
        out = self.outputs()
        await self.clocks(self.spacing - self.latency - 1)
        assert int(dut.busy_o.value) == 1
        await self.clocks(1)
        assert int(dut.busy_o.value) == 0, f"busy after {self.spacing} clocks"
        assert self.outputs() == out
        return out

    async def begin(self, currents: Sequence[int], theta: int, lead: int = 0) -> None:
        """A direct run to the clock in which it waits, which is checked."""
        dut = self.dut
        self.configure()
        dut.direct_i.value = 1
        dut.current_i.value = pack(currents, 18)
        dut.theta_i.value, dut.lead_i.value = theta % TURN, lead % TURN
        dut.start_i.value = 1
        await self.clocks(1)
        dut.start_i.value = 0
        await self.clocks(WAIT_LATENCY[self.phases] - 2)
        assert int(dut.waiting_o.value) == 0
        await self.clocks(1)
        assert int(dut.waiting_o.value) == 1

    async def answer(self, wanted: Sequence[Pair], number: int) -> None:
        """Voltages of the core for one clock."""
        dut = self.dut
        dut.wanted_i.value = pack([x for pair in wanted for x in pair], 28)
        dut.go_number_i.value = number & 0xFFFF
        dut.go_i.value = 1
        await self.clocks(1)
        dut.go_i.value = 0
        dut.wanted_i.value = pack([0x5555555] * 2 * self.subspaces, 28)
