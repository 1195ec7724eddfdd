# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What the simulated sources share: the scenario's events until a page takes over, and the export of a play."""

from __future__ import annotations

import math
import re
from abc import ABC, abstractmethod
from collections import deque
from contextlib import suppress
from typing import Any

import numpy as np
from pydantic import ValidationError

from fluxlock.config import ConfigError, Scenario
from fluxlock.config.console import line_problem
from fluxlock.config.scenario import BOOT_S, Accept, Event, Expect, Fault, Window
from fluxlock.config.write import scenario_texts
from fluxlock.firmware.binding import names
from fluxlock.headers import CData
from fluxlock.interface.settings import Setting, load_settings
from fluxlock.live import messages
from fluxlock.live.faults import NO_BUS, catalogue, without
from fluxlock.live.source import RefusedError
from fluxlock.live.traces import NAMES, TOLD, Floats
from fluxlock.native.play import ScenarioPlay
from fluxlock.native.player import player
from fluxlock.results.rundata import trip_cause_names

END_S = 0.05  # window of an exported scenario
SPEED_SHARE = 0.01  # of the mean speed there, to its limits
PROBED_S = 0.5  # kept of the drive that tells its settings


class Played(ABC):
    """A simulated drive that runs the scenario's events and whatever else it is told."""

    kind: str  # of the source, for the page

    def __init__(self, scenario: Scenario, seed: int) -> None:
        self.scenario, self.seed = scenario, seed
        self.said: list[dict[str, Any]] = []
        self.settings = settings_of(scenario, seed)
        self.done: list[Event] = []
        self._agenda = scenario.events_in_order()
        self._last: Floats = np.zeros(len(TOLD))
        self._speeds: deque[tuple[float, float]] = deque()  # time and true speed of the last END_S
        self._causes = 0  # of trips until now
        self.load_factor, self.supply_v = 1.0, scenario.inverter.supply_v

    @property
    @abstractmethod
    def now(self) -> float:
        """Simulated time, s."""

    @abstractmethod
    def _go(self, end_s: float, until: str = "end") -> bool:
        """Simulate up to a time, or to what is waited for: whether it came."""

    @abstractmethod
    def _carry_out(self, event: Event) -> None:
        """Do it now; what the console answers goes to `_answered`."""

    @abstractmethod
    def _missing(self, fault: Fault) -> str:
        """Why the source does not have a fault; "": it has."""

    @abstractmethod
    def _telemetry(self) -> CData:
        """The drive by its own account, `telemetry_t`."""

    def hello(self) -> dict[str, Any]:
        """What a page draws itself from."""
        s = self.scenario
        return {
            "name": s.name,
            "source": self.kind,
            "method": s.drive.method,
            "max_speed_rpm": s.motor.max_speed_rpm,
            "supply_v": s.inverter.supply_v,
            "supply_most_v": s.inverter.protection.over_voltage_v,
            "rated_torque_nm": s.motor.rated_torque_nm,
            "settings": self.settings,
            "states": names("drive_state_t"),
            "faults": catalogue(s, self._missing, self._no_bus()),
        }

    def _advance(self, end_s: float, until: str = "end") -> bool:
        """Up to a time, or to the scenario's next event, which happens; whether `until` came before."""
        due_s = min([end_s, *(event.at_s for event in self._agenda[:1])])
        if self._go(due_s, until):
            return True
        if self._agenda and self._agenda[0].at_s <= due_s:
            self._act(self._agenda.pop(0))
        return False

    def act(self, action: messages.Action) -> None:
        """What a page asks for, now; from then on no event of the scenario happens. RefusedError."""
        try:
            event = Event.model_validate({"at_s": max(self.now, self._earliest(action))} | self._keys(action))
        except ValidationError as error:
            raise RefusedError(messages.one_line(error)) from None
        if self._agenda:
            text = f"the scenario's other events, {len(self._agenda)}, are left out: the drive is yours"
            self.said.append({"kind": "said", "t_s": self.now, "text": text, "answer": ""})
            self._agenda.clear()
        if event.at_s > self.now:
            self._go(event.at_s)
        self._act(event)

    def _no_bus(self) -> str:
        """Why no other node is on the drive's bus; "": one is."""
        return NO_BUS

    def _earliest(self, action: messages.Action) -> float:
        """The console takes no line before the drive has booted."""
        return BOOT_S if isinstance(action, (messages.Drive, messages.Set)) else 0.0

    def _keys(self, action: messages.Action) -> dict[str, Any]:
        """Keys of the event that an action is."""
        if isinstance(action, messages.LoadFactor):
            return {"load_factor": action.factor}
        if isinstance(action, messages.Supply):
            return {"supply_v": action.volt, "ramp_s": action.ramp_s}
        if isinstance(action, messages.Break):
            if why := self._missing(action.fault) or without(self.scenario, action.fault):
                raise RefusedError(why)
            return {"fault": action.fault.model_dump(exclude_unset=True)}
        if isinstance(action, messages.Bus):
            raise RefusedError(NO_BUS)
        if isinstance(action, messages.Set):
            line = f"set {action.name} {action.value}"
        elif action.do == "reverse":
            line = f"set speed_rpm {-int(self._telemetry().target_rpm)}"
        else:
            line = action.do
        if (problem := line_problem(line)) is not None:
            raise RefusedError(problem)
        return {"command": line}

    def _act(self, event: Event) -> None:
        self.done.append(event.model_copy(update={"at_s": self.now}))
        self._carry_out(self.done[-1])

    def _answered(self, event: Event, answer: str) -> None:
        """Into the journal; a setting that the drive has taken shows its value."""
        keys = event.model_dump(exclude={"at_s"}, exclude_unset=True, exclude_none=True)
        text = str(keys.get("command", ", ".join(f"{key} {value}" for key, value in keys.items())))
        self.said.append({"kind": "said", "t_s": event.at_s, "text": text, "answer": answer})
        if answer == "ok" and (found := re.fullmatch(r"set (\S+) (\S+)", line_of(event))):
            for entry in self.settings:
                if entry["name"] == found[1]:
                    entry["value"] = found[2]

    def _note_speed(self, time_s: Floats, rows: Floats) -> None:
        """Keep what `export` needs of new rows."""
        self._speeds.extend(zip(time_s.tolist(), rows[NAMES.index("speed_rpm")].tolist(), strict=True))
        while self._speeds and self._speeds[0][0] < self.now - END_S:
            self._speeds.popleft()

    def status(self) -> dict[str, Any]:
        """The drive as it is."""
        told = self._telemetry()
        return {
            "t_s": self.now,
            "state": names("drive_state_t")[int(told.state)],
            "phase": names("phase_t")[int(told.phase)],
            "fault": names("fault_t")[int(told.fault)],
            "limit": names("limit_t")[int(told.limit)],
            "lost_locks": int(told.lost_locks),
            "target_rpm": int(told.target_rpm),
            "speed_rpm": told.speed_rpm_q8 / 256,
            "load_factor": self.load_factor,
            "supply_v": self.supply_v,
            "values": {entry["name"]: entry["value"] for entry in self.settings},
        }

    def export(self, name: str) -> dict[str, str]:
        """Texts by file name of a scenario that repeats what was done and ends now."""
        status = self.status()
        end_s = max(self.now, BOOT_S)
        keys: dict[str, Any] = {
            "name": name,
            "description": f"Played live with {self.scenario.name}.",
            "duration_s": end_s,
            "seed": self.seed,
            "event": self._events(end_s),
            "window": [Window(name="end", from_s=max(0.0, end_s - END_S), to_s=end_s)] if end_s > 2 * END_S else [],
            "expect": [],
            "accept": self._accepts(),
            "expect_trip": trip_cause_names(self._causes),
            "expect_fault": None if status["fault"] == "none" else status["fault"],
        }
        if keys["window"] and self._speeds:
            rpm = sum(speed for _, speed in self._speeds) / len(self._speeds)
            room = SPEED_SHARE * abs(rpm) + 1.0
            keys["expect"] = [Expect(window="end", metric="speed_rpm.mean", min=rpm - room, max=rpm + room)]
        given = self.scenario.model_fields_set
        copy = self.scenario.model_copy(update=keys)
        copy.model_fields_set.update(given | keys.keys())
        copy.model_fields_set.discard("record")
        return scenario_texts(copy, f"{name}.toml", f"{name}-motor.toml", f"{name}-inverter.toml")

    def _events(self, end_s: float) -> list[Event]:
        """What was done. A ramp that goes on at the end becomes its part until then, since no scenario ends within."""
        found = list(self.done)
        for name, at_first in (("load_factor", 1.0), ("supply_v", self.scenario.inverter.supply_v)):
            begin, end, since_s, length_s = at_first, at_first, 0.0, 0.0
            for k, event in enumerate(self.done):
                goal = getattr(event, name)
                if goal is None:
                    continue
                share = min(1.0, (event.at_s - since_s) / length_s) if length_s > 0.0 else 1.0
                begin, end, since_s, length_s = begin + share * (end - begin), goal, event.at_s, event.ramp_s
                if since_s + length_s > end_s:
                    there = begin + (end_s - since_s) / length_s * (end - begin)
                    found[k] = event.model_copy(update={name: there, "ramp_s": end_s - since_s})
        return found

    def _accepts(self) -> list[Accept]:
        """What a play by hand may do that a scenario may not."""
        why = "played by hand"
        kinds = ("duty_min", "voltage", "current", "speed", "lost_angle", "lost_lock", "end_state", "rejected")
        kept = [accept for accept in self.scenario.accept if accept.what in ("trip", "fault")]
        return kept + [Accept.model_validate({"what": kind, "why": why}) for kind in kinds]


