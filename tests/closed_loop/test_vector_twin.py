# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The native twin against the chip: the same scenarios through both, window by window."""

from __future__ import annotations

import os
from dataclasses import dataclass

import numpy as np
import pytest

from fluxlock.config import Scenario
from fluxlock.cosim.outcome import Run
from fluxlock.native.vector_run import play
from fluxlock.results.metrics import run_metrics, trips
from fluxlock.results.rundata import RunData
from fluxverify.regression.case import LOCK_MAY_GO, Row
from fluxverify.regression.runner import Runner
from fluxverify.regression.six_step.measures import event, timeline

EVERY_VARIABLE = "FLUXLOCK_VECTOR_TWIN"
START, ENCODER, OBSERVER = "vector/start.toml", "vector/encoder.toml", "vector/observer.toml"
RUNNING = 3  # drive_state_t
# How far the twin may be off the chip. Currents: share of the rated one.
SPEED_SHARE, ANGLE_DEG, CURRENT_SHARE, RUNNING_S = 0.01, 0.5, 0.045, 0.005

Events = list[dict[str, object]]


@dataclass(frozen=True)
class Comparison:
    """A scenario with overrides; its last window is `[end_s - length_s, end_s]`, its events those given or its own."""

    name: str
    scenario: str
    end_s: float
    length_s: float = 0.02
    events: Events | None = None
    overrides: tuple[str, ...] = ()


def _spinning(rpm: int, *more: dict[str, object]) -> Events:
    return [event(0.003, "command", f"set speed_rpm {rpm}"), event(0.004, "command", "start"), *more]


def _started(rpm: int) -> Events:
    return [event(0.01, "command", f"set speed_rpm {rpm}"), event(0.02, "command", "start")]


def _turning(rpm: int) -> tuple[str, ...]:
    return (f"initial.speed_rpm={rpm}", "initial.theta_deg=100")


SINGLE = ('drive.vector.update="single"', "drive.vector.delay=0.5", "drive.vector.observer_every=2")
IPM = ('motor="../../motors/ipm-4pp.toml"', 'drive.vector.angle="observer"', "drive.vector.handover_rpm=400")
COMPARISONS = (
    Comparison("caught", START, 0.09, events=_spinning(60_000), overrides=_turning(60_000)),
    Comparison("caught-backward", START, 0.09, events=_spinning(-40_000), overrides=_turning(-40_000)),
    Comparison("started", START, 0.50, events=_started(30_000)),
    Comparison("single-update", START, 0.50, events=_started(30_000), overrides=SINGLE),
    Comparison(
        "regulator-a",
        START,
        0.25,
        events=_spinning(50_000, event(0.1, "load_factor", 3.0)),
        overrides=(*_turning(40_000), 'drive.vector.regulator="A"', "drive.vector.delay=1.0"),
    ),
    Comparison(
        "regulator-b",
        START,
        0.25,
        events=_spinning(50_000, event(0.1, "load_factor", 3.0)),
        overrides=(*_turning(40_000), 'drive.vector.regulator="B"', 'drive.vector.park="held"'),
    ),
    Comparison(
        "load-step",
        START,
        0.30,
        events=_spinning(40_000, event(0.1, "load_factor", 4.0)),
        overrides=_turning(40_000),
    ),
    Comparison(
        "weakening",
        START,
        0.14,
        events=_spinning(60_000, {"at_s": 0.04, "supply_v": 11.0, "ramp_s": 0.02}),
        overrides=(*_turning(60_000), "drive.vector.weakening=true", "inverter.protection.under_voltage_v=8"),
    ),
    Comparison(
        "current-limit",
        START,
        0.12,
        events=_spinning(80_000),
        overrides=(
            *_turning(30_000),
            "drive.accel_rpm_per_s=5000000",
            "drive.current_limit_a=15",
            "load.fan_torque_nm=0.005",
        ),
    ),
    Comparison(
        "reversal",
        START,
        0.90,
        events=[*_spinning(25_000), event(0.06, "command", "set speed_rpm -25000")],
        overrides=_turning(25_000),
    ),
    Comparison("encoder", ENCODER, 0.60),
    Comparison("encoder-load", ENCODER, 0.40, events=[*_started(1_500), event(0.25, "load_factor", 2.0)]),
    Comparison("imposed", OBSERVER, 0.06, 0.012),
)
QUICK = ("caught",)
EVERY = EVERY_VARIABLE in os.environ


