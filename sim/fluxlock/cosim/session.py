# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The cocotb test that drives the whole chip through one plan. Runs inside the simulator's process.

The clock and the plant are native; this coroutine sleeps until the next action of the plan or until the logs want
draining (every `batch_cycles`).
"""

from __future__ import annotations

import json
import os
import socket
import time
from collections.abc import Sequence
from heapq import merge
from pathlib import Path
from typing import Any

import cocotb
import numpy as np
from cocotb.simtime import get_sim_time
from cocotb.triggers import Timer

from fluxlock.can.frame import Frame
from fluxlock.cosim.branches import end_with_parent, run_branches
from fluxlock.cosim.console import NO_REPLY, ConsoleLines
from fluxlock.cosim.debugger import Debugger
from fluxlock.cosim.native import CanNode, Core, Native
from fluxlock.cosim.plan import (
    META_FILE,
    PLAN_ENV,
    PROGRESS_FILE,
    RAW_FILE,
    RECORDING_FILE,
    TRACE_FILE,
    Action,
    ConversationError,
    SessionPlan,
)
from fluxlock.plant import Plant

CLOCK_NS = 20
PROGRESS_INTERVAL_S = 0.1
REPLY_S = 0.1  # simulated time without a sign of the console after which a line is taken for unanswered
LISTEN_CYCLES = 5_000  # between two looks for the end of a reply
BOOT_CYCLES = 500_000  # before the first line of a dialogue
NO_BUS = "there is no CAN bus: the plan has no peer on it"


class PlantFault(Exception):
    """The plant kernel returned a fault code."""


class ConsoleSilent(Exception):
    """The firmware gave no answer: its main loop hangs or has no time left."""


class Session:
    """One run: plan, plant, native main, and what they have recorded so far."""

    def __init__(self, plan: SessionPlan) -> None:
        self.plan = plan
        self.native = Native()
        self.plant = Plant(plan.plant, seed=plan.seed, mode=plan.plant_mode)
        self.logs: list[Any] = []
        self.text = ""
        self.lines = ConsoleLines(self.native.send, int(REPLY_S * plan.clock_hz))
        self.planned_lines: int | None = None  # of them the plan's, once all have been answered or given up
        # Processor time, that in Python, s, and plant events at the marks of the plan.
        self.marks: dict[int, tuple[float, float, int]] = {}
        self.python_s = 0.0
        self.conclusion: Any = None
        self.debugger: Debugger | None = None
        self.stack: tuple[int, int] | None = None  # of a traced core: lowest stack pointer, its clock
        self.upsets: list[str] = []
        self.watched: list[list[int]] = []
        self.node: CanNode | None = None  # of the plan's peer
        self.begin = time.perf_counter()
        self._progress_at = 0.0

    async def wait_until(self, cycle: int) -> None:
        """Sleep until the rising edge number `cycle` has been processed (edge n is at (2n - 1) half periods)."""
        delta = cycle - self.native.status.cycle
        if delta > 0:
            target_ns = CLOCK_NS * cycle - CLOCK_NS // 2
            await Timer(target_ns - int(get_sim_time("ns")), unit="ns")

    def drain(self) -> None:
        """Collect logs, records and console text; raise PlantFault if the plant has stopped."""
        if self.debugger is not None:
            self.debugger.listen()
        self.logs.append(self.native.take_log())
        self.plant.drain()
        status = self.native.status
        heard = self.native.receive()
        self.text += heard
        if status.uart_lost:
            raise BufferError(f"console overflow: {status.uart_lost} bytes lost before cycle {status.cycle}")
        self.lines.hear(status.cycle, heard)
        if status.fault:
            raise PlantFault(self.plant.fault_text(status.fault, status.t_fault))
        now = time.perf_counter()
        if now - self._progress_at >= PROGRESS_INTERVAL_S:
            self._progress_at = now
            cycle = status.cycle
            line: dict[str, float | str] = {
                "t_s": cycle / self.plan.clock_hz,
                "speed_rpm": self.plant.speed_rpm,
                "rate_cycles_per_s": cycle / max(now - self.begin, 1e-9),
            }
            if self.plan.dialogue is not None:
                line |= {"stage": self.plan.dialogue.stage, "share": self.plan.dialogue.share}
            path = self.plan.folder / PROGRESS_FILE
            path.with_suffix(".tmp").write_text(json.dumps(line))
            path.with_suffix(".tmp").replace(path)

    def exchange(self) -> None:
        """Let the plan's peer take and send frames."""
        if self.plan.peer is not None and self.node is not None:
            self.plan.peer.exchange(self.native.status.cycle, self.node)

    def act(self, action: Action) -> None:
        """Carry out one action of the plan."""
        if action.kind == "console":
            self.lines.add(self.native.status.cycle, **action.arguments)
        elif action.kind == "load":
            self.plant.set_load(**action.arguments)
        elif action.kind == "supply":
            self.plant.set_supply(**action.arguments)
        elif action.kind == "fault":
            self.plant.inject_fault(**action.arguments)
        elif action.kind == "sensor":
            self.plant.disturb(**action.arguments)
        elif action.kind == "mechanics":
            self.plant.set_mechanics(**action.arguments)
        elif action.kind == "pin":
            self.native.force_pin(**action.arguments)
        elif action.kind == "bus":
            self.disturb_bus(**action.arguments)
        elif action.kind == "frames":
            self.flood_bus(**action.arguments)
        elif action.kind in ("register", "memory"):
            self.upset(action)
        else:
            raise ValueError(f"unknown action {action.kind!r}")

    def flood_bus(self, frames: Sequence[Frame]) -> None:
        """Another node joins the CAN bus and sends frames back to back."""
        if self.plan.peer is None:
            raise ValueError(NO_BUS)
        node = self.native.open_can(self.plan.peer.timing, self.plan.can_place)
        for frame in frames:
            node.send(frame)

    def disturb_bus(self, cycles: int, level: int) -> None:
        """The CAN bus has this level, 0 dominant, for so many clocks."""
        if self.node is None:
            raise ValueError(NO_BUS)
        start = int(self.native.status.cycle) + 1
        self.node.disturb(start, start + cycles, level)

    def upset(self, action: Action) -> None:
        """Flip the bit that an action names."""
        at = action.arguments
        if action.kind == "memory":
            self.native.upset_memory(at["address"], at["bit"])
            self.upsets.append(f"memory {at['address']:#x} bit {at['bit']}")
            return
        names = self.native.upset_names()
        number = min(int(at["share"] * len(names)), len(names) - 1)
        name, bits = names[number]
        bit = min(int(at["bit_share"] * bits), bits - 1)
        self.native.upset(number, bit)
        self.upsets.append(f"{name} bit {bit}")

    async def run(self) -> None:
        """Run the plan to its end, then ask the chip for its statistics."""
        plan, native = self.plan, self.native
        native.configure(plan.conversion_cycles, plan.bit_cycles, plan.log_strobes, plan.gate_polarity)
        native.attach(self.plant.address, self.plant.state, self.plant.io)
        native.record(plan.recording)
        if plan.trace is not None:
            native.trace_core(plan.folder / TRACE_FILE, *plan.trace)
        if plan.gdb is not None:
            self.debugger = Debugger(Core(), socket.socket(fileno=plan.gdb), plan.clock_hz)
        if plan.dialogue is not None:
            await self.converse()
            return
        if plan.peer is not None:
            self.node = native.open_can(plan.peer.timing, plan.can_place)
        native.log_can(plan.log_can)
        if plan.branches:
            await run_branches(self)
            return
        end = plan.duration_cycles
        planned = sorted({*(a.cycle for a in plan.actions), *plan.marks})
        batches = range(plan.batch_cycles, end, plan.batch_cycles)
        stops = merge((cycle for cycle in planned if cycle < end and cycle not in batches), batches, [end])
        pending = sorted(plan.actions, key=lambda a: a.cycle)
        self.begin = time.perf_counter()
        for stop in stops:
            await self.wait_until(stop)
            woken = time.process_time()
            self.drain()
            self.exchange()
            self.python_s += time.process_time() - woken
            if stop in plan.marks:
                self.marks[stop] = (woken, self.python_s, native.status.events)
            while pending and pending[0].cycle <= stop:
                self.act(pending.pop(0))
            if plan.peer is not None and plan.peer.finished:
                break
        self.wall_s = time.perf_counter() - self.begin
        if plan.peer is not None:
            self.conclusion = plan.peer.conclusion()
        native.record(False)
        if plan.recording:
            native.save_recording(plan.folder / RECORDING_FILE)
        if plan.trace is not None:
            self.stack = native.end_trace()
        if self.debugger is not None:
            self.debugger.end()
            self.debugger = None
        self.log_end = sum(map(len, self.logs))
        self.end_cycle = native.status.cycle
        await self.ask_statistics()

    async def converse(self) -> None:
        """Lead the plan's dialogue to its end."""
        dialogue = self.plan.dialogue
        assert dialogue is not None
        self.begin = time.perf_counter()
        await self.wait_until(BOOT_CYCLES)
        talk = dialogue.conversation()
        try:
            line = next(talk)
            while True:
                line = talk.send(await self.reply_to(line))
        except StopIteration as end:
            self.conclusion = end.value
        self.wall_s = time.perf_counter() - self.begin

    async def reply_to(self, line: str) -> list[str]:
        """Send a line and wait for the last one of its reply."""
        count, begin = len(self.replies()), len(self.text)
        self.native.send(line)
        while len(self.replies()) == count:
            cycle = self.native.status.cycle
            if cycle >= self.plan.duration_cycles:
                raise ConversationError(f"not at the end after {cycle / self.plan.clock_hz:g} s")
            await self.wait_until(cycle + LISTEN_CYCLES)
            self.drain()
        return self.text[begin:].splitlines()

    async def ask_statistics(self) -> None:
        """Wait for the answers to the plan's lines, then send the final commands one by one and wait for each."""
        await self.settle()
        self.planned_lines = len(self.lines.lines)
        for command in self.plan.final_commands:
            line = self.lines.add(self.native.status.cycle, command)
            await self.settle()
            if line.answer in (None, NO_REPLY):
                raise ConsoleSilent(f"the drive's console did not answer {command!r} within {2 * REPLY_S:g} s")

    async def settle(self, exchange: bool = False) -> None:
        """Wait until the console has answered every line, or none for so long that it is taken for dead.

        exchange: the plan's peer goes on meanwhile.
        """
        given_up = sum(line.answer == NO_REPLY for line in self.lines.lines)
        while not self.lines.settled and sum(line.answer == NO_REPLY for line in self.lines.lines) == given_up:
            await self.wait_until(self.native.status.cycle + int(1e-3 * self.plan.clock_hz))
            self.drain()
            if exchange:
                self.exchange()

    def replies(self) -> list[str]:
        """Last lines of the replies so far: `ok` or `error: TEXT`."""
        lines = self.text.splitlines(keepends=True)
        return [x.strip() for x in lines if x.endswith("\n") and (x.strip() == "ok" or x.startswith("error: "))]

    def save(self, fault: str | None) -> None:
        """Write arrays and meta data into the plan's folder."""
        log = np.concatenate(self.logs) if self.logs else np.zeros((0, 4), np.int64)
        end = getattr(self, "log_end", len(log))
        limit = min(self.plan.duration_cycles, getattr(self, "end_cycle", self.plan.duration_cycles))
        records = self.plant.records()
        events = self.plant.events()
        zoom = self.plant.zoom_records()
        np.savez(
            self.plan.folder / RAW_FILE,
            log=log[:end],
            records=records[records["t_cycle"] <= limit],
            plant_events=events[events["t_cycle"] <= limit],
            zoom=zoom,
        )
        status = self.native.status
        # A run that broke off leaves lines unanswered.
        sent = [(line.cycle, line.text, line.answer) for line in self.lines.lines[: self.planned_lines]]
        if self.planned_lines is None:
            sent = [line for line in sent if line[2] is not None]
        meta = {
            "cycles": min(int(status.cycle), limit),
            "wall_s": getattr(self, "wall_s", time.perf_counter() - self.begin),
            "cpu_s": time.process_time(),  # of this process; a copy begins at 0
            "uart": self.text,
            "sent": sent,
            "upsets": self.upsets,
            "stack": self.stack,
            "watched": self.watched,
            "fault": fault,
            "marks": {str(k): v for k, v in self.marks.items()},
            "conclusion": self.conclusion,
            "plant_events": int(status.events),
            "strobes": int(status.strobes),
            "edges": int(status.edges),
        }
        (self.plan.folder / META_FILE).write_text(json.dumps(meta))


@cocotb.test()
async def drive(dut: object) -> None:
    """Run the plan named by the environment."""
    end_with_parent()
    session = Session(SessionPlan.load(Path(os.environ[PLAN_ENV])))
    fault: str | None = None
    try:
        await session.run()
    except (PlantFault, ConsoleSilent, ConversationError, BufferError) as error:
        fault = str(error)
    session.save(fault)
