# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Chip and plant of one simulation as Python sees them: time, actions, logs, console. In the simulator's process.

Who leads a run does it by this: a plan (`fluxlock.cosim.planned`), its branches, a user's own test (`fluxlock.drive`).
"""

from __future__ import annotations

import json
import socket
import time
from collections.abc import Sequence
from typing import Any

import numpy as np
from cocotb.simtime import get_sim_time
from cocotb.triggers import Timer
from numpy.typing import NDArray

from fluxlock.base.writable import write_whole
from fluxlock.can.frame import Frame
from fluxlock.cosim.console import NO_REPLY, ConsoleLines
from fluxlock.cosim.debugger import Debugger
from fluxlock.cosim.native import CanNode, Core, Native
from fluxlock.cosim.plan import META_FILE, PROGRESS_FILE, RAW_FILE, TRACE_FILE, Action, SessionPlan
from fluxlock.plant import Plant
from fluxlock.python_load import PERIOD_CYCLES, PythonLoad

CLOCK_NS = 20
PROGRESS_INTERVAL_S = 0.1
REPLY_S = 0.1  # simulated time without a sign of the console after which a line is taken for unanswered
LISTEN_CYCLES = 5_000  # between two looks for the end of a reply
BOOT_CYCLES = 500_000  # before the first line that somebody waits for
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
        self.log_end: int | None = None  # rows of the log and clocks of the run that count; None: all
        self.end_cycle: int | None = None
        self.wall_s: float | None = None
        self.begin_s = time.perf_counter()
        self.woken_s = 0.0  # processor time at the last wake-up
        self._progress_at = 0.0

    @property
    def cycle(self) -> int:
        """Rising edges so far."""
        return int(self.native.status.cycle)

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
                "rate_cycles_per_s": cycle / max(now - self.begin_s, 1e-9),
            }
            if self.plan.dialogue is not None:
                line |= {"stage": self.plan.dialogue.stage, "share": self.plan.dialogue.share}
            write_whole(self.plan.folder / PROGRESS_FILE, json.dumps(line))

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

    def begin(self) -> None:
        """Join chip and plant as the plan says; before the first clock."""
        plan, native = self.plan, self.native
        native.configure(plan.conversion_cycles, plan.bit_cycles, plan.log_strobes, plan.gate_polarity)
        native.attach(self.plant.address, self.plant.state, self.plant.io)
        native.record(plan.recording)
        if plan.trace is not None:
            native.trace_core(plan.folder / TRACE_FILE, *plan.trace)
        if plan.gdb is not None:
            self.debugger = Debugger(Core(), socket.socket(fileno=plan.gdb), plan.clock_hz)
        if plan.peer is not None:
            self.node = native.open_can(plan.peer.timing, plan.can_place)
        native.log_can(plan.log_can)
        self.begin_s = time.perf_counter()

    async def advance(self, cycle: int) -> None:
        """Simulate until a cycle, or until the plan's peer has finished; the logs are drained every `batch_cycles`."""
        batch = self.plan.batch_cycles
        while self.cycle < cycle and not (self.plan.peer is not None and self.plan.peer.finished):
            await self._reach(min(cycle, (self.cycle // batch + 1) * batch))
            self.woken_s = time.process_time()
            self.drain()
            self.exchange()
            self.python_s += time.process_time() - self.woken_s

    async def _reach(self, cycle: int) -> None:
        """Wait until a cycle; meanwhile the plan's load is asked once a period."""
        load = self.plan.own_load
        while load is not None and self.cycle < cycle:
            if self.cycle % PERIOD_CYCLES == 0:
                self.ask(load)
            await self.wait_until(min(cycle, (self.cycle // PERIOD_CYCLES + 1) * PERIOD_CYCLES))
        await self.wait_until(cycle)

    def ask(self, load: PythonLoad) -> None:
        """Let a load written in Python say its torque for a period from now on; SimulationFault if it cannot."""
        plant, clock_hz = self.plant, self.plan.clock_hz
        plant.advance(max(self.cycle, plant.t_cycle))
        poles = plant.params.machine.pole_pairs
        speed, angle = plant.omega_e_rad_s / poles, plant.theta_e_rad / poles
        plant.hold_load(load.torque_nm(plant.t_cycle / clock_hz, speed, angle, PERIOD_CYCLES / clock_hz))

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

    def log(self) -> NDArray[np.int64]:
        """Rows [cycle, kind, a, b] so far, see `LogKind`."""
        return np.concatenate(self.logs) if self.logs else np.zeros((0, 4), np.int64)

    def save(self, fault: str | None) -> None:
        """Write arrays and meta data into the plan's folder."""
        log = self.log()
        limit = self.plan.duration_cycles if self.end_cycle is None else min(self.plan.duration_cycles, self.end_cycle)
        records = self.plant.records()
        events = self.plant.events()
        zoom = self.plant.zoom_records()
        np.savez(
            self.plan.folder / RAW_FILE,
            log=log[: self.log_end],
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
            "wall_s": time.perf_counter() - self.begin_s if self.wall_s is None else self.wall_s,
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
