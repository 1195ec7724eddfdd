"""Machine of Yu 2022, filterless separation, exact angle sequence: angle error while the speed changes."""

from __future__ import annotations

import math
from collections.abc import Iterator

from fluxlock.regression.case import Number, Row, case
from fluxlock.regression.five_phase.driven import angle_values, largest_mean_deg
from fluxlock.regression.five_phase.yu import SCENARIO
from fluxlock.regression.runner import Runner
from fluxlock.regression.six_step.measures import event, timeline

LARGEST_RAD = 0.07
DEAD_TIMES_US = (0.0, 2.0)
SEARCHED_S = 0.06  # the position at rest is known, the angle has settled
STEP_S = 0.075
CREEP_RPM, STEP_RPM = 1.0, 50.0
AT_ONCE = 100_000.0  # r/min/s


@case("five-phase/yu-start")
def start(runner: Runner) -> Iterator[Row]:
    """Step to 50 r/min without load after the search at rest: largest 5 ms mean; short: 2 us of dead time alone."""
    end_s = 0.13 if runner.quick else 0.2
    events = [
        event(0.002, "speed_rpm", CREEP_RPM),
        event(0.004, "command", "start"),
        event(STEP_S, "command", f"set speed_rpm {STEP_RPM:g}"),
    ]
    for dead_time_us in DEAD_TIMES_US[-1:] if runner.quick else DEAD_TIMES_US:
        run = runner.drive(
            SCENARIO,
            f"start-{dead_time_us:g}us",
            *timeline(end_s, events, [("steady", SEARCHED_S, end_s)]),
            "expect=[]",
            f"drive.accel_rpm_per_s={AT_ONCE:g}",
            f"inverter.dead_time_s={dead_time_us * 1e-6:g}",
        )
        largest = largest_mean_deg(run, SEARCHED_S)
        values: dict[str, Number] = {
            "largest_5ms_mean_rad": None if largest is None else math.radians(largest),
            **angle_values(run),
        }
        for kind in ("max", "min"):
            values[f"speed_rpm.{kind}"] = run.metrics["steady"]["speed_rpm"][kind]
        yield Row(
            f"five-phase/yu-start/{dead_time_us:g}us",
            {"motor": "Yu", "dead_time_us": dead_time_us, "brake_nm": 0.0},
            values,
            {"largest_5ms_mean_rad": (None, LARGEST_RAD), "trips": (0, 0)},
        )