def _first_running_s(data: RunData) -> float | None:
    states = data.states()
    at = np.flatnonzero(states["state"] == RUNNING)
    return float(states["t_s"][at[0]]) if at.size else None


def _overrides(comparison: Comparison) -> tuple[str, ...]:
    begin, end = comparison.end_s - comparison.length_s, comparison.end_s
    events = comparison.events
    listed = timeline(end, events or [], [("end", begin, end)])
    if events is None:
        listed = [line for line in listed if not line.startswith("event=")]
    return (*comparison.overrides, "expect=[]", *listed)


def _difference(a: float | None, b: float | None) -> float | None:
    return None if a is None or b is None else a - b


def _end(data: RunData, scenario: Scenario) -> dict[str, float | None]:
    _, metrics = run_metrics(data, scenario)
    end, states = metrics["end"], data.states()
    return {
        "rpm": end["speed_rpm"]["mean"],
        "deg": end["angle_error_deg"]["rms"],
        "id_a": end["id_a"],
        "iq_a": end["iq_a"],
        "running_s": _first_running_s(data),
        "state": float(states["state"][-1]),
        "trips": float(len(trips(data))),
    }


def compared(comparison: Comparison, chip: Run, twin: RunData) -> Row:
    """A row of the differences, twin less chip."""
    real, ours = _end(chip.data, chip.scenario), _end(twin, chip.scenario)
    off = {name: _difference(ours[name], real[name]) for name in real}
    motor = chip.scenario.motor
    most_a = CURRENT_SHARE * motor.rated_current_a
    most_rpm = SPEED_SHARE * abs(real["rpm"] or 0.0)
    return Row(
        f"vector/twin/{comparison.name}",
        {"motor": motor.name, "scenario": comparison.scenario, "end_s": comparison.end_s},
        {
            "speed_rpm.mean": real["rpm"],
            "speed_rpm.difference": off["rpm"],
            "angle_error_deg.rms": real["deg"],
            "angle_error_deg.difference": off["deg"],
            "iq_a": real["iq_a"],
            "id_a.difference": off["id_a"],
            "iq_a.difference": off["iq_a"],
            "running_s": real["running_s"],
            "running_s.difference": off["running_s"],
            "state.difference": off["state"],
            "trips.difference": off["trips"],
        },
        {
            "speed_rpm.difference": (-most_rpm, most_rpm),
            "angle_error_deg.difference": (-ANGLE_DEG, ANGLE_DEG),
            "id_a.difference": (-most_a, most_a),
            "iq_a.difference": (-most_a, most_a),
            "running_s.difference": (-RUNNING_S, RUNNING_S),
            "state.difference": (0, 0),
            "trips.difference": (0, 0),
        },
    )


@pytest.mark.parametrize("name", [c.name for c in COMPARISONS if EVERY or c.name in QUICK])
def test_twin_ends_where_the_chip_ends(name: str) -> None:
    """Speed, angle error, currents, time of the start, state and trips: of one scenario, or with EVERY_VARIABLE of all.

    Verifies: VC-36
    """
    comparison = next(c for c in COMPARISONS if c.name == name)
    accepted = dict.fromkeys((*LOCK_MAY_GO, "current", "voltage"), "compared")
    runner = Runner("vector-twin", plots=False)
    chip = runner.drive(comparison.scenario, name, *_overrides(comparison), accept=accepted)
    row = compared(comparison, chip, play(chip.scenario, runner.seed))
    print(row.as_json())
    assert not row.misses()
