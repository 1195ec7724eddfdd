# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The same injection on a salient machine of three phases."""

from __future__ import annotations

from collections.abc import Iterator

from fluxverify.regression.case import Row, case
from fluxverify.regression.five_phase.driven import angle_values, driven, largest_mean_deg
from fluxverify.regression.runner import Runner
from fluxverify.regression.six_step.measures import event, timeline

SCENARIO = "vector/ipm-injection.toml"
RATED_A, BEYOND_RPM = 10.0, 300.0
POINTS = ((400.0, RATED_A), (200.0, -RATED_A))
MEAN_DEG, RMS_DEG, PEAK_DEG = 0.5, 1.0, 5.0
TOP_RPM = 400.0
SETTLED_S, END_S = 0.17, 0.21
TORQUE_RPM = 200.0  # a twentieth of the speed
# Targets beyond the imposed speed that take i_q to its limit in 0.16 s, and from there to the other one in 0.2 s.
RISE_RPM, REVERSE_RPM = 500.0, -270.0
RISEN_S, SEEN_S = 0.23, 0.06


@case("five-phase/ipm-steady", long=True)
def steady(runner: Runner) -> Iterator[Row]:
    """Three-phase IPM with 300 ns of compensated dead time, driven at 0 to 10 % of its speed: no and rated torque."""
    for rpm, i_q_a in POINTS:
        if runner.quick and (rpm, i_q_a) != POINTS[0]:
            continue
        overrides = driven(rpm, i_q_a, SETTLED_S, END_S, beyond_rpm=BEYOND_RPM)
        run = runner.drive(SCENARIO, f"{rpm:g}-{i_q_a:g}", *overrides)
        yield Row(
            f"five-phase/ipm-steady/{rpm:g}rpm-{i_q_a:g}A",
            {"motor": "IPM", "speed_rpm": rpm, "iq_a": i_q_a, "dead_time_us": 0.3},
            angle_values(run),
            {
                "angle_error_deg.mean": (-MEAN_DEG, MEAN_DEG),
                "angle_error_deg.rms": (None, RMS_DEG),
                "trips": (0, 0),
            },
        )


@case("five-phase/ipm-reversal")
def reversal(runner: Runner) -> Iterator[Row]:
    """Three-phase IPM from an unknown rest to 10 % of its speed, reversed: largest angle error."""
    events = [
        event(0.002, "speed_rpm", TOP_RPM),
        event(0.004, "command", "start"),
        event(0.18, "command", f"set speed_rpm {-TOP_RPM:g}"),
    ]
    end_s = 0.22 if runner.quick else 0.42
    run = runner.drive(SCENARIO, "run", *timeline(end_s, events, [("steady", 0.06, end_s)]), "expect=[]")
    yield Row(
        "five-phase/ipm-reversal",
        {"motor": "IPM", "speed_rpm": TOP_RPM, "accel_rpm_per_s": run.scenario.accel_rpm_per_s, "dead_time_us": 0.3},
        angle_values(run),
        {"angle_error_deg.max": (None, PEAK_DEG), "trips": (0, 0)},
    )


@case("five-phase/ipm-torque")
def torque(runner: Runner) -> Iterator[Row]:
    """Three-phase IPM driven at 5 % of its speed: rated torque, then its reversal in 0.2 s: largest 5 ms mean."""
    end_s = RISEN_S if runner.quick else 0.46
    overrides = driven(TORQUE_RPM, RATED_A, SEEN_S, end_s)
    events = [event(0.002, "command", f"set speed_rpm {RISE_RPM:g}"), event(0.004, "command", "start")]
    if not runner.quick:
        events.append(event(RISEN_S, "command", f"set speed_rpm {REVERSE_RPM:g}"))
    overrides = [*overrides, *timeline(end_s, events, [("steady", SEEN_S, end_s)])]
    run = runner.drive(SCENARIO, "run", *overrides)
    yield Row(
        "five-phase/ipm-torque",
        {"motor": "IPM", "speed_rpm": TORQUE_RPM, "iq_a": RATED_A, "dead_time_us": 0.3},
        {"largest_5ms_mean_deg": largest_mean_deg(run, SEEN_S), **angle_values(run)},
        {"largest_5ms_mean_deg": (None, PEAK_DEG), "trips": (0, 0)},
    )
