"""Machine of Tian 2019, I/Q demodulation, exact angle sequence: angle error while the torque steps."""

from __future__ import annotations

from collections.abc import Iterator

from fluxlock.regression.case import Row, case
from fluxlock.regression.five_phase.driven import angle_values, largest_mean_deg
from fluxlock.regression.five_phase.tian import AT_THE_LIMIT, SCENARIO
from fluxlock.regression.runner import Runner
from fluxlock.regression.six_step.measures import event, timeline

LARGEST_DEG = 5.0
DEAD_TIMES_US = (0.0, 2.0)
AT_ONCE = 100_000.0  # r/min/s
BEFORE_S = 0.02  # of the window, before the step


def run_event(runner: Runner, name: str, dead_time_us: float, at_s: float, overrides: list[str]) -> Row:
    """Row of a run with a step at at_s."""
    used = [*overrides, "expect=[]", f"inverter.dead_time_s={dead_time_us * 1e-6:g}"]
    run = runner.drive(SCENARIO, f"{name}-{dead_time_us:g}us", *used)
    return Row(
        f"five-phase/tian-{name}/{dead_time_us:g}us",
        {"motor": "Tian", "dead_time_us": dead_time_us},
        {"largest_5ms_mean_deg": largest_mean_deg(run, at_s - BEFORE_S), **angle_values(run)},
        {"largest_5ms_mean_deg": (None, LARGEST_DEG), "trips": (0, 0)},
    )


@case("five-phase/tian-torque-reversal")
def torque_reversal(runner: Runner) -> Iterator[Row]:
    """Free rotor, from 2 A to -2 A: largest 5 ms mean of the angle error."""
    at_s, end_s = (0.07, 0.12) if runner.quick else (0.09, 0.17)
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
    for dead_time_us in DEAD_TIMES_US[:1] if runner.quick else DEAD_TIMES_US:
        yield run_event(runner, "torque-reversal", dead_time_us, at_s, overrides)
