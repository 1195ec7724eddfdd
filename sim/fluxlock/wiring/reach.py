# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""How a drive is asked for the test: by lines of its console, or by SDOs to its CANopen node."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from fluxlock.can.sdo import (
    DISABLE_VOLTAGE,
    ENABLE,
    ENABLED,
    FAULT,
    PROFILE_VELOCITY,
    SHUTDOWN,
    STATE_BITS,
    AbortedError,
    NodeError,
    Objects,
    objects_of,
)
from fluxlock.config import Scenario
from fluxlock.firmware.binding import names
from fluxlock.interface.settings import load_settings
from fluxlock.wiring.naming import Table, stopped

if TYPE_CHECKING:
    import can

Q17 = 2.0**17
# Setting and value for the test: a rotor that turns is waited for, never driven.
SETTINGS = {"check_wiring": "only", "catch": "0"}
VALUES = ("fault", "wiring_ma", "wiring_mv", "vdc_v", "offset_ma")
FLASH = "flash the firmware of this version"


class WiringError(RuntimeError):
    """The test gave no tables; the message says what the drive did instead."""


@dataclass(frozen=True)
class Told:
    """What the drive says after the test. Tables (3, 3) of leg and input, A and V, None before their end; link, V.

    offset_a: what the sensors of A, B, C show without current, measured at the boot; None: a node does not tell.
    """

    fault: str
    current_a: Table | None
    voltage_v: Table | None
    vdc_v: float
    offset_a: tuple[float, ...] | None = None


class Reach(Protocol):
    """A drive that can be asked for the test."""

    def begin(self) -> None:
        """Prepare and start it; WiringError if the drive refuses."""

    def look(self) -> tuple[bool, float]:
        """Whether it goes on, and the amplitude of the measured current (A)."""

    def told(self) -> Told:
        """Its result. Raises WiringError."""

    def end(self) -> None:
        """Gates off, and the settings as they were before; nothing of a drive that was not ready."""


def pairs(lines: list[str]) -> dict[str, str]:
    """Values of the console's lines `NAME VALUE`."""
    found = (line.strip().partition(" ") for line in lines)
    return {name: value.strip() for name, _, value in found if value}


def told_by(values: dict[str, str]) -> Told:
    """From the console's `VALUES`. Raises WiringError."""
    if missing := [name for name in VALUES if name not in values]:
        raise WiringError(f"the drive does not tell {', '.join(missing)}: {FLASH}")

    def table(text: str) -> Table | None:
        return None if text == "none" else np.array([1e-3 * float(word) for word in text.split()]).reshape(3, 3)

    tables = table(values["wiring_ma"]), table(values["wiring_mv"])
    offset_a = tuple(1e-3 * float(word) for word in values["offset_ma"].split()[:3])
    return Told(values["fault"], *tables, float(values["vdc_v"]), offset_a)


class ByConsole:
    """The drive's console. ask: a line and its reply."""

    def __init__(self, ask: Callable[[str], list[str]]) -> None:
        self._ask = ask
        self._before: dict[str, str] = {}

    def _get(self, name: str) -> str:
        return pairs(self._ask(f"get {name}")).get(name, "")

    def _must(self, line: str) -> None:
        reply = self._ask(line)
        if "ok" not in reply:
            raise WiringError(f"the drive refuses {line!r}: {' '.join(reply) or 'no answer'}")

    def begin(self) -> None:
        """See `Reach`. A start wants a target, also one that ends before the rotor turns."""
        state = self._get("state")
        if state == "fault":
            raise WiringError(stopped(self._get("fault")))
        if state != "ready":
            raise WiringError(f"the drive is in state {state or 'unknown'}: it must be ready")
        self._before = {name: self._get(name) for name in (*SETTINGS, "speed_rpm")}
        for name, value in SETTINGS.items():
            self._must(f"set {name} {value}")
        if self._before["speed_rpm"] == "0":
            self._must("set speed_rpm 1")
        self._must("start")

    def look(self) -> tuple[bool, float]:
        """See `Reach`."""
        return self._get("state") == "starting", float(self._get("motor_a") or 0.0)

    def told(self) -> Told:
        """See `Reach`."""
        return told_by(pairs([line for name in VALUES for line in self._ask(f"get {name}")]))

    def end(self) -> None:
        """See `Reach`."""
        if self._before and self._get("state") not in ("ready", "fault", "init"):
            self._ask("stop now")
        for name, value in self._before.items():
            self._ask(f"set {name} {value}")


def _number_of(name: str, value: str) -> int:
    """A setting's value as its object has it."""
    choices = next(setting.choices for setting in load_settings() if setting.name == name)
    return choices.index(value) if choices else int(value)


class BySdo:
    """The drive's CANopen node."""

    def __init__(self, objects: Objects, scenario: Scenario) -> None:
        self._objects, self._sensing = objects, scenario.inverter.sensing
        self._before: dict[str, int] = {}

    def _fault(self) -> str:
        return names("fault_t")[self._objects.number("fault_present")]

    def _state(self) -> int:
        return self._objects.number("statusword") & STATE_BITS

    def begin(self) -> None:
        """See `Reach`. The operation is enabled with a target; the drive ends it after the test."""
        state = self._state()
        if state == FAULT:
            raise WiringError(stopped(self._fault()))
        if state == ENABLED:
            raise WiringError("a master has enabled the drive's operation: it must be disabled")
        wanted = {"modes_of_operation": PROFILE_VELOCITY, "target_velocity": 1}
        wanted |= {f"setting_{name}": _number_of(name, value) for name, value in SETTINGS.items()}
        self._before = {name: self._objects.number(name) for name in wanted}
        for name, value in wanted.items():
            self._objects.write(name, value)
        for word in (SHUTDOWN, ENABLE):
            self._objects.write("controlword", word)

    def look(self) -> tuple[bool, float]:
        """See `Reach`."""
        permille = self._objects.number("current_actual")
        return self._state() == ENABLED, 1e-6 * abs(permille) * self._objects.number("rated_current")

    def told(self) -> Told:
        """See `Reach`."""
        data = self._objects.read("wiring_tables")
        fault = self._fault()
        vdc_v = 1e-3 * self._objects.number("dc_link_voltage")
        if not data:
            return Told(fault, None, None, vdc_v)
        current, voltage = np.frombuffer(data, "<i4").reshape(2, 3, 3) / Q17
        full_a, full_v = self._sensing.current_full_scale_a, self._sensing.voltage_full_scale_v
        return Told(fault, current * full_a, voltage * full_v, vdc_v)

    def end(self) -> None:
        """See `Reach`."""
        if self._before:
            self._objects.write("controlword", DISABLE_VOLTAGE)
        for name, value in self._before.items():
            self._objects.write(name, value)


@contextmanager
def sdo_of(bus: can.BusABC, scenario: Scenario, node_id: int) -> Iterator[BySdo]:
    """The node of a board on a bus, which is closed at the end. Raises WiringError where it does not answer."""
    try:
        with objects_of(bus, node_id) as objects:
            yield BySdo(objects, scenario)
    except AbortedError as error:
        raise WiringError(f"{error}; {FLASH}") from None
    except NodeError as error:
        raise WiringError(str(error)) from None
