# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Machine of Tian 2019, I/Q demodulation, exact angle sequence: angle error while torque, load or speed step."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from fluxlock.cosim.outcome import Run
from fluxverify.regression.case import Number, Row, case
from fluxverify.regression.five_phase.driven import angle_values, largest_mean_deg
from fluxverify.regression.five_phase.tian import AT_THE_LIMIT, SCENARIO
from fluxverify.regression.runner import Runner
from fluxverify.regression.six_step.measures import event, timeline

LARGEST_DEG = 5.0
SPEED_RPM, RAMP = 60.0, 600.0  # r/min, r/min/s
LOAD_NM = 8.0
DEAD_TIMES_US = (0.0, 2.0)
AT_SPEED_S = 0.13
AT_ONCE = 100_000.0  # r/min/s
BEFORE_S = 0.02  # of the window, before the step


@dataclass(frozen=True)
class Step:
    """Course of a run with a step at at_s."""

    at_s: float
    overrides: list[str]


def torque_step(quick: bool) -> Step:
    """From 2 A to -2 A."""
    at_s, end_s = (0.07, 0.12) if quick else (0.09, 0.17)
    events = [
        event(0.002, "speed_rpm", 130.0),
        event(0.004, "command", "start"),
        event(at_s, "command", "set speed_rpm -130"),
    ]
    overrides = [
        *timeline(end_s, events, [("steady", at_s - BEFORE_S, end_s)]),
        *AT_THE_LIMIT,
        "drive.current_limit_a=2.0",
        f"drive.accel_rpm_per_s={AT_ONCE:g}",
    ]
    return Step(at_s, overrides)


def to_speed(step: dict[str, object]) -> list[dict[str, object]]:
    """Events: to SPEED_RPM by a ramp, which the rotor reaches at AT_SPEED_S, then a step."""
    return [event(0.002, "speed_rpm", SPEED_RPM), event(0.004, "command", "start"), step]


def load_torque_step(quick: bool) -> Step:
    """LOAD_NM on a shaft without load that reaches SPEED_RPM."""
    at_s, end_s = (AT_SPEED_S, 0.165) if quick else (AT_SPEED_S, 0.25)
    events = [event(0.0, "load_factor", 0.0), *to_speed(event(at_s, "load_factor", 1.0))]
    overrides = [
        *timeline(end_s, events, [("steady", at_s - BEFORE_S, end_s)]),
        f"load.constant_nm={LOAD_NM:g}",
        f"drive.accel_rpm_per_s={RAMP:g}",
    ]
    return Step(at_s, overrides)


def speed_step(quick: bool) -> Step:
    """Target from SPEED_RPM to its opposite at once, viscous load."""
    at_s, end_s = (AT_SPEED_S, 0.16) if quick else (AT_SPEED_S, 0.36)
    events = [
        event(at_s - 0.001, "accel_rpm_per_s", AT_ONCE),
        *to_speed(event(at_s, "command", f"set speed_rpm {-SPEED_RPM:g}")),
    ]
    overrides = [
        *timeline(end_s, events, [("steady", at_s - BEFORE_S, end_s)]),
        "drive.vector.speed_hz=6",
        f"drive.accel_rpm_per_s={RAMP:g}",
    ]
    return Step(at_s, overrides)


STEPS = {"torque-reversal": torque_step, "load-step": load_torque_step, "speed-reversal": speed_step}


def stepped(runner: Runner, name: str, dead_time_us: float) -> tuple[Run, float]:
    """The run of a step of STEPS, and its instant."""
    step = STEPS[name](runner.quick)
    used = [*step.overrides, "expect=[]", f"inverter.dead_time_s={dead_time_us * 1e-6:g}"]
    return runner.drive(SCENARIO, f"{name}-{dead_time_us:g}us", *used), step.at_s


def row_of(runner: Runner, name: str, dead_time_us: float) -> Row:
    """Row of that run."""
    run, at_s = stepped(runner, name, dead_time_us)
    values: dict[str, Number] = {"largest_5ms_mean_deg": largest_mean_deg(run, at_s - BEFORE_S), **angle_values(run)}
    for kind in ("max", "min"):
        values[f"speed_rpm.{kind}"] = run.metrics["steady"]["speed_rpm"][kind]
    return Row(
        f"five-phase/tian-{name}/{dead_time_us:g}us",
        {"motor": "Tian", "dead_time_us": dead_time_us},
        values,
        {"largest_5ms_mean_deg": (None, LARGEST_DEG), "trips": (0, 0)},
    )


def rows_of(runner: Runner, name: str) -> Iterator[Row]:
    """Row of each dead time, of 2 us alone in the short version."""
    for dead_time_us in DEAD_TIMES_US[-1:] if runner.quick else DEAD_TIMES_US:
        yield row_of(runner, name, dead_time_us)


@case("five-phase/tian-torque-reversal")
def torque_reversal(runner: Runner) -> Iterator[Row]:
    """Free rotor, from 2 A to -2 A: largest 5 ms mean of the angle error."""
    yield from rows_of(runner, "torque-reversal")


@case("five-phase/tian-load-step")
def load_step(runner: Runner) -> Iterator[Row]:
    """8 N*m on a shaft without load that reaches 60 r/min: largest 5 ms mean of the angle error."""
    yield from rows_of(runner, "load-step")


@case("five-phase/tian-speed-reversal")
def speed_reversal(runner: Runner) -> Iterator[Row]:
    """Target from 60 r/min to -60 r/min at once, viscous load: largest 5 ms mean of the angle error."""
    yield from rows_of(runner, "speed-reversal")
