# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Gate guard against a reference of its history: when was the other gate last on, and what was asked."""

from __future__ import annotations

import os
import random
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import cocotb
import pytest
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, ReadOnly

from fluxlock.cosim.block import run_block_test

Dut: TypeAlias = Any  # handles are found by name at run time
RESET_WAIT = 1023  # clocks after reset before a first turn-on, the longest dead time


@dataclass
class LegReference:
    """One leg: `step` takes the inputs a clock edge sees and gives the gates after it."""

    clock: int = 0
    on: dict[str, bool] = field(default_factory=lambda: {"h": False, "l": False})
    # First clock in which the gate may be on, given when the other one was on last.
    earliest: dict[str, int] = field(default_factory=lambda: {"h": RESET_WAIT, "l": RESET_WAIT})

    def step(self, req_h: bool, req_l: bool, allowed: bool, dead: int) -> tuple[bool, bool]:
        for gate, other in (("h", "l"), ("l", "h")):
            if self.on[gate]:
                self.earliest[other] = self.clock + 1 + max(dead, 2)
                self.earliest[gate] = 0
        self.clock += 1
        wants = {"h": req_h and not req_l, "l": req_l and not req_h}
        self.on = {g: allowed and wants[g] and self.clock >= self.earliest[g] for g in "hl"}
        return self.on["h"], self.on["l"]


class GuardTb:
    def __init__(self, dut: Dut) -> None:
        self.dut = dut
        self.phases = len(dut.req_h_i)
        built = int(os.environ["GUARD_POLARITY"])  # bit 0, 1: upper, lower pins active low
        self.polarity = (built & 1, built >> 1)
        self.inputs = {"enable_i": 0, "trip_i": 0, "short_i": 0, "req_h_i": 0, "req_l_i": 0, "dead_time_i": 5}

    async def start(self) -> None:
        for name, value in {**self.inputs, "rst_i": 1}.items():
            getattr(self.dut, name).value = value
        Clock(self.dut.clk_i, 20, "ns").start()
        for _ in range(2):
            await FallingEdge(self.dut.clk_i)
            self.all_off("in the first reset")
        await self.release()

    async def release(self) -> None:
        """One clock of reset, then new references."""
        self.dut.rst_i.value = 1
        await FallingEdge(self.dut.clk_i)
        self.dut.rst_i.value = 0
        self.legs = [LegReference() for _ in range(self.phases)]

    async def step(self, **changes: int) -> None:
        """One clock with these inputs (and those set before); the outputs after it are compared."""
        for name, value in changes.items():
            getattr(self.dut, name).value = value
        self.inputs.update(changes)
        x = self.inputs
        await FallingEdge(self.dut.clk_i)
        allowed = bool(x["enable_i"] and not x["trip_i"])
        shorted = bool(x["trip_i"] and x["short_i"])
        gate, pin_h, pin_l = 0, 0, 0
        for i, leg in enumerate(self.legs):
            wants = (bool(x["req_h_i"] >> i & 1), bool(x["req_l_i"] >> i & 1), allowed)
            h, low = leg.step(*((False, True, True) if shorted else wants), x["dead_time_i"])
            gate |= h << (2 * i) | low << (2 * i + 1)
            pin_h |= (h ^ self.polarity[0]) << i
            pin_l |= (low ^ self.polarity[1]) << i
        got = tuple(int(s.value) for s in (self.dut.gate_o, self.dut.gate_h_o, self.dut.gate_l_o))
        assert got == (gate, pin_h, pin_l), (
            f"clock {self.legs[0].clock}: gate, pins {got} instead of {(gate, pin_h, pin_l)}; {x}"
        )

    def all_off(self, when: str) -> None:
        """The pins are off in the polarity of the build."""
        everything = (1 << self.phases) - 1
        pins = int(self.dut.gate_h_o.value), int(self.dut.gate_l_o.value)
        assert pins == (everything * self.polarity[0], everything * self.polarity[1]), f"pins {pins} {when}"

    async def idle(self, clocks: int) -> None:
        for _ in range(clocks):
            await self.step()


