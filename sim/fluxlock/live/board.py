# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A board as a source: its console over a serial port, or its CANopen node, asked for all values again and again.

What it tells is all that is known: there is no true angle, and a row is a reply, some 20 to 50 a second.
"""

from __future__ import annotations

import time
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fluxlock.can.can_bus import bus_of
from fluxlock.can.sdo import objects_of
from fluxlock.config import Scenario
from fluxlock.config.console import line_problem
from fluxlock.firmware.binding import names
from fluxlock.flash.board_console import Console, Port, SilentError
from fluxlock.flash.serial_port import SerialPort
from fluxlock.interface.settings import load_settings
from fluxlock.live import messages
from fluxlock.live.faults import catalogue
from fluxlock.live.node_console import NodeConsole
from fluxlock.live.played import shown_setting
from fluxlock.live.source import RefusedError
from fluxlock.live.traces import NAMES, Floats, Marks

TRIES = 3
BY_HAND = "a board is broken by hand: this page has no hold of its wires"
# Trace: value of the console and its factor.
TOLD = {
    "measured_rpm": ("measured_rpm", 1.0),
    "reference_rpm": ("reference_rpm", 1.0),
    "target_rpm": ("speed_rpm", 1.0),
    "vdc": ("vdc_v", 1.0),
    "idc": ("idc_a", 1.0),
    "motor_a": ("motor_a", 1.0),
    "id": ("id_ma", 1e-3),
    "iq": ("iq_ma", 1e-3),
}
STATES, LIMITS = names("drive_state_t"), names("limit_t")


@dataclass(frozen=True)
class BoardPlan:
    """What a board's process needs to know. scenario: of its firmware. bus: of python-can, without a serial port."""

    port: Path | None
    scenario: Scenario
    bus: str = ""


class Board:
    """A drive that is really there; time is the clock's."""

    def __init__(self, plan: BoardPlan, port: Port | None = None) -> None:
        self.scenario = plan.scenario
        self._name = plan.bus or str(plan.port)
        self._opened = ExitStack()
        self._console: Console | NodeConsole
        if plan.bus:
            self._console = NodeConsole(
                self._opened.enter_context(objects_of(*bus_of(plan.scenario, plan.bus))),
                plan.scenario.drive.method == "vector",
            )
        else:
            assert plan.port is not None
            self._console = Console(port if port is not None else SerialPort(plan.port))
        self.said: list[dict[str, Any]] = []
        self._begin = time.monotonic()
        self._values: dict[str, str] = {}
        self._rows: list[tuple[float, list[float]]] = []
        self._load = np.nan  # of the core, %
        self._poll()
        self._settings = [
            shown_setting(setting, self.scenario, self._values[setting.name])
            for setting in load_settings()
            if setting.name in self._values
        ]

    def end(self) -> None:
        """Close its bus."""
        self._opened.close()

    @property
    def now(self) -> float:
        """Time since it was opened, s."""
        return time.monotonic() - self._begin

    def hello(self) -> dict[str, Any]:
        """What a page draws itself from."""
        s = self.scenario
        told = {"state": "state", "limit": "limit", "core_load": "idle"} | {
            name: value for name, (value, _) in TOLD.items()
        }
        known = {name for name, value in told.items() if value in self._values}
        return {
            "name": self._name,
            "source": "board",
            "method": s.drive.method,
            "max_speed_rpm": s.motor.max_speed_rpm,
            "supply_v": s.inverter.supply_v,
            "supply_most_v": s.inverter.protection.over_voltage_v,
            "rated_torque_nm": s.motor.rated_torque_nm,
            "settings": self._settings,
            "states": STATES,
            "faults": [
                entry | {"order": None, "why": BY_HAND}
                for entry in catalogue(s, lambda fault: BY_HAND)
                if entry["name"] != "Mend all"
            ],
            "without": [name for name in NAMES if name not in known],
        }

    def advance(self, seconds: float, until: str = "end") -> bool:
        """One look at all values, however long it takes."""
        self._poll()
        return False

    def _poll(self) -> None:
        for attempt in range(TRIES):
            try:
                reply = self._console.ask("get")
                break
            except SilentError:
                if attempt == TRIES - 1:
                    raise
        before = self._values.get("idle", "")
        self._values = dict(line.split(maxsplit=1) for line in reply[:-1] if " " in line)
        self._load = core_load(before, self._values.get("idle", ""))
        row = [np.nan] * len(NAMES)
        for name, (value, factor) in TOLD.items():
            try:
                row[NAMES.index(name)] = factor * float(self._values[value])
            except (KeyError, ValueError):
                continue
        for name, words in (("state", STATES), ("limit", LIMITS)):
            word = self._values.get(name, "")
            row[NAMES.index(name)] = float(words.index(word)) if word in words else np.nan
        row[NAMES.index("core_load")] = self._load
        self._rows.append((self.now, row))

    def act(self, action: messages.Action) -> None:
        """What a page asks for, now; RefusedError for what only a model has."""
        if isinstance(action, messages.Set):
            line = f"set {action.name} {action.value}"
        elif isinstance(action, messages.Drive):
            line = action.do
            if line == "reverse":
                line = f"set speed_rpm {-round(float(self._values.get('speed_rpm', '0')))}"
        else:
            raise RefusedError("a board has its own load, supply and faults: this page has no hold of them")
        if (problem := line_problem(line)) is not None:
            raise RefusedError(problem)
        answer = self._console.ask(line)[-1]
        self.said.append({"kind": "said", "t_s": self.now, "text": line, "answer": answer})

    def take(self) -> tuple[Floats, Floats]:
        """Times and traces since the last call."""
        rows, self._rows = self._rows, []
        times = np.array([at_s for at_s, _ in rows], np.float64)
        return times, np.array([row for _, row in rows], np.float32).reshape(-1, len(NAMES)).T

    def marks(self) -> Marks:
        """None: a console tells no instants."""
        return []

    def status(self) -> dict[str, Any]:
        """The drive by its own account."""
        told = self._values

        def number(name: str) -> float:
            try:
                return float(told.get(name, "0"))
            except ValueError:
                return 0.0

        return {
            "t_s": self.now,
            "state": told.get("state", "init"),
            "phase": told.get("phase", "none"),
            "fault": told.get("fault", "none"),
            "limit": told.get("limit", "none"),
            "lost_locks": int(number("lost_locks")),
            "target_rpm": number("speed_rpm"),
            "speed_rpm": number("measured_rpm"),
            "load_factor": 1.0,
            "supply_v": number("vdc_v"),
            "core_load": self._load if np.isfinite(self._load) else None,
            "values": {entry["name"]: told.get(entry["name"], entry["value"]) for entry in self._settings},
        }

    def export(self, name: str) -> dict[str, str]:
        """RefusedError."""
        raise RefusedError("what a board has done cannot be repeated exactly; `fluxlock live SCENARIO` exports plays")


def core_load(before: str, now: str) -> float:
    """Load of the core between two values of `idle`, %: idle clocks and clocks, both modulo 2^32; nan without them."""
    try:
        first, second = ([int(word) for word in value.split()] for value in (before, now))
        idle, clocks = ((new - old) % 2**32 for old, new in zip(first, second, strict=True))
        return 100.0 * (1.0 - idle / clocks)
    except (ValueError, ZeroDivisionError):
        return np.nan
