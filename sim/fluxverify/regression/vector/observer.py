# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Angle error of the EMF observer with the right and with a wrong delay, host and chip (thesis section 7.4)."""

from __future__ import annotations

import math
from collections.abc import Iterator

from fluxlock.base.paths import ROOT
from fluxlock.config import load_motor
from fluxlock.cosim.outcome import Run
from fluxlock.theory.vector.model import SmoothMachine
from fluxverify.regression.case import Condition, Row, case
from fluxverify.regression.runner import Runner
from fluxverify.regression.six_step.measures import event, toml_value
from fluxverify.regression.vector.host_observer import host_errors_deg

SCENARIO = "vector/observer.toml"
MOTOR = ROOT / "motors" / "motor-1.toml"
CURRENT_A, CARRIER_HZ, PERIOD_CYCLES = 10.0, 15_000, 3333
# (T_d, T'_d over T_s) -> error (deg) at 750 and 1500 Hz, forward; in reverse the signs turn.
SPECIFIED_DEG = {
    (0.25, 0.0): (4.63, 9.06),
    (0.5, 0.0): (9.24, 18.11),
    (0.75, 0.0): (13.76, 26.66),
    (0.75, 1.0): (-4.69, -8.86),
    (0.5, 1.0): (-9.53, -18.68),
    (0.25, 1.0): (-14.44, -28.96),
}
SPEEDS_HZ = (750, 1500)
DELAYS = (0.25, 0.5, 0.75, 1.0)
HOST_DEG, CHIP_DEG = 0.1, 0.5
RIGHT_MEAN_DEG, RIGHT_RMS_DEG = 0.3, 0.5
# The rotor turns at half its speed from the beginning on: the drive catches it without a current. What it is asked for
# then is so far above the imposed speed that the speed regulator wants the whole current. A loop of 400 Hz follows the
# imposed ramp, to 1500 Hz in 10 ms, 4.3 degrees behind; in 4 ms the angle was lost on the way.
STARTED_S, ASKED_S, THERE_S, ABOVE_RPM = 0.004, 0.014, 0.024, 3000


def conditions_of(speed_hz: float, delay: float, believed: float) -> dict[str, Condition]:
    """Conditions of a row. speed_hz: electrical, signed."""
    return {
        "motor": "Motor-I",
        "carrier_hz": CARRIER_HZ,
        "electrical_hz": speed_hz,
        "iq_a": math.copysign(CURRENT_A, speed_hz),
        "delay": delay,
        "believed_delay": believed,
    }


def demands(rpm: float) -> list[dict[str, object]]:
    """Events of a run at an imposed speed (r/min, signed)."""
    return [
        event(STARTED_S - 0.001, "command", f"set speed_rpm {rpm / 2.0:.0f}"),
        event(STARTED_S, "command", "start"),
        event(ASKED_S, "command", f"set speed_rpm {rpm + math.copysign(ABOVE_RPM, rpm):.0f}"),
    ]


def drive_at(runner: Runner, speed_hz: float, delay: float, believed: float) -> Run:
    """The chip at an imposed electrical speed (Hz, signed) of Motor-I, one pole pair."""
    rpm = 60.0 * speed_hz
    return runner.drive(
        SCENARIO,
        f"{speed_hz:g}-{delay:g}-{believed:g}",
        f"mechanics.profile={[[0.0, rpm / 2.0], [ASKED_S, rpm / 2.0], [THERE_S, rpm]]}",
        f"event=[{', '.join(map(toml_value, demands(rpm)))}]",
        f"drive.vector.delay={delay}",
        *((f"drive.vector.believed_delay={believed}",) if believed != delay else ()),
    )


def _name(speed_hz: float, delay: float, believed: float) -> str:
    return f"{delay:g}-as-{believed:g}/{speed_hz:g}Hz"


def _signed_speeds() -> Iterator[tuple[int, int]]:
    """Index of the speed and the speed, forward and reverse."""
    for index, speed_hz in enumerate(SPEEDS_HZ):
        yield index, speed_hz
        yield index, -speed_hz


@case("vector/observer-delay/host", tested=True)
def host(runner: Runner) -> Iterator[Row]:
    """Firmware on this computer, exact model: the specified angle errors of six wrong delays, forward and reverse."""
    machine = SmoothMachine.from_motor(load_motor(MOTOR))
    for (delay, believed), specified in SPECIFIED_DEG.items():
        for index, speed_hz in _signed_speeds():
            if runner.quick and abs(speed_hz) != SPEEDS_HZ[-1]:
                continue
            wanted = math.copysign(specified[index], specified[index] * speed_hz)
            current = complex(0.0, math.copysign(CURRENT_A, speed_hz))
            errors = host_errors_deg(machine, PERIOD_CYCLES, delay, believed, speed_hz, current)
            mean = sum(errors) / len(errors)
            yield Row(
                f"vector/observer-delay/host/{_name(speed_hz, delay, believed)}",
                conditions_of(speed_hz, delay, believed),
                {
                    "angle_error_deg.mean": mean,
                    "specified_deg": wanted,
                    "less_specified_deg": mean - wanted,
                    "spread_deg": max(errors) - min(errors),
                },
                {"less_specified_deg": (-HOST_DEG, HOST_DEG)},
            )


@case("vector/observer-delay/chip", long=True)
def chip(runner: Runner) -> Iterator[Row]:
    """Chip with switched inverter and 12-bit noise, sensorless: the same six wrong delays."""
    for (delay, believed), specified in SPECIFIED_DEG.items():
        for index, speed_hz in _signed_speeds():
            if runner.quick and (delay, believed, speed_hz) != (0.5, 0.0, SPEEDS_HZ[0]):
                continue
            wanted = math.copysign(specified[index], specified[index] * speed_hz)
            run = drive_at(runner, speed_hz, delay, believed)
            error = run.metrics["steady"]["angle_error_deg"]
            mean = error["mean"]
            yield Row(
                f"vector/observer-delay/chip/{_name(speed_hz, delay, believed)}",
                conditions_of(speed_hz, delay, believed),
                {
                    "angle_error_deg.mean": mean,
                    "angle_error_deg.max": error["max"],
                    "specified_deg": wanted,
                    "less_specified_deg": None if mean is None else mean - wanted,
                    "iq_a": run.metrics["steady"]["iq_a"],
                    "trips": len(run.result["trips"]),
                },
                {"less_specified_deg": (-CHIP_DEG, CHIP_DEG), "trips": (0, 0)},
            )


@case("vector/observer-delay/right", long=True)
def right(runner: Runner) -> Iterator[Row]:
    """Chip with the right delay at four delays, both speeds and directions: no angle error, with 12-bit noise."""
    for delay in DELAYS:
        for _, speed_hz in _signed_speeds():
            if runner.quick and (delay, speed_hz) != (0.25, -SPEEDS_HZ[-1]):
                continue
            run = drive_at(runner, speed_hz, delay, delay)
            error = run.metrics["steady"]["angle_error_deg"]
            yield Row(
                f"vector/observer-delay/right/{delay:g}/{speed_hz:g}Hz",
                conditions_of(speed_hz, delay, delay),
                {
                    "angle_error_deg.mean": error["mean"],
                    "angle_error_deg.rms": error["rms"],
                    "angle_error_deg.max": error["max"],
                    "iq_a": run.metrics["steady"]["iq_a"],
                    "trips": len(run.result["trips"]),
                },
                {
                    "angle_error_deg.mean": (-RIGHT_MEAN_DEG, RIGHT_MEAN_DEG),
                    "angle_error_deg.rms": (None, RIGHT_RMS_DEG),
                    "trips": (0, 0),
                },
            )
