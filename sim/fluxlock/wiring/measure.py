# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Runs the firmware's test of the wiring: on the twin, on the simulated chip, on a board at serial port or CAN bus.

Of a scenario's events its faults alone happen: the test is before the first turn.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fluxlock.config import Motor, Scenario
from fluxlock.config.scenario import Event
from fluxlock.flash.board_console import Console, Port, SilentError
from fluxlock.wiring.naming import (
    CURRENT_SHARE,
    WAITS,
    Evidence,
    Finding,
    Table,
    Wiring,
    anisotropy,
    name_wiring,
    stopped,
)
from fluxlock.wiring.reach import SETTINGS, VALUES, ByConsole, Reach, Told, WiringError, pairs, sdo_of, told_by

if TYPE_CHECKING:
    import can

# The drive is ready; the longest test, with the coast before it; how long a board may take.
BOOT_S, TEST_S, PATIENCE_S = 5e-3, 0.2, 0.6
POLL_S = 5e-3
LEAST_SHARE = 0.005  # of the rated current
KEPT_S = 1.0  # of what the twin records
# A number of a table is a difference of means of four samples, halved: its noise over that of a sample.
NOISE_SHARE = math.sqrt(8) / 8
QUANTUM_LSB = 1 / math.sqrt(12)  # rms of a converter's rounding


@dataclass(frozen=True)
class Measured:
    """Tables of leg and input (A, V), link (V), the drive's fault, findings and wiring. passed: by the drive itself.

    peak_a: largest current that was seen, noise_a: of the current table's numbers, rms, by the inverter file. offset_a:
    what the sensors of A, B, C show without current, None by CAN.
    """

    current_a: Table
    voltage_v: Table
    vdc_v: float
    fault: str
    findings: list[Finding]
    wiring: Wiring
    peak_a: float
    noise_a: float
    offset_a: tuple[float, ...] | None

    @property
    def passed(self) -> bool:
        """Nothing is wrong, and the drive says so too."""
        return not self.findings and self.fault == "none"


def noise_a(scenario: Scenario) -> float:
    """Noise of a number of the current table, rms, as the inverter file has it."""
    sensing = scenario.inverter.sensing
    lsb_a = sensing.current_full_scale_a / 2.0 ** (sensing.bits - 1)
    return NOISE_SHARE * math.hypot(sensing.noise_lsb, QUANTUM_LSB) * lsb_a


def file_anisotropy(motor: Motor) -> float:
    """Largest over least inductance of all directions, of the motor file."""
    if motor.inductance_q_h is not None:
        ratio = motor.inductance_q_h / motor.inductance_h[0]
        return max(ratio, 1.0 / ratio)
    return anisotropy(np.array(motor.inductance_matrix_h))


def judge(told: Told, scenario: Scenario, peak_a: float = 0.0) -> Measured:
    """From what the drive tells, and the largest current seen meanwhile (A). Raises WiringError."""
    # Tables of an earlier test stay where another fault ends a start.
    if told.fault not in ("none", "wiring"):
        raise WiringError(stopped(told.fault))
    if told.current_a is None or told.voltage_v is None:
        raise WiringError("the test did not end")
    rated_a, noise = scenario.rated_current_a, noise_a(scenario)
    evidence = Evidence(
        told.current_a,
        told.voltage_v,
        LEAST_SHARE * rated_a,
        told.vdc_v,
        noise,
        peak_a,
        CURRENT_SHARE * rated_a,
        file_anisotropy(scenario.motor),
    )
    found, wiring = name_wiring(evidence, told.fault == "wiring")
    tables = told.current_a, told.voltage_v, told.vdc_v
    return Measured(*tables, told.fault, found, wiring, peak_a, noise, told.offset_a)


def lead(drive: Reach, wait: Callable[[float], None]) -> tuple[Told, float]:
    """Run the test: what the drive tells, the largest current seen (A). The drive is left as before. WiringError."""
    peak_a = 0.0
    try:
        drive.begin()
        for _ in range(round(PATIENCE_S / POLL_S)):
            wait(POLL_S)
            goes_on, current_a = drive.look()
            peak_a = max(peak_a, current_a)
            if not goes_on:
                return drive.told(), peak_a
    finally:
        drive.end()
    raise WiringError(f"the test did not end within {PATIENCE_S:g} s: {WAITS}")


def faults_of(scenario: Scenario) -> list[Event]:
    """Events that break something, by time."""
    return sorted((event for event in scenario.event if event.fault is not None), key=lambda event: event.at_s)


def on_twin(scenario: Scenario, seed: int) -> Measured:
    """The firmware as a program, on the averaged machine. Raises WiringError, ConfigError for what the twin is not."""
    from fluxlock.native.vector_run import Play

    faults = faults_of(scenario)
    play = Play(scenario.model_copy(update={"event": faults, "window": [], "expect": []}), seed, kept_s=KEPT_S)

    def wait(seconds: float) -> None:
        until_s = play.now + seconds
        while faults and faults[0].at_s <= until_s:
            event = faults.pop(0)
            play.advance(max(event.at_s, play.now))
            play.act(event)
        play.advance(until_s)

    wait(BOOT_S)
    told, peak_a = lead(ByConsole(play.firmware.command), wait)
    return judge(told, scenario, peak_a)


def first_answers(uart: list[str]) -> dict[str, str]:
    """Values that were asked for; at its end a run asks for the log of faults, whose lines begin alike."""
    return pairs(uart[::-1])


def on_chip(scenario: Scenario, seed: int, folder: Path) -> Measured:
    """In the co-simulation of the chip, whose files go to a folder. Raises WiringError and SimulationFault."""
    from fluxlock.cosim.run import run_scenario

    settings = [f"set {name} {value}" for name, value in SETTINGS.items()]
    lines = [(BOOT_S + 1e-3 * k, line) for k, line in enumerate((*settings, "set speed_rpm 1", "start"))]
    lines += [(BOOT_S + POLL_S * k, "get motor_a") for k in range(2, round(TEST_S / POLL_S))]
    asked = ("state", *VALUES)
    lines += [(BOOT_S + TEST_S + 2e-3 * (k + 2), f"get {name}") for k, name in enumerate(asked)]
    faults = [event for event in faults_of(scenario) if event.at_s < lines[-1][0]]
    update = {
        "event": sorted([*faults, *(Event(at_s=at_s, command=line) for at_s, line in lines)], key=lambda e: e.at_s),
        "duration_s": lines[-1][0] + 5e-3,
        "window": [],
        "expect": [],
    }
    data = run_scenario(scenario.model_copy(update=update), folder, seed)
    values = first_answers(data.uart)
    if values.get("state") == "starting":
        raise WiringError(f"the test did not end within {TEST_S:g} s: {WAITS}")
    peak_a = max(float(pairs([line]).get("motor_a", "0")) for line in data.uart)
    return judge(told_by(values), scenario, peak_a)


def on_board(scenario: Scenario, port: Port) -> Measured:
    """On a board that runs the scenario's firmware, at its serial port. Raises WiringError."""
    try:
        told, peak_a = lead(ByConsole(Console(port).ask), time.sleep)
    except SilentError as error:
        raise WiringError(str(error)) from None
    return judge(told, scenario, peak_a)


def on_bus(scenario: Scenario, bus: can.BusABC, node_id: int) -> Measured:
    """On a board that runs the scenario's firmware, by its CANopen node. Raises WiringError."""
    with sdo_of(bus, scenario, node_id) as drive:
        told, peak_a = lead(drive, time.sleep)
    return judge(told, scenario, peak_a)
