# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The Verilated chip as a source, in slow motion: its simulator is a process beside this one (`simulated`)."""

from __future__ import annotations

import subprocess
import tempfile
from contextlib import suppress
from dataclasses import dataclass, replace
from multiprocessing import Pipe
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fluxlock.base.paths import BUILD
from fluxlock.can.timing import chip_timing
from fluxlock.clock import CLOCK_HZ
from fluxlock.config import Scenario
from fluxlock.config.scenario import Event, Fault
from fluxlock.cosim.convert import actions_of
from fluxlock.cosim.launch import LOG_FILE, simulator_environment
from fluxlock.cosim.run import chip_of, image_of, prepare
from fluxlock.firmware.binding import names, new, types
from fluxlock.headers import CData
from fluxlock.live import messages
from fluxlock.live.bus import BusLoad, Companion
from fluxlock.live.estimate import Estimate
from fluxlock.live.faults import NO_BUS
from fluxlock.live.freewheel import Freewheel
from fluxlock.live.played import Played
from fluxlock.live.simulated import LINK_ENV, Go, Report, Silence
from fluxlock.live.source import RefusedError
from fluxlock.live.traces import GATES, MARKS, NAMES, SIX_STEP_ONLY, TOLD, Floats, Marks, columns, marks_of
from fluxlock.native.play import Taken
from fluxlock.results.rundata import IntArray, LogKind, RecordArray

SLICE_CYCLES = 25_000  # between two looks at the pipe; some 20 ms of this machine
ENDLESS = 2**53  # clocks
END_S = 5.0
LISTEN_CYCLES, PATIENCE_CYCLES = 5_000, 10_000_000  # for an answer of the console
LOAD_CYCLES = 50_000  # over which the load of the core is taken
IDLE = names("handler_t").index("idle")
UNTIL = {"end": 0, "commutation": int(LogKind.COMMUTATION), "tick": int(LogKind.UPDATE)}


class BrokenError(RuntimeError):
    """The simulator has ended; the text says why."""


@dataclass(frozen=True)
class ChipPlan:
    """A scenario whose chip runs in place of its twin."""

    scenario: Scenario


