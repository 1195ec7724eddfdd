# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Angle error of the chip's observer over the speed range when the machine differs from what the firmware is told."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from fluxlock.cosim.outcome import Run
from fluxlock.results.angles import dq_current
from fluxlock.theory.vector.model import Sampling, SmoothMachine
from fluxlock.theory.vector.parameters import SINGLE, WORST_PAIRS, Change, changed
from fluxlock.theory.vector.sensorless import Drive, rest
from fluxverify.regression.case import Condition, Number, Row, case
from fluxverify.regression.runner import Runner
from fluxverify.regression.six_step.measures import console_word, event, timeline
from fluxverify.regression.vector.frames import angle_errors_deg, frame_changes_s

SCENARIO = "vector/start.toml"
TOP_RPM, QUICK_RPM = 90_000, 20_000
ACCEL_RPM_PER_S = 350_000
END_S, QUICK_END_S = 0.52, 0.35
ALIGNED_S = 0.08
SETTLED_S = 0.03  # after the hand-over: angle, and i_d gone
BAND_RPM = 10_000
WITHIN = 0.1  # of a band's speed, on either side
SPEED_SHARE = 0.01
TICK_HZ, DELAY = 10e3, 1.0


@dataclass(frozen=True)
class Point:
    """Mean angle error in a band of speed, and that of the closed form at the band's speed and current."""

    speed_rpm: float
    current_a: float
    error_deg: float
    closed_deg: float


def _name(change: Change) -> str:
    return "-".join(change.text.replace(" %", "%").replace(" ", "").split(","))


def points(run: Run, change: Change, from_s: float, top_rpm: float) -> list[Point]:
    """Errors in bands of a tenth about each 10 000 r/min of a ramp."""
    records, motor = run.data.records, run.scenario.motor
    time_s, rpm = records["t_cycle"] / run.data.clock_hz, records["omega_e"] * 30.0 / math.pi / motor.pole_pairs
    current = dq_current(records)
    machine = SmoothMachine.from_motor(motor)
    # The machine of the run is the changed one; the firmware's is that of its file.
    told = machine.changed(1.0 / change.r, 1.0 / change.l, 1.0 / change.psi)
    drive = changed(Drive.usual(told, Sampling.at(TICK_HZ, DELAY, "exact"), 1j), change)
    found = []
    for speed_rpm in range(BAND_RPM, int(top_rpm) + 1, BAND_RPM):
        inside = (time_s >= from_s) & (np.abs(rpm - speed_rpm) < WITHIN * BAND_RPM)
        if not inside.any():
            continue
        span = float(time_s[inside][0]), float(time_s[inside][-1])
        error_deg = float(angle_errors_deg(run, span).mean())
        mean = complex(current[inside].mean()) * np.exp(-1j * math.radians(error_deg))
        closed = rest(replace(drive, current=mean), motor.omega_e(speed_rpm), mean).error_deg
        found.append(Point(speed_rpm, float(abs(mean)), error_deg, float(closed)))
    return found


def _row(runner: Runner, change: Change) -> Row:
    top_rpm, end_s = (QUICK_RPM, QUICK_END_S) if runner.quick else (TOP_RPM, END_S)
    events = [
        event(0.003, "speed_rpm", top_rpm),
        event(0.004, "command", "start"),
        event(end_s - 0.005, "command", "get lost_locks"),
    ]
    run = runner.drive(
        SCENARIO,
        _name(change),
        f"drive.accel_rpm_per_s={ACCEL_RPM_PER_S}",
        *(
            f"drive.motor_error.{key}={1.0 / factor:.6f}"
            for key, factor in (("resistance", change.r), ("inductance", change.l), ("flux", change.psi))
            if factor != 1.0
        ),
        "expect=[]",
        *timeline(end_s, events, [("end", end_s - 0.02, end_s)]),
    )
    (over_s,) = frame_changes_s(run, ALIGNED_S, end_s, 1)
    after = angle_errors_deg(run, (over_s + SETTLED_S, end_s))
    bands = points(run, change, over_s + SETTLED_S, top_rpm)
    values: dict[str, Number] = {f"angle_error_deg.{p.speed_rpm:.0f}": p.error_deg for p in bands}
    values |= {f"closed_form_deg.{p.speed_rpm:.0f}": p.closed_deg for p in bands}
    values |= {f"current_a.{p.speed_rpm:.0f}": p.current_a for p in bands}
    values |= {
        "angle_error_deg.max": float(np.abs(after).max()),
        "less_closed_form_deg.max": max((abs(p.error_deg - p.closed_deg) for p in bands), default=None),
        "speed_rpm.end": run.metrics["end"]["speed_rpm"]["mean"],
        "trips": len(run.result["trips"]),
        "faults": int(run.data.fault is not None),
        "lost_locks": int(console_word(run, "lost_locks") or 0),
    }
    conditions: dict[str, Condition] = {
        "motor": "Motor-I",
        "load": "fan 20 mN*m at 60 000 r/min",
        "machine_against_file": change.text,
        "accel_rpm_per_s": ACCEL_RPM_PER_S,
        "speed_rpm": top_rpm,
    }
    low, high = (1 - SPEED_SHARE) * top_rpm, (1 + SPEED_SHARE) * top_rpm
    return Row(
        f"vector/parameter-errors/{_name(change)}",
        conditions,
        values,
        {"speed_rpm.end": (low, high), "trips": (0, 0), "faults": (0, 0), "lost_locks": (0, 0)},
    )


@case("vector/parameter-errors", long=True)
def parameter_errors(runner: Runner) -> Iterator[Row]:
    """Chip, R ± 50 %, L ± 30 %, psi - 10 % and their worst sums: angle error over speed, no loss of control."""
    found = {}
    for change in SINGLE[3:4] if runner.quick else (*SINGLE, *WORST_PAIRS):
        row = _row(runner, change)
        found[change.text] = row
        yield row
    if runner.quick:
        return
    errors = {name: row.values["angle_error_deg.max"] or 0.0 for name, row in found.items()}
    worst = max(errors, key=lambda name: errors[name])
    yield Row(
        "vector/parameter-errors/worst",
        {"motor": "Motor-I", "machine_against_file": worst},
        {"angle_error_deg.max": errors[worst]},
    )
