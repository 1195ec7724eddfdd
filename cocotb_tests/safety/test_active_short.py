# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Active short circuit after a trip: trips and guard against a reference that looks back at what happened.

The reference keeps a record of every clock. A short is there while all of this holds: a cause is latched or present; in
the last clock without one the guard was enabled; and from that clock to this one a short was chosen and nothing forbade
it.
"""

from __future__ import annotations

import random
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge

from cocotb_tests.safety.test_fl_gate_guard import LegReference
from fluxlock.base.paths import ROOT
from fluxlock.cosim.block import run_block_test

Dut: TypeAlias = Any  # handles are found by name at run time
PHASE, DC, PIN, LOST, OVER, UNDER, SOFT, DEADLINE = (1 << i for i in range(8))
FORBIDDING = PHASE | DC | PIN
PULSES = {"lost_i": LOST, "software_i": SOFT, "deadline_i": DEADLINE}
MIDDLE = 2048
LOWER = 0b101010
LIMITS = {"cfg_phase_lsb_i": 1000, "cfg_dc_lsb_i": 500, "cfg_over_lsb_i": 3000, "cfg_under_lsb_i": 1000}
# Codes of i0, vdc and idc that show a cause of the converter.
SHOWN = {0: (MIDDLE, 2000, MIDDLE), PHASE: (0, 2000, MIDDLE), DC: (MIDDLE, 2000, 4095), OVER: (MIDDLE, 3001, MIDDLE),
         UNDER: (MIDDLE, 999, MIDDLE)}  # fmt: skip


@dataclass
class Reference:
    """`trips` tells what the inputs of a clock do in it, `edge` gives the gates after its end."""

    codes: int = 0
    pins: tuple[int, int] = (0, 0)
    latched: int = 0
    past: list[tuple[bool, bool, bool]] = field(
        default_factory=list
    )  # tripped, guard enabled, chosen and not forbidden
    legs: list[LegReference] = field(default_factory=lambda: [LegReference() for _ in range(3)])

    def active(self, x: dict[str, int]) -> int:
        pulses = sum(cause for name, cause in PULSES.items() if x[name])
        return (self.codes | pulses | PIN * self.pins[1]) & x["cfg_enable_i"]

    def trips(self, x: dict[str, int]) -> tuple[bool, bool]:
        """Tripped and shorted in this clock."""
        causes = self.latched | self.active(x)
        good = bool(x["cfg_short_i"]) and not x["never_i"] and not causes & FORBIDDING
        if not causes or not good:
            return bool(causes), False
        for tripped, enabled, was_good in reversed(self.past):
            if not was_good:
                return True, False
            if not tripped:
                return True, enabled
        return True, False

    def edge(self, x: dict[str, int], shown: int) -> int:
        tripped, shorted = self.trips(x)
        active = self.active(x)
        causes = self.latched | active
        good = bool(x["cfg_short_i"]) and not x["never_i"] and not causes & FORBIDDING
        self.past.append((tripped, bool(x["guard_enable_i"]), good))
        gates = 0
        for i, leg in enumerate(self.legs):
            asked = (
                bool(x["req_h_i"] >> i & 1),
                bool(x["req_l_i"] >> i & 1),
                bool(x["guard_enable_i"]) and not tripped,
            )
            upper, lower = leg.step(*((False, True, True) if shorted else asked), x["dead_time_i"])
            gates |= upper << 2 * i | lower << 2 * i + 1
        self.latched = (0 if x["clear_i"] else self.latched) | active
        if x["adc_valid_i"]:
            self.codes = shown
        self.pins = (x["fault_pin_i"], self.pins[0])
        return gates


class ShortTb:
    def __init__(self, dut: Dut) -> None:
        self.dut = dut
        names = (
            "adc_valid_i",
            "fault_pin_i",
            *PULSES,
            "guard_enable_i",
            "never_i",
            "clear_i",
            "log_index_i",
            "req_l_i",
        )
        self.inputs = dict.fromkeys(names, 0) | LIMITS
        self.inputs |= {"cfg_enable_i": 0xFF, "cfg_short_i": 1, "req_h_i": 7, "dead_time_i": 5, "adc_code_i": 0}
        self.reference = Reference()
        self.shorts = 0

    async def start(self) -> None:
        for name, value in {**self.inputs, "rst_i": 1}.items():
            getattr(self.dut, name).value = value
        Clock(self.dut.clk_i, 20, "ns").start()
        for _ in range(3):
            await FallingEdge(self.dut.clk_i)
        self.dut.rst_i.value = 0
        await self.clocks(2)
        await self.step(guard_enable_i=1)
        await self.clocks(1100)
        assert self.gates() == LOWER >> 1, "the guard does not conduct"

    def gates(self) -> int:
        return int(self.dut.gate_o.value)

    async def step(self, shown: int | None = None, **changes: int) -> None:
        """One clock with these inputs and a sample set that shows a cause; pulses last for this clock."""
        if shown is not None:
            i0, vdc, idc = SHOWN[shown]
            codes = [100, 200, 300, i0, MIDDLE, MIDDLE, vdc, idc, 50]
            changes |= {"adc_valid_i": 1, "adc_code_i": sum(c << 12 * i for i, c in enumerate(codes))}
        self.inputs.update(changes)
        for name, value in changes.items():
            getattr(self.dut, name).value = value
        expected = self.reference.edge(self.inputs, shown or 0)
        await FallingEdge(self.dut.clk_i)
        assert int(self.dut.short_o.value) == self.reference.trips(self.inputs)[1]
        for name in (*PULSES, "clear_i", "adc_valid_i"):
            if self.inputs[name]:
                self.inputs[name] = 0
                getattr(self.dut, name).value = 0
        assert self.gates() == expected, f"gates {self.gates():06b}, expected {expected:06b}; {self.inputs}"
        assert int(self.dut.latched_o.value) == self.reference.latched
        self.shorts += expected == LOWER

    async def clocks(self, n: int) -> None:
        for _ in range(n):
            await self.step()

    async def shorted(self, trip: str = "software_i") -> None:
        """From gates that switch to a short."""
        await self.step(**{trip: 1})
        assert self.gates() == 0, "upper gates off one clock after the cause"
        await self.step(guard_enable_i=0)
        await self.clocks(4)
        assert self.gates() == LOWER, "lower gates on after the dead time"

    async def again(self) -> None:
        """Every cause gone, the key, and the guard enabled."""
        await self.step(0, fault_pin_i=0, never_i=0, guard_enable_i=0, cfg_short_i=1)
        await self.clocks(4)
        await self.step(clear_i=1)
        await self.clocks(8)
        assert self.gates() == 0, "the key ends the short, not the open state of the drive"
        await self.step(guard_enable_i=1)
        await self.clocks(8)
        assert self.gates() == LOWER >> 1


@cocotb.test()
async def causes_that_allow_it(dut: Dut) -> None:
    """Lost lock, over- and under-voltage, software and deadline; what is asked meanwhile does not matter."""
    tb = ShortTb(dut)
    await tb.start()
    for name in PULSES:
        await tb.shorted(name)
        for requests in range(8):
            await tb.step(req_h_i=requests, req_l_i=7 - requests)
            assert tb.gates() == LOWER
        await tb.step(req_h_i=7, req_l_i=0)
        await tb.again()
    for cause in (OVER, UNDER):
        await tb.step(cause)
        assert tb.gates() == LOWER >> 1
        await tb.step()
        assert tb.gates() == 0, "upper gates off two clocks after the code"
        await tb.step(guard_enable_i=0)
        await tb.clocks(4)
        assert tb.gates() == LOWER
        await tb.step(clear_i=1)
        await tb.clocks(3)
        assert tb.gates() == LOWER, "cleared while the cause is there"
        await tb.again()


@cocotb.test()
async def causes_that_forbid_it(dut: Dut) -> None:
    """They open the gates, before a short or in one, and it does not return before everything is clear and enabled."""
    tb = ShortTb(dut)
    await tb.start()
    for before in (True, False):
        for cause in (PHASE, DC, PIN, 0):
            if not before:
                await tb.shorted()
            if cause in (PHASE, DC):
                await tb.step(cause)
            else:
                await tb.step(**{"fault_pin_i": 1} if cause == PIN else {"never_i": 1})
            await tb.clocks({PHASE: 1, DC: 1, PIN: 2, 0: 0}[cause])
            if cause == 0 and before:
                await tb.step(software_i=1)
            assert tb.gates() == 0
            # The cause that forbids goes, one that allows comes and stays.
            await tb.step(0, fault_pin_i=0, guard_enable_i=0, never_i=0)
            await tb.clocks(3)
            await tb.step(OVER)
            await tb.clocks(2)
            await tb.step(clear_i=1)
            await tb.clocks(20)
            assert int(dut.latched_o.value) == OVER and tb.gates() == 0
            await tb.again()


@cocotb.test()
async def only_by_choice_and_when_enabled(dut: Dut) -> None:
    tb = ShortTb(dut)
    await tb.start()
    await tb.step(cfg_short_i=0)
    await tb.step(software_i=1)
    await tb.step(guard_enable_i=0, cfg_short_i=1)
    await tb.clocks(20)
    assert tb.gates() == 0, "not chosen when the trip came"
    await tb.again()
    await tb.step(guard_enable_i=0)
    await tb.clocks(2)
    await tb.step(software_i=1)
    await tb.clocks(20)
    assert tb.gates() == 0, "disabled means off"
    await tb.step(guard_enable_i=1)
    await tb.clocks(20)
    assert tb.gates() == 0
    await tb.again()
    await tb.shorted()
    await tb.step(cfg_short_i=0)
    assert tb.gates() == 0
    await tb.again()
    await tb.shorted()
    dut.rst_i.value = 1
    await FallingEdge(dut.clk_i)
    assert tb.gates() == 0
    dut.rst_i.value, dut.guard_enable_i.value = 0, 0
    dut.lost_i.value = 1
    for _ in range(1100):
        await FallingEdge(dut.clk_i)
        assert tb.gates() == 0, "after a reset there is no trip and no short"


@cocotb.test()
async def random_events(dut: Dut) -> None:
    rng = random.Random(23)
    tb = ShortTb(dut)
    await tb.start()
    for _ in range(12_000):
        changes: dict[str, int] = {}
        shown = None
        if rng.random() < 0.05:
            shown = rng.choice(sorted(SHOWN)) if rng.random() < 0.3 else 0
        for name in PULSES:
            changes[name] = int(rng.random() < 0.004)
        changes["clear_i"] = int(rng.random() < 0.03)
        if tb.inputs["fault_pin_i"] or rng.random() < 0.004:
            changes["fault_pin_i"] = int(rng.random() < 0.5)
        if tb.inputs["never_i"] or rng.random() < 0.004:
            changes["never_i"] = int(rng.random() < 0.5)
        if rng.random() < 0.05:
            changes["guard_enable_i"] = int(rng.random() < 0.8)
        if not tb.inputs["cfg_short_i"] or rng.random() < 0.003:
            changes["cfg_short_i"] = int(rng.random() < 0.1)
        if rng.random() < 0.02:
            changes["cfg_enable_i"] = 0xFF & ~(1 << rng.randrange(8)) if rng.random() < 0.5 else 0xFF
        if rng.random() < 0.1:
            upper = rng.randrange(8)
            changes |= {"req_h_i": upper, "req_l_i": rng.choice([0, 7 & ~upper, rng.randrange(8)])}
        if rng.random() < 0.01:
            changes["dead_time_i"] = rng.choice([0, 2, 5, 17])
        await tb.step(shown, **changes)
    assert tb.shorts > 500, f"only {tb.shorts} clocks with a short"


def test_active_short() -> None:
    """Trips and guard: when the lower gates go on after a trip, and when they do not.

    Verifies: SAFE-19, SAFE-20
    """
    run_block_test(
        "fl_safety_chain",
        [
            "common/fl_sync.sv",
            "safety/fl_trip.sv",
            "safety/fl_gate_guard.sv",
            ROOT / "cocotb_tests" / "safety" / "fl_safety_chain.sv",
        ],
        __name__,
    )