class Chip(Played):
    """The whole chip in closed loop with its motor."""

    kind = "chip"

    def __init__(self, plan: ChipPlan, seed: int) -> None:
        scenario = plan.scenario
        super().__init__(scenario, seed)
        self._image = image_of(scenario)
        self._folder = tempfile.TemporaryDirectory(prefix="live-", dir=_folder())
        folder = Path(self._folder.name)
        chip = chip_of(scenario)
        made = prepare(scenario, folder, seed)
        recording = replace(made.plant.recording, every_strobes=0, zoom=((0, ENDLESS),))
        made = replace(
            made,
            plant=replace(made.plant, recording=recording),
            duration_cycles=ENDLESS,
            actions=(),
            final_commands=(),
            batch_cycles=SLICE_CYCLES,
        )
        self._bus: BusLoad | None = None
        if (bus := scenario.can) is not None:
            timing = chip_timing(CLOCK_HZ, bus.bit_rate_kbit_per_s)
            made = replace(made, peer=Companion(timing, bus.node_id), log_can=True)
            self._bus = BusLoad(timing.bit_cycles)
        self._link, theirs = Pipe()
        env = simulator_environment(made.save(), folder / "results.xml", chip.top, "fluxlock.live.simulated")
        env[LINK_ENV] = str(theirs.fileno())
        with (folder / LOG_FILE).open("w") as log:
            self.process = subprocess.Popen(
                [str(chip.executable)], cwd=folder, env=env, stdout=log, stderr=subprocess.STDOUT,
                pass_fds=(theirs.fileno(),), start_new_session=True,
            )  # fmt: skip
        theirs.close()
        self._cycle, self._told = 0, new("telemetry_t")
        self._records: list[RecordArray] = []
        self._logs: list[NDArray[np.int64]] = []
        self._waiting: list[Event] = []  # for the console's answer
        self._marks: Marks = []
        self._estimate = Estimate(scenario.drive.method, scenario.drive.carrier_hz)
        self._freewheel = Freewheel() if scenario.drive.method == "six-step" else None
        self._load = np.nan  # of the core, %
        self._rounds = (0, 0)  # of the idle main loop, and the clock

    def end(self) -> None:
        """End the simulator."""
        self._link.close()
        try:
            self.process.wait(END_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        with suppress(OSError):
            self._folder.cleanup()

    @property
    def now(self) -> float:
        """Simulated time, s."""
        return self._cycle / CLOCK_HZ

    def hello(self) -> dict[str, Any]:
        """What a page draws itself from."""
        legs = self.scenario.motor.phases
        without = ["motor_a", *GATES[2 * legs :], *(("current_d", "current_e") if legs == 3 else ())]
        without += [*(SIX_STEP_ONLY if self._freewheel is None else ()), *(("bus_load",) if self._bus is None else ())]
        carrier_s = 1.0 / self.scenario.drive.carrier_hz
        steps = [["a clock", 1.0 / CLOCK_HZ, "end"], ["a carrier", carrier_s, "end"], ["a tick", 0.01, "tick"]]
        if self.scenario.drive.method == "six-step":
            steps.append(["a sector", 0.1, "commutation"])
        return super().hello() | {"without": without, "steps": steps}

    def advance(self, seconds: float, until: str = "end") -> bool:
        """So much simulated time at most, with the scenario's events at their times; until: see `UNTIL`."""
        cycles = min(max(1, round(seconds * CLOCK_HZ)), SLICE_CYCLES)
        return self._advance((self._cycle + cycles) / CLOCK_HZ, until)

    def act(self, action: messages.Action) -> None:
        """What a page asks for, once the console has answered the line before: so a play has its lines' clocks."""
        last = self._cycle + PATIENCE_CYCLES
        while self._waiting and self._cycle < last:
            self._go((self._cycle + LISTEN_CYCLES) / CLOCK_HZ)
        if self._bus is not None and isinstance(action, messages.Bus):
            self._hush(action.silent)
            return
        if self._bus is not None and isinstance(action, messages.Break) and action.fault.kind == "clear":
            self._hush(False)
        super().act(action)

    def _hush(self, silent: bool) -> None:
        """The node beside the drive says nothing, or what it has to."""
        self._link.send(Silence(silent))
        text = "the other node on the bus is silent" if silent else "the other node on the bus is heard"
        self.said.append({"kind": "said", "t_s": self.now, "text": text, "answer": ""})

    def _no_bus(self) -> str:
        return NO_BUS if self._bus is None else ""

    def _go(self, end_s: float, until: str = "end") -> bool:
        end = round(end_s * CLOCK_HZ)
        while self._cycle < end:
            goal = min(end, self._cycle + SLICE_CYCLES)
            self._order(Go(goal - self._cycle, UNTIL[until]))
            if UNTIL[until] and self._logs[-1].size and self._logs[-1][-1, 1] == UNTIL[until]:
                return True
        return False

    def _order(self, order: Go) -> None:
        try:
            self._link.send(order)
            report = self._link.recv()
        except (EOFError, OSError):
            raise BrokenError(f"the simulator has ended: {self._last_line()}") from None
        assert isinstance(report, Report)
        self._cycle = report.cycle
        self._records.append(report.records)
        self._logs.append(report.log)
        if self._bus is not None:
            self._bus.follow(report.log, report.cycle)
        types().buffer(self._told)[:] = report.telemetry
        for cycle, line, answer in report.answers:
            self._hear(cycle, line, answer)
        if report.fault:
            raise BrokenError(report.fault)

    def _last_line(self) -> str:
        text = (Path(self._folder.name) / LOG_FILE).read_text(errors="replace").strip()
        return text.splitlines()[-1] if text else "without a word"

    def _hear(self, cycle: int, line: str, answer: str) -> None:
        for event in self._waiting:
            if round(event.at_s * CLOCK_HZ) == cycle:
                self._waiting.remove(event)
                self._answered(event, answer)
                return

    def _missing(self, fault: Fault) -> str:
        phases = "ABCDE"[: self.scenario.motor.phases]
        if not set(fault.phases or ()) <= set(phases):
            return f"this motor has the phases {phases}"
        if fault.kind == "stuck_rotor" and self.scenario.mechanics.mode != "free":
            return f"the rotor is not free: mechanics.mode is {self.scenario.mechanics.mode}"
        return ""

    def _carry_out(self, event: Event) -> None:
        actions = actions_of(self.scenario, event, self._image)
        for action in actions:
            self._link.send(action)
        if any(action.kind == "console" for action in actions):
            self._waiting.append(event)
            return
        if event.load_factor is not None:
            self.load_factor = event.load_factor
        if event.supply_v is not None:
            self.supply_v = event.supply_v
        self._answered(event, "")

    def _telemetry(self) -> CData:
        return self._told

    def take(self) -> tuple[Floats, Floats]:
        """Times and traces since the last call: a row per event of the plant, at a gate edge before and after it."""
        if not self._records:
            return np.zeros(0), np.zeros((len(NAMES), 0), np.float32)
        records: RecordArray = np.concatenate(self._records)
        log: IntArray = np.concatenate(self._logs)
        self._records.clear()
        self._logs.clear()
        margin, masked = self._freewheel.follow(records, log) if self._freewheel is not None else (np.nan, [])
        found = marks_of(log, CLOCK_HZ, int(self._last[TOLD.index("state")]))
        self._marks += sorted(found + [(cycle / CLOCK_HZ, MARKS.index("crossing masked")) for cycle in masked])
        self._causes |= int(np.bitwise_or.reduce(log[log[:, 1] == LogKind.TRIP, 2]))
        if records.size == 0:
            return np.zeros(0), np.zeros((len(NAMES), 0), np.float32)
        more = {
            "angle_error_deg": self._estimate.error_deg(records, log),
            "core_load": np.full(records.size, self._core_load()),
            "bus_load": np.full(records.size, self._bus.percent if self._bus is not None else np.nan),
            "margin_deg": np.broadcast_to(margin, records.shape),
        }
        time_s, rows = columns(Taken(records, log, more, 0), CLOCK_HZ, self.scenario.motor.pole_pairs, self._last)
        self._note_speed(time_s, rows)
        return time_s, rows

    def _core_load(self) -> float:
        """Share of the clocks that are not idle rounds of the main loop, %; `get idle` is the same by the firmware."""
        idle = self._told.handler[IDLE]
        rounds, since = self._rounds
        if idle.count < rounds:  # `reset` of the statistics
            self._rounds = (int(idle.count), self._cycle)
        elif self._cycle - since >= LOAD_CYCLES:
            self._load = 100.0 * (1.0 - (idle.count - rounds) * idle.min / (self._cycle - since))
            self._rounds = (int(idle.count), self._cycle)
        return self._load

    def marks(self) -> Marks:
        """Instants since the last call."""
        found, self._marks = self._marks, []
        return found

    def status(self) -> dict[str, Any]:
        """The drive as it is."""
        bus = self._bus.percent if self._bus is not None else np.nan
        loads = {"core_load": self._load, "bus_load": bus}
        return super().status() | {name: load if np.isfinite(load) else None for name, load in loads.items()}

    def export(self, name: str) -> dict[str, str]:
        """Texts by file name of a scenario that repeats what was done; RefusedError with a bus."""
        if self._bus is not None:
            raise RefusedError("a run has no node on its bus, so it cannot repeat this play; leave [can] out")
        return super().export(name)


def _folder() -> Path:
    """Where simulators leave their logs."""
    folder = BUILD / "live"
    folder.mkdir(parents=True, exist_ok=True)
    return folder
