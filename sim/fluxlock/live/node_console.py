# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A CANopen node asked as a console: values and settings by the console's names, start and stop by CiA 402."""

from __future__ import annotations

from itertools import cycle

from fluxlock.can.sdo import (
    DISABLE_OPERATION,
    DISABLE_VOLTAGE,
    ENABLE,
    ENABLED,
    FAULT_RESET,
    PROFILE_VELOCITY,
    SHUTDOWN,
    STATE_BITS,
    AbortedError,
    Objects,
)
from fluxlock.firmware.binding import names
from fluxlock.interface.settings import load_settings

# Values of the console by objects and their factor.
VALUES = {
    "measured_rpm": ("velocity_actual", 1),
    "reference_rpm": ("velocity_demand", 1),
    "vdc_v": ("dc_link_voltage", 1e-3),
    "lost_locks": ("observer_lost_locks", 1),
}
VECTOR_VALUES = {"id_ma": ("observer_i_d", 1), "iq_ma": ("observer_i_q", 1)}
# The drive's state by that of CiA 402. It does not tell whether an enabled drive still starts.
STATES = {0x00: "init", 0x40: "ready", 0x21: "ready", 0x23: "ready", 0x07: "stopping", 0x0F: "stopping", 0x08: "fault"}
WITHOUT_STATE = "operation enabled"
# Settings whose objects have names of their own; those of the others are `setting_NAME`.
NAMED = {"speed_rpm": "target_velocity", "accel_rpm_s": "profile_acceleration"}


class NodeConsole:
    """Answers as `board_console.Console` does, from SDOs. Raises NodeError where the node does not answer.

    vector: the drive is one with vector control.
    """

    def __init__(self, objects: Objects, vector: bool) -> None:
        self._objects, self._values = objects, VALUES | (VECTOR_VALUES if vector else {})
        settings = {s.name: (NAMED.get(s.name, f"setting_{s.name}"), tuple(s.choices)) for s in load_settings()}
        self._places = {name: place for name, place in settings.items() if objects.has(place[0])}
        self._rated_a = 1e-3 * objects.number("rated_current")
        self._settings = {name: self._setting(name) for name in self._places}
        self._turn = cycle(self._places)

    def _setting(self, name: str) -> str:
        place, choices = self._places[name]
        value = self._objects.number(place)
        return choices[value] if 0 <= value < len(choices) else str(value)

    def ask(self, line: str) -> list[str]:
        """Reply to `get`, `set NAME VALUE`, `start`, `stop`, `stop now`, `clear`; a refusal of `get` is raised."""
        if line == "get":
            return [*(f"{name} {value}" for name, value in self._get().items()), "ok"]
        try:
            self._order(line.split())
        except AbortedError as error:
            return [f"error: {error}"]
        return ["ok"]

    def _get(self) -> dict[str, str]:
        """All values; of the settings the target and another one are read again."""
        for name in ("speed_rpm", next(self._turn)):
            self._settings[name] = self._setting(name)
        number = self._objects.number
        state = number("statusword") & STATE_BITS
        found = {
            "state": WITHOUT_STATE if state == ENABLED else STATES.get(state, "init"),
            "fault": names("fault_t")[number("fault_present")],
            "motor_a": f"{1e-3 * abs(number('current_actual')) * self._rated_a:.3f}",
        }
        found |= {value: f"{factor * number(name):g}" for value, (name, factor) in self._values.items()}
        return self._settings | found

    def _order(self, words: list[str]) -> None:
        write = self._objects.write
        if words[0] == "set":
            self._set(words[1], words[2])
        elif words == ["start"]:
            write("modes_of_operation", PROFILE_VELOCITY)
            write("controlword", SHUTDOWN)
            write("controlword", ENABLE)
        elif words == ["clear"]:
            write("controlword", DISABLE_VOLTAGE)
            write("controlword", FAULT_RESET)
        else:
            write("controlword", DISABLE_VOLTAGE if words == ["stop", "now"] else DISABLE_OPERATION)

    def _set(self, name: str, value: str) -> None:
        if name not in self._places:
            raise AbortedError(f"{name} is no object of the node: set it by its console, or in the scenario")
        place, choices = self._places[name]
        self._objects.write(place, choices.index(value) if choices else round(float(value)))
        self._settings[name] = self._setting(name)
