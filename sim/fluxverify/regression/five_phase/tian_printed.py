# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Machine of Tian 2019 with the demodulators as printed: steady error over speed, start from 30 degrees."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fluxlock.cosim.outcome import Run
from fluxlock.results.rundata import FloatArray
from fluxlock.theory.injection.plots import running_mean
from fluxverify.regression.case import Number, Row, case
from fluxverify.regression.five_phase.driven import angle_values, driven
from fluxverify.regression.five_phase.tian import WITHIN_DEG
from fluxverify.regression.runner import Runner
from fluxverify.regression.six_step.measures import event, timeline

SCENARIO = "five-phase/tian-printed.toml"
METHODS = ("conventional", "lock-in")
SPEEDS_RPM = (0.0, 10.0, 25.0, 50.0, 85.0, 100.0)
I_Q_A, LEAST_SHARE = 2.0, 0.8
AT_SPEED_S, SETTLED_S, END_S = 0.2, 0.6, 0.65
QUICK_RPM, QUICK_AT_SPEED_S, QUICK_SETTLED_S, QUICK_END_S = 50.0, 0.15, 0.27, 0.29
BEYOND_RPM = 100.0
TOP_RPM = 84.0  # where the load takes 2 A
START_S, START_END_S, START_QUICK_S = 0.004, 0.4, 0.12
MEAN_S, STAYS_S = 5e-3, 0.05


def printed(method: str) -> list[str]:
    """Keys of a printed demodulator."""
    return [
        f"drive.vector.injection.method={method}",
        "motor.max_speed_rpm=250",
        "inverter.dead_time_s=0",
    ]


def steady_run(runner: Runner, method: str, rpm: float) -> Run:
    """Driven at a speed with 2 A until the error is steady."""
    full, short = (AT_SPEED_S, SETTLED_S, END_S), (QUICK_AT_SPEED_S, QUICK_SETTLED_S, QUICK_END_S)
    at_speed, settled, end = short if runner.quick else full
    overrides = [
        *driven(rpm, I_Q_A, settled, end, beyond_rpm=BEYOND_RPM, at_speed_s=at_speed),
        *printed(method),
        "initial.theta_deg=0",
    ]
    return runner.drive(SCENARIO, f"{method}-{rpm:g}", *overrides)


@case("five-phase/tian-printed", long=True)
def curves(runner: Runner) -> Iterator[Row]:
    """Conventional and lock-in demodulation as printed, driven at 0 to 100 r/min: mean error of both."""
    for rpm in (QUICK_RPM,) if runner.quick else SPEEDS_RPM:
        values: dict[str, Number] = {}
        size = {}
        for method in METHODS:
            found = angle_values(steady_run(runner, method, rpm))
            mean = found["angle_error_deg.mean"]
            size[method] = abs(mean) if mean is not None else 0.0
            values |= {f"{method}.{name}": value for name, value in found.items()}
        values["lock_in_over_conventional"] = size["lock-in"] / size["conventional"] if size["conventional"] else None
        limits: dict[str, tuple[float | None, float | None]] = {}
        for method in METHODS:
            limits |= {f"{method}.trips": (0, 0), f"{method}.iq_a": (LEAST_SHARE * I_Q_A, None)}
        yield Row(
            f"five-phase/tian-printed/{rpm:g}rpm",
            {"motor": "Tian", "speed_rpm": rpm, "iq_a": I_Q_A, "dead_time_us": 0.0},
            values,
            {"lock_in_over_conventional": (None, 1.0), **limits},
            "the paper's part at standstill, 12 and 8.2 degrees, is not in this machine: docs/theory/five-phase.md",
        )


def start_run(runner: Runner, method: str) -> Run:
    """Free rotor, 2 A at once while the estimate is 30 degrees behind; the load ends at 85 r/min."""
    end_s = START_QUICK_S if runner.quick else START_END_S
    events = [event(0.002, "speed_rpm", TOP_RPM), event(START_S, "command", "start")]
    overrides = [
        *timeline(end_s, events, [("steady", end_s - 0.03, end_s)]),
        "expect=[]",
        *printed(method),
        "initial.theta_deg=30",
        f"drive.current_limit_a={I_Q_A:g}",
        "drive.accel_rpm_per_s=100000",
    ]
    return runner.drive(SCENARIO, f"start-{method}", *overrides)


def course_deg(run: Run) -> tuple[FloatArray, FloatArray]:
    """Time since the start command (s), 5 ms mean of the angle error up to it (deg)."""
    angles = run.analysis.angles
    time_s = angles.cycle / run.data.clock_hz - START_S
    count = round(MEAN_S / float(np.median(np.diff(time_s))))
    return time_s, running_mean(angles.error_deg, count)


def within_s(run: Run) -> tuple[Number, Number]:
    """From the start command until the mean error is within the limit for the first time, and for good."""
    time_s, error_deg = course_deg(run)
    inside = np.flatnonzero((np.abs(error_deg) <= WITHIN_DEG) & (time_s > MEAN_S))
    outside = np.flatnonzero(np.abs(error_deg) > WITHIN_DEG)
    good = None if outside.size and time_s[outside[-1]] > time_s[-1] - STAYS_S else float(time_s[outside[-1]])
    return (float(time_s[inside[0]]) if inside.size else None), good


@case("five-phase/tian-printed-start", long=True)
def start(runner: Runner) -> Iterator[Row]:
    """From 30 degrees off at 2 A, conventional and lock-in as printed: until within 5 degrees, and how it ends."""
    values: dict[str, Number] = {}
    limits: dict[str, tuple[float | None, float | None]] = {}
    ends: list[float] = []
    for method in METHODS:
        run = start_run(runner, method)
        first, good = within_s(run)
        values |= {f"{method}.first_within_s": first, f"{method}.within_for_good_s": good}
        ends.append(run.metrics["steady"]["angle_error_deg"]["mean"])
        values[f"{method}.end_deg"] = ends[-1]
        values[f"{method}.trips"] = len(run.result["trips"])
        limits[f"{method}.trips"] = (0, 0)
    values["lock_in_over_conventional_end"] = abs(ends[1] / ends[0])
    yield Row(
        "five-phase/tian-printed-start",
        {"motor": "Tian", "error_deg": -30.0, "iq_a": I_Q_A, "dead_time_us": 0.0},
        values,
        {"lock_in_over_conventional_end": (None, 1.0), **limits},
        "within 5 degrees for good: no value if never; five-phase/tian-start has our best scheme",
    )
