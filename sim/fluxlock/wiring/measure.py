# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Runs the firmware's test of the wiring: on the twin, on the simulated chip, on a board at its serial port."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fluxlock.config import Scenario
from fluxlock.config.scenario import Event
from fluxlock.flash.serial_port import SerialPort
from fluxlock.wiring.naming import Finding, Table, Wiring, name_wiring, no_dividers

# The drive is ready; the longest test, with the coast before it; how long a board may take; the console's answer.
BOOT_S, TEST_S, PATIENCE_S, ANSWER_S = 5e-3, 0.2, 0.6, 0.5
POLL_S = 5e-3
LEAST_SHARE = 0.005  # of the rated current
# A start wants a target, also one that ends before the rotor turns.
SETTINGS = ("set check_wiring only", "set speed_rpm 1")
VALUES = ("state", "fault", "wiring_ma", "wiring_mv", "vdc_v")


class WiringError(RuntimeError):
    """The test gave no tables; the message says what the drive did instead."""


@dataclass(frozen=True)
class Measured:
    """Tables of leg and input (A, V), link (V), the drive's fault, findings and wiring. passed: by the drive itself."""

    current_a: Table
    voltage_v: Table
    vdc_v: float
    fault: str
    findings: list[Finding]
    wiring: Wiring

    @property
    def passed(self) -> bool:
        """Nothing is wrong, and the drive says so too."""
        return not self.findings and self.fault == "none"


def _table(text: str) -> Table:
    return np.array([1e-3 * float(word) for word in text.split()]).reshape(3, 3)


def judge(values: dict[str, str], scenario: Scenario) -> Measured:
    """From the console's values. Raises WiringError."""
    fault = values["fault"]
    if "none" in (values["wiring_ma"], values["wiring_mv"]):
        reason = f"the drive stopped with the fault {fault}" if fault != "none" else f"the drive is {values['state']}"
        raise WiringError(f"the test did not end: {reason}")
    current, voltage, vdc = _table(values["wiring_ma"]), _table(values["wiring_mv"]), float(values["vdc_v"])
    found, wiring = name_wiring(current, voltage, LEAST_SHARE * scenario.rated_current_a, vdc)
    if fault == "wiring" and not found and not voltage.any():
        found = [no_dividers()]
    return Measured(current, voltage, vdc, fault, found, wiring)


def _read(lines: list[str]) -> dict[str, str]:
    """Values of the console's lines `NAME VALUE`."""
    pairs = (line.strip().partition(" ") for line in lines)
    return {name: value.strip() for name, _, value in pairs if value}


def lead(ask: Callable[[str], list[str]], wait: Callable[[float], None]) -> dict[str, str]:
    """Run the test by a console; ask: a line and its reply. Raises WiringError."""
    before = _read(ask("get speed_rpm")).get("speed_rpm", "0")
    for line in (*(SETTINGS if before == "0" else SETTINGS[:1]), "start"):
        reply = ask(line)
        if "ok" not in [text.strip() for text in reply]:
            raise WiringError(f"the drive refuses {line!r}: {' '.join(reply) or 'no answer'}")
    for _ in range(round(PATIENCE_S / POLL_S)):
        wait(POLL_S)
        if _read(ask("get state")).get("state") != "starting":
            break
    else:
        ask("stop")
    ask("set check_wiring off")
    ask(f"set speed_rpm {before}")
    values = _read([line for name in VALUES for line in ask(f"get {name}")])
    if missing := [name for name in VALUES if name not in values]:
        raise WiringError(f"the drive does not tell {', '.join(missing)}: flash the firmware of this version")
    return values


def on_twin(scenario: Scenario, seed: int) -> Measured:
    """The firmware as a program, on the averaged machine. Raises WiringError, ConfigError for what the twin is not."""
    from fluxlock.native.vector_run import vector_chip_of

    chip = vector_chip_of(scenario, seed)
    period_s = chip.timing.period_s
    chip.advance(round(BOOT_S / period_s))
    return judge(lead(chip.fw.command, lambda s: chip.advance(round(s / period_s))), scenario)


def on_chip(scenario: Scenario, seed: int, folder: Path) -> Measured:
    """In the co-simulation of the chip, whose files go to a folder. Raises WiringError and SimulationFault."""
    from fluxlock.cosim.run import run_scenario

    lines = [(BOOT_S + 1e-3 * k, line) for k, line in enumerate((*SETTINGS, "start"))]
    lines += [(BOOT_S + TEST_S + 2e-3 * (k + 2), f"get {name}") for k, name in enumerate(VALUES)]
    update = {
        "event": [Event(at_s=at_s, command=line) for at_s, line in lines],
        "duration_s": lines[-1][0] + 5e-3,
        "window": [],
        "expect": [],
    }
    data = run_scenario(scenario.model_copy(update=update), folder, seed)
    values = _read(data.uart)
    if missing := [name for name in VALUES if name not in values]:
        raise WiringError(f"the console did not tell {', '.join(missing)}")
    return judge(values, scenario)


def on_board(scenario: Scenario, port: SerialPort) -> Measured:
    """On a board that runs the scenario's firmware. Raises WiringError."""

    def ask(line: str) -> list[str]:
        port.write(f"{line}\n".encode())
        text, end = b"", time.monotonic() + ANSWER_S
        while time.monotonic() < end:
            text += port.read(1, ANSWER_S)
            lines = text.decode("ascii", "replace").splitlines()
            if text.endswith(b"\n") and lines and (lines[-1] == "ok" or lines[-1].startswith("error")):
                return lines
        raise WiringError(f"no answer to {line!r}: is the board flashed and does it run?")

    return judge(lead(ask, time.sleep), scenario)