@cocotb.test()
async def random_requests(dut: Dut) -> None:
    rng = random.Random(int(os.environ["GUARD_SEED"]))
    tb = GuardTb(dut)
    await tb.start()
    await tb.idle(RESET_WAIT)
    everything = (1 << tb.phases) - 1
    on_clocks = 0
    for _ in range(6000):
        changes: dict[str, int] = {}
        if rng.random() < 0.3:
            h = rng.randrange(everything + 1)
            overlap = rng.randrange(everything + 1) if rng.random() < 0.2 else 0
            changes |= {"req_h_i": h, "req_l_i": (everything & ~h & rng.randrange(everything + 1)) | overlap}
        if rng.random() < 0.02:
            changes["dead_time_i"] = rng.choice([0, 1, 2, 3, 4, 9, 20])
        if rng.random() < 0.03:
            changes["enable_i"] = int(rng.random() < 0.8)
        if rng.random() < (0.2 if tb.inputs["trip_i"] else 0.01):
            changes["trip_i"] = 1 - tb.inputs["trip_i"]
        changes["short_i"] = int(rng.random() < (0.95 if tb.inputs["short_i"] else 0.05))
        await tb.step(**changes)
        on_clocks += int(dut.gate_o.value) != 0
    assert on_clocks > 500, "the stimulus hardly ever turned a gate on"


@cocotb.test()
async def dead_time_is_exact(dut: Dut) -> None:
    """Complementary switching: the gap is the dead time to the clock, for short ones and the longest."""
    tb = GuardTb(dut)
    await tb.start()
    await tb.step(enable_i=1)
    everything = (1 << tb.phases) - 1
    await tb.step(req_h_i=everything, dead_time_i=7)
    await tb.idle(RESET_WAIT)
    # Every bit alone, patterns in which bits above and below differ, the longest.
    for dead in (0, 1, 3, 10, *(1 << bit for bit in range(1, 10)), 255, 341, 644, 682, 1023):
        await tb.step(dead_time_i=dead)
        for upper in (False, True):
            changes = {"req_h_i": everything * upper, "req_l_i": everything * (not upper)}
            await tb.step(**changes)
            gap = 0
            while int(dut.gate_o.value) == 0:
                gap += 1
                await tb.step()
            assert gap == max(dead, 2), f"dead time {dead}: gap {gap}"


@cocotb.test()
async def trip_and_enable_act_at_once(dut: Dut) -> None:
    tb = GuardTb(dut)
    await tb.start()
    everything = (1 << tb.phases) - 1
    await tb.step(enable_i=1, req_h_i=everything)
    await tb.idle(RESET_WAIT)
    for name, off, on in (("trip_i", 1, 0), ("enable_i", 0, 1)):
        assert int(dut.gate_o.value) != 0
        await tb.step(**{name: off})
        assert int(dut.gate_o.value) == 0, f"{name}: gate still on after one clock"
        await tb.idle(3)
        await tb.step(**{name: on})
        assert int(dut.gate_o.value) != 0, "the same gate may turn on again at once"


@cocotb.test()
async def short_circuit(dut: Dut) -> None:
    """A trip with a short: upper gates off at once, lower ones on after the dead time, whatever is asked or enabled."""
    tb = GuardTb(dut)
    await tb.start()
    everything = (1 << tb.phases) - 1
    lower = sum(2 << 2 * x for x in range(tb.phases))
    await tb.step(enable_i=1, req_h_i=everything)
    await tb.idle(RESET_WAIT)
    for dead in (2, 7, 600):
        await tb.step(dead_time_i=dead, trip_i=0, short_i=1, enable_i=1, req_h_i=everything, req_l_i=0)
        await tb.idle(dead + 2)
        assert int(dut.gate_o.value) == lower >> 1, "a short without a trip changes nothing"
        await tb.step(trip_i=1)
        for _ in range(dead):
            assert int(dut.gate_o.value) == 0
            await tb.step(enable_i=0)
        for requests in ((everything, 0), (0, everything), (everything, everything), (0, 0)):
            assert int(dut.gate_o.value) == lower
            await tb.step(req_h_i=requests[0], req_l_i=requests[1])
        await tb.step(short_i=0)
        assert int(dut.gate_o.value) == 0, "the end of the short opens at once"
        await tb.step(enable_i=1, req_h_i=0, req_l_i=everything, trip_i=0)
        assert int(dut.gate_o.value) == lower
        await tb.step(trip_i=1, short_i=1)
        assert int(dut.gate_o.value) == lower, "lower gates that are on stay on"


