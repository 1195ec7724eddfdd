"""Figures 10 to 12 of Tian 2019: torque reversal, load step, speed reversal by the printed methods and our best one."""

from __future__ import annotations

from fluxlock.figures import panels
from fluxlock.figures.figure import Drawing, Entry, figure
from fluxlock.figures.five_phase.support import FAMILY, METHOD_COLOURS, Course, angles, error, speeds
from fluxlock.figures.five_phase.tian import PRINTED
from fluxlock.regression.five_phase import tian_printed
from fluxlock.regression.five_phase.tian_events import LOAD_NM, SPEED_RPM, stepped
from fluxlock.regression.runner import Runner
from fluxlock.regression.six_step.measures import event, timeline

AT_S, END_S = 0.24, 0.32  # of the printed methods' step
QUICK_AT_S, QUICK_END_S = 0.15, 0.19
BEFORE_S = 0.02
AT_ONCE = 100_000.0  # r/min/s
RAMP = 300.0  # r/min/s, which their loops follow
BEST = (
    "best: I/Q demodulation, 90 V at 644 Hz, exact sequence, loop of 50 Hz, steps sooner after the start; speed loop "
    "6 Hz at the reversal"
)


def printed_step(runner: Runner, name: str, method: str) -> Course:
    """A printed method through the step; time since it."""
    at_s, end_s = (QUICK_AT_S, QUICK_END_S) if runner.quick else (AT_S, END_S)
    start = [event(0.002, "speed_rpm", SPEED_RPM), event(0.004, "command", "start")]
    keys = ["expect=[]", *tian_printed.printed(method), "initial.theta_deg=0", f"drive.accel_rpm_per_s={RAMP:g}"]
    if name == "torque-reversal":
        start[0] = event(0.002, "speed_rpm", tian_printed.TOP_RPM)
        start.append(event(at_s, "command", f"set speed_rpm {-tian_printed.TOP_RPM:g}"))
        keys += ["drive.current_limit_a=2", f"drive.accel_rpm_per_s={AT_ONCE:g}"]
    elif name == "load-step":
        start = [event(0.0, "load_factor", 0.0), *start, event(at_s, "load_factor", 1.0)]
        keys += [f"load.constant_nm={LOAD_NM:g}"]
    else:
        start.append(event(at_s - 0.001, "accel_rpm_per_s", AT_ONCE))
        start.append(event(at_s, "command", f"set speed_rpm {-SPEED_RPM:g}"))
    course = timeline(end_s, start, [("steady", at_s - BEFORE_S, end_s)])
    return Course.of(runner.drive(tian_printed.SCENARIO, f"{name}-{method}", *course, *keys), at_s)


def draw_step(runner: Runner, number: str, name: str, text: str, printed: dict[str, str], why: str) -> Drawing:
    """Angles, errors and speeds of the three methods through a step."""
    run, at_s = stepped(runner, name, 0.0)
    courses = {method: printed_step(runner, name, method) for method in tian_printed.METHODS}
    courses["best"] = Course.of(run, at_s)
    drawn, grid = panels.page(f"{number}: {text}", 2, 2, (10.0, 5.6))
    lines = []
    shown = (QUICK_END_S - QUICK_AT_S) if runner.quick else (END_S - AT_S)
    for method, course in courses.items():
        error(grid[1][0], course, -BEFORE_S, shown, METHOD_COLOURS[method], method)
        speeds(grid[1][1], course, -BEFORE_S, shown, METHOD_COLOURS[method], method)
        end_s = min(float(course.time_s[-1]), shown)
        found = f"{course.largest(-BEFORE_S, end_s):.1f}, {course.end}"
        lines.append(Entry(f"{method}: largest 5 ms mean (deg)", printed.get(method, ""), found, why))
        steady = course.mean(-BEFORE_S, 0.0)
        lines.append(Entry(f"{method}: mean before the step (deg)", "", f"{steady:.1f}"))
    for column, method in enumerate(tian_printed.METHODS):
        angles(grid[0][column], courses[method], -BEFORE_S, shown, METHOD_COLOURS[method])
        panels.title(grid[0][column], f"{method}; {courses[method].end}")
    panels.legend(grid[1][0])
    return Drawing(f"{PRINTED}; speed loop 3.9 Hz. {BEST}. Time 0: the step.", drawn, tuple(lines))


@figure(FAMILY, "tian.10")
def torque_reversal(runner: Runner) -> Drawing:
    """Reversal of the torque from 2 A to -2 A."""
    printed = {"conventional": "35", "lock-in": "much smaller"}
    why = "The acceleration of a second-order loop, 1600 / s², adds to the steady error"
    return draw_step(runner, "tian.10", "torque-reversal", "torque from 2 A to −2 A", printed, why)


@figure(FAMILY, "tian.11")
def load_step(runner: Runner) -> Drawing:
    """Load step of 8 N*m at 60 r/min."""
    printed = {"conventional": "rough, 0.75 s to settle", "lock-in": "smooth, 0.75 s to settle"}
    return draw_step(
        runner, "tian.11", "load-step", "8 N·m at 60 r/min", printed, "The paper prints no angle error here"
    )


@figure(FAMILY, "tian.12")
def speed_reversal(runner: Runner) -> Drawing:
    """Reversal of the speed target from 60 r/min."""
    printed = {"conventional": "estimate leaves the speed, 0.5 s", "lock-in": "smooth, 0.5 s"}
    text = "speed from 60 to −60 r/min"
    return draw_step(runner, "tian.12", "speed-reversal", text, printed, "The paper prints no angle error here")
