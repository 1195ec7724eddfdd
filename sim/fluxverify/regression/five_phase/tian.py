# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Machine of Tian 2019: angle error of I/Q demodulation with the exact angle sequence."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fluxlock.cosim.outcome import Run
from fluxlock.results.rundata import LogKind
from fluxverify.regression.case import Row, case
from fluxverify.regression.five_phase.driven import angle_values, driven
from fluxverify.regression.runner import Runner
from fluxverify.regression.six_step.measures import event, timeline

SCENARIO = "five-phase/tian.toml"
POINTS = ((100.0, 2.0), (0.0, 2.0), (10.0, 2.0), (25.0, 2.0), (50.0, 0.0), (75.0, 2.0))  # r/min, A
# r/min, A, angle at the start: at standstill what the dead time leaves depends on it.
COMPENSATED_POINTS = (
    (100.0, 2.0, 10.0),
    (0.0, 0.3, 10.0),
    (0.0, 0.3, 4.0),
    (0.0, 2.0, 10.0),
    (0.0, 0.0, 10.0),
    (50.0, 0.0, 10.0),
    (5.0, 2.0, 10.0),
)
MEAN_DEG, RMS_DEG, COMPENSATED_DEG = 0.3, 0.5, 1.0
SETTLED_S, END_S = 0.19, 0.25
BEYOND_RPM = 30.0
# The speed regulator asks for the whole current all the time.
AT_THE_LIMIT = (
    "motor.max_speed_rpm=150",
    "motor.load.viscous_nm_s_per_rad=0",
    "drive.vector.speed_hz=8",
)
WITHIN_DEG, SETTLED_MOST_S = 5.0, 0.06


def best_run(runner: Runner, rpm: float, i_q_a: float) -> Run:
    """Driven at a speed, without dead time."""
    overrides = [*driven(rpm, i_q_a, SETTLED_S, END_S, beyond_rpm=BEYOND_RPM), *AT_THE_LIMIT, "inverter.dead_time_s=0"]
    return runner.drive(SCENARIO, f"{rpm:g}-{i_q_a:g}", *overrides)


@case("five-phase/tian-best", long=True)
def best(runner: Runner) -> Iterator[Row]:
    """Driven shaft, without dead time: mean and rms of the angle error from an estimate that is 10 degrees off."""
    for rpm, i_q_a in POINTS:
        if runner.quick and (rpm, i_q_a) != POINTS[0]:
            continue
        run = best_run(runner, rpm, i_q_a)
        yield Row(
            f"five-phase/tian-best/{rpm:g}rpm-{i_q_a:g}A",
            {"motor": "Tian", "speed_rpm": rpm, "iq_a": i_q_a, "dead_time_us": 0.0},
            angle_values(run),
            {
                "angle_error_deg.mean": (-MEAN_DEG, MEAN_DEG),
                "angle_error_deg.rms": (None, RMS_DEG),
                "trips": (0, 0),
            },
        )


@case("five-phase/tian-dead-time", long=True)
def dead_time(runner: Runner) -> Iterator[Row]:
    """Driven shaft, 2 us of compensated dead time: mean of the angle error."""
    for rpm, i_q_a, theta_deg in COMPENSATED_POINTS:
        if runner.quick and (rpm, i_q_a) != COMPENSATED_POINTS[0][:2]:
            continue
        overrides = [
            *driven(rpm, i_q_a, SETTLED_S, END_S, beyond_rpm=BEYOND_RPM),
            *AT_THE_LIMIT,
            f"initial.theta_deg={theta_deg:g}",
        ]
        name = f"{rpm:g}rpm-{i_q_a:g}A" + (f"-{theta_deg:g}deg" if rpm == 0.0 else "")
        run = runner.drive(SCENARIO, name, *overrides)
        yield Row(
            f"five-phase/tian-dead-time/{name}",
            {"motor": "Tian", "speed_rpm": rpm, "iq_a": i_q_a, "theta_deg": theta_deg, "dead_time_us": 2.0},
            angle_values(run),
            {"angle_error_deg.mean": (-COMPENSATED_DEG, COMPENSATED_DEG), "trips": (0, 0)},
        )


def settled_s(run: Run) -> float:
    """From the gates' first edge until the angle error stays within the limit."""
    gates = run.data.rows(LogKind.GATES)
    begin = float(gates[gates[:, 2] != 0, 0][0])
    angles = run.analysis.angles
    return float(angles.cycle[np.abs(angles.error_deg) > WITHIN_DEG][-1] - begin) / run.data.clock_hz


def start_run(runner: Runner, theta_deg: float, dead_time_us: float = 0.0) -> Run:
    """Free rotor at an angle that the estimate takes for 0, 2 A at once."""
    events = [event(0.002, "speed_rpm", 130.0), event(0.004, "command", "start")]
    overrides = [
        *timeline(0.12, events, [("steady", 0.08, 0.12)]),
        "expect=[]",
        *AT_THE_LIMIT,
        f"inverter.dead_time_s={dead_time_us * 1e-6:g}",
        f"initial.theta_deg={theta_deg:g}",
        "drive.current_limit_a=2.0",
        "drive.accel_rpm_per_s=100000",
    ]
    return runner.drive(SCENARIO, f"{theta_deg:g}" + (f"-{dead_time_us:g}us" if dead_time_us else ""), *overrides)


@case("five-phase/tian-start")
def start(runner: Runner) -> Iterator[Row]:
    """Free rotor, 2 A at once while the estimate is 30 degrees off: time until it is right."""
    for theta_deg, dead_time_us in ((30.0, 0.0), (-30.0, 0.0), (30.0, 2.0), (-30.0, 2.0)):
        if runner.quick and (theta_deg, dead_time_us) != (30.0, 0.0):
            continue
        run = start_run(runner, theta_deg, dead_time_us)
        yield Row(
            f"five-phase/tian-start/{-theta_deg:g}deg" + (f"-{dead_time_us:g}us" if dead_time_us else ""),
            {"motor": "Tian", "error_deg": -theta_deg, "iq_a": 2.0, "dead_time_us": dead_time_us},
            {"settled_s": settled_s(run), **angle_values(run)},
            {"settled_s": (None, SETTLED_MOST_S), "trips": (0, 0)},
        )