@cocotb.test()
async def reset_turns_off_and_waits(dut: Dut) -> None:
    tb = GuardTb(dut)
    await tb.start()
    await tb.step(enable_i=1, req_h_i=1)
    await tb.idle(RESET_WAIT)
    assert int(dut.gate_o.value) == 1
    dut.req_h_i.value, dut.req_l_i.value = 0, 1
    tb.inputs |= {"req_h_i": 0, "req_l_i": 1}
    await tb.release()  # one clock of reset with enable and the opposite request
    assert int(dut.gate_o.value) == 0
    tb.all_off("in reset")
    await tb.idle(RESET_WAIT - 1)
    assert int(dut.gate_o.value) == 0
    await tb.step()
    assert int(dut.gate_o.value) == 2


@cocotb.test()
async def reset_forgets_which_gate_was_on(dut: Dut) -> None:
    """Also the gate that was on before waits the longest dead time."""
    tb = GuardTb(dut)
    await tb.start()
    everything = (1 << tb.phases) - 1
    for upper in (True, False):
        requests = {"req_h_i": everything * upper, "req_l_i": everything * (not upper)}
        await tb.step(enable_i=0)
        await tb.step(enable_i=1, **requests)
        await tb.idle(RESET_WAIT)
        assert int(dut.gate_o.value) != 0, "no gate is on before the reset"
        await tb.release()
        tb.all_off("after a reset")
        await tb.idle(RESET_WAIT - 1)
        assert int(dut.gate_o.value) == 0, "on again before the longest dead time"
        await tb.step()
        assert int(dut.gate_o.value) != 0


@cocotb.test()
async def assertion_is_alive(dut: Dut) -> None:
    """Both gate registers forced on: the assertion beside the logic ends the simulation."""
    tb = GuardTb(dut)
    await tb.start()
    await tb.step(enable_i=1)
    dut.gate_h_q.value = 1
    dut.gate_l_q.value = 1
    await ReadOnly()
    for _ in range(2):
        await FallingEdge(dut.clk_i)


@pytest.mark.parametrize(("phases", "high", "low"), [(1, 0, 1), (3, 0, 0), (3, 1, 1), (5, 1, 0)])
def test_fl_gate_guard(phases: int, high: int, low: int) -> None:
    """Gate guard block test, with gate pins that are active low and active high.

    Verifies: SAFE-01, SAFE-02, SAFE-03, SAFE-04, SAFE-05, SAFE-19
    """
    cases = [
        "random_requests",
        "dead_time_is_exact",
        "trip_and_enable_act_at_once",
        "short_circuit",
        "reset_turns_off_and_waits",
        "reset_forgets_which_gate_was_on",
    ]
    run_block_test(
        "fl_gate_guard",
        ["safety/fl_gate_guard.sv"],
        __name__,
        parameters={"Phases": phases, "HighActiveLow": high, "LowActiveLow": low},
        testcase=cases,
        extra_env={"GUARD_SEED": str(phases), "GUARD_POLARITY": str(high | low << 1)},
    )


def test_assertions_are_alive(capfd: pytest.CaptureFixture[str]) -> None:
    """An assertion in the RTL that is made to fail ends the simulation with its message.

    Verifies: SAFE-06
    """
    with pytest.raises(AssertionError):
        sources, active_high = ["safety/fl_gate_guard.sv"], {"GUARD_POLARITY": "0"}
        run_block_test("fl_gate_guard", sources, __name__, testcase="assertion_is_alive", extra_env=active_high)
    assert "fl_gate_guard: both gates of a leg on" in capfd.readouterr().out