def line_of(event: Event) -> str:
    """The console line that an event is; "": it is none."""
    if event.speed_rpm is not None:
        return f"set speed_rpm {round(event.speed_rpm)}"
    return f"set accel_rpm_s {round(event.accel_rpm_per_s)}" if event.accel_rpm_per_s else event.command or ""


def settings_of(scenario: Scenario, seed: int) -> list[dict[str, Any]]:
    """The table of the settings with the values at the begin, read from a native drive that is not the one shown.

    Without values where no native drive is what the scenario asks for.
    """
    probe: ScenarioPlay | None = None
    with suppress(ConfigError):
        probe = player(scenario.model_copy(update={"can": None}), seed, PROBED_S)
        probe.advance(BOOT_S)
    found = []
    for setting in load_settings():
        if scenario.drive.method in setting.methods:
            answer = probe.firmware.command(f"get {setting.name}") if probe is not None else []
            value = answer[0].split(maxsplit=1)[1] if len(answer) > 1 and " " in answer[0] else ""
            found.append(shown_setting(setting, scenario, value))
    return found


def shown_setting(setting: Setting, scenario: Scenario, value: str) -> dict[str, Any]:
    """A setting for the page; low, high: its range in its unit, None where only the firmware knows it."""
    scale = 10**setting.decimals
    low = None if setting.min is None else setting.min / scale
    high = None if setting.max is None else setting.max / scale
    if setting.name == "speed_rpm":
        high = math.floor(scenario.motor.max_speed_rpm)
        low = -high
    elif setting.unit == "A":
        low, high = 0.0, scenario.inverter.sensing.current_full_scale_a
    return {
        "name": setting.name,
        "kind": setting.kind,
        "text": setting.text,
        "choices": list(setting.choices),
        "unit": setting.unit,
        "decimals": setting.decimals,
        "low": low,
        "high": high,
        "permitted": setting.permitted,
        "value": value,
    }
