# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Figures 10 to 12 of Tian 2019: torque reversal, load step, speed reversal by the printed methods and our best one.

Every method goes through the same events on the same load, from one settled state to the next. A drawing fails unless
the event took place: the speed was settled before it, changed as it had to, and was settled again. FAILS names the
methods that cannot do it; a drawing fails as well if one of them can.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fluxlock.cosim.outcome import Run
from fluxverify.figures import panels
from fluxverify.figures.figure import Drawing, Entry, figure, near
from fluxverify.figures.five_phase.support import (
    FAMILY,
    METHOD_COLOURS,
    RPM,
    SETTLING,
    Course,
    angles,
    error,
    seconds,
    speeds,
)
from fluxverify.figures.five_phase.tian import PRINTED
from fluxverify.regression.five_phase import tian, tian_printed
from fluxverify.regression.five_phase.tian_events import LOAD_NM, SPEED_RPM
from fluxverify.regression.runner import RunFailed, Runner
from fluxverify.regression.six_step.measures import event, timeline

AT_S, QUICK_AT_S, QUICK_END_S = 1.2, 0.15, 0.19
SETTLED_S = 0.05  # mean of the speed before the step and at the end
SETTLED = 0.05  # of the speed asked for: what a settled speed may be off
BEFORE_S = 0.1  # shown
BEYOND_RPM, LIMIT_A = 120.0, 2.0
AT_ONCE = 100_000.0  # r/min/s
RAMP = 300.0  # r/min/s, which the printed methods' loops follow
INERTIA_KGM2 = 0.12
TIMES = {"torque-reversal": "0.25 s", "load-step": "0.75 s", "speed-reversal": "0.5 s"}
WHY_TIME = "The paper does not say what counts as settled, and prints neither the speed regulator nor the friction"
LEAVES = "the paper's own methods: their estimate may leave the speed meanwhile; the angle is checked before and after"
LOST_DEG = 90.0  # from here on the estimate pulls the other way
BEST = (
    "Best: I/Q demodulation, 90 V at 644 Hz, exact sequence, loop of 50 Hz. Events, load and speed loop are the same "
    "for all: the paper prints neither; with a faster loop the conventional method's speed swings"
)


@dataclass(frozen=True)
class Event:
    """A step: its length after AT_S (s), speed before and after (r/min), speed loop (Hz), friction (N m s)."""

    name: str
    after_s: float
    from_rpm: float
    to_rpm: float
    speed_hz: float
    viscous: float

    def course(self, quick: bool) -> list[str]:
        """Overrides of the run."""
        at_s, end_s = (QUICK_AT_S, QUICK_END_S) if quick else (AT_S, AT_S + self.after_s)
        events = [event(0.002, "speed_rpm", self.from_rpm), event(0.004, "command", "start")]
        keys = [
            f"drive.vector.speed_hz={self.speed_hz:g}",
            f"motor.load.viscous_nm_s_per_rad={self.viscous:g}",
            "motor.max_speed_rpm=250",
        ]
        if self.name == "torque-reversal":
            # The speed asked for is out of reach with 2 A: the drive gives the limit, the load decides on the speed.
            events = [
                event(0.002, "speed_rpm", BEYOND_RPM),
                event(0.003, "command", f"set current_limit_a {LIMIT_A:g}"),
            ]
            events += [event(0.004, "command", "start"), event(at_s, "command", f"set speed_rpm {-BEYOND_RPM:g}")]
            keys.append(f"drive.accel_rpm_per_s={AT_ONCE:g}")
        else:
            keys.append(f"drive.accel_rpm_per_s={RAMP:g}")
        if self.name == "load-step":
            events = [event(0.0, "load_factor", 0.0), *events, event(at_s, "load_factor", 1.0)]
            keys.append(f"load.constant_nm={LOAD_NM:g}")
        if self.name == "speed-reversal":
            events.append(event(at_s - 0.001, "accel_rpm_per_s", AT_ONCE))
            events.append(event(at_s, "command", f"set speed_rpm {self.to_rpm:g}"))
        return [*timeline(end_s, events, [("steady", at_s - SETTLED_S, at_s)]), "expect=[]", *keys]


TORQUE = Event("torque-reversal", 0.5, 85.0, -85.0, 3.9, 1.2)
LOAD = Event("load-step", 1.2, SPEED_RPM, SPEED_RPM, 1.8, 0.0)
SPEED = Event("speed-reversal", 1.4, SPEED_RPM, -SPEED_RPM, 1.5, 0.3)


def run_of(runner: Runner, what: Event, method: str) -> Run:
    """A method through a step."""
    keys = what.course(runner.quick)
    own = ["inverter.dead_time_s=0"] if method == "best" else [*tian_printed.printed(method), "initial.theta_deg=0"]
    scenario = tian.SCENARIO if method == "best" else tian_printed.SCENARIO
    stated = FAILS.get((what.name, method))
    may = {"speed": SETTLING} | ({} if method == "best" else {"lost_angle": stated or LEAVES})
    return runner.drive(scenario, f"{what.name}-{method}", *keys, *own, accept=may)


# Methods that cannot go through a step, and what becomes of them: stated in the figure's title, and checked.
FAILS: dict[tuple[str, str], str] = {
    ("speed-reversal", "conventional"): "loses the angle and has not settled at the end"
}


def settled(course: Course, what: Event, from_s: float, to_s: float, rpm: float) -> str:
    """Why a span is not a settled state at a speed; empty if it is."""
    part = course.within(from_s, to_s)
    mean = float(course.true_rpm[part].mean())
    if what.name == "torque-reversal":
        # The torque is what is asked for: the speed is where the load takes it, and stays there.
        first, last = np.array_split(course.true_rpm[part], 2)
        if np.sign(mean) != np.sign(rpm) or abs(last.mean() - first.mean()) > SETTLED * abs(rpm):
            return f"{first.mean():.1f} to {last.mean():.1f} r/min"
    elif abs(mean - rpm) > SETTLED * abs(rpm):
        return f"{mean:.1f} r/min instead of {rpm:g}"
    largest = float(np.abs(course.mean_deg[part]).max())
    return f"angle off by {largest:.0f} deg" if largest > LOST_DEG else ""


def moved(course: Course, what: Event) -> str:
    """Why a step did not act on the shaft; empty if it did: the sign of the speed changes, or the load brakes it."""
    after = course.true_rpm[course.within(0.0, what.after_s)]
    if what.to_rpm != what.from_rpm:
        return (
            ""
            if after.min() < 0.0 < after.max()
            else f"the speed stayed between {after.min():.1f} and {after.max():.1f}"
        )
    before = float(course.true_rpm[course.within(-SETTLED_S, 0.0)].mean())
    dip = before - float(after.min())
    # In the time in which the speed loop does nothing yet.
    least = 0.25 * LOAD_NM / INERTIA_KGM2 * RPM / (2 * np.pi * what.speed_hz)
    return "" if dip > least else f"the load took {dip:.1f} r/min off the speed, {least:.1f} are the least"


def outcome(course: Course, what: Event, method: str) -> str:
    """What became of a method, in words; RunFailed unless it is what FAILS says, nothing for the others."""
    end_s = float(course.time_s[-1])
    before = settled(course, what, -SETTLED_S, 0.0, what.from_rpm)
    step = before or moved(course, what)
    after = step or settled(course, what, end_s - SETTLED_S, end_s, what.to_rpm)
    where = "before the step" if before else "at the step" if step else "at the end"
    stated = FAILS.get((what.name, method), "")
    if bool(after) != bool(stated):
        found = f"not settled {where}: {after}" if after else f"settled, though it is said to fail: {stated}"
        raise RunFailed(f"{what.name}, {method}: {found}; {course.end}")
    return stated


def draw_step(runner: Runner, number: str, what: Event, text: str, printed: dict[str, str], why: str) -> Drawing:
    """Angles, errors and speeds of the three methods through a step."""
    methods = (*tian_printed.METHODS, "best")
    courses = {
        method: Course.of(run_of(runner, what, method), QUICK_AT_S if runner.quick else AT_S) for method in methods
    }
    fate = {method: "" if runner.quick else outcome(course, what, method) for method, course in courses.items()}
    failing = "".join(f"; {method} {words}" for method, words in fate.items() if words)
    drawn, grid = panels.page(f"{number}: {text}{failing}", 2, 3, (13.0, 5.6))
    lines = []
    shown = (QUICK_END_S - QUICK_AT_S) if runner.quick else what.after_s
    before_s = 0.02 if runner.quick else BEFORE_S
    for method, course in courses.items():
        error(grid[1][0], course, -before_s, shown, METHOD_COLOURS[method], method)
        speeds(grid[1][1], course, -before_s, shown, METHOD_COLOURS[method], method)
        end_s = min(float(course.time_s[-1]), shown)
        found = f"{course.largest(-before_s, end_s):.1f}, {course.end}"
        stated = printed.get(method, "")
        agrees = None if not stated or not stated.isdigit() else near(float(stated), course.largest(0.0, end_s), 2.5)
        reason = "; ".join(part for part in (f"It {fate[method]}" if fate[method] else "", why) if part)
        lines.append(
            Entry(f"{method}: largest 5 ms mean (deg)", stated, found, "drive", agrees, reason if stated else "")
        )
        ends = f"{course.mean(-SETTLED_S, 0.0):.1f}, {course.mean(end_s - SETTLED_S, end_s):.1f}"
        lines.append(Entry(f"{method}: mean error before the step, at the end (deg)", "", ends, "drive", None))
        rpm = [
            float(course.true_rpm[course.within(*span)].mean())
            for span in ((-SETTLED_S, 0.0), (end_s - SETTLED_S, end_s))
        ]
        text_rpm = f"{rpm[0]:.1f}, {rpm[1]:.1f}; {seconds(_settles_s(course, rpm[1]))}"
        quantity = f"{method}: true speed before, at the end (r/min); within 5 % of that after"
        lines.append(Entry(quantity, TIMES[what.name], text_rpm, "drive", None, WHY_TIME))
    for column, method in enumerate(methods):
        angles(grid[0][column], courses[method], -before_s, shown, METHOD_COLOURS[method])
        panels.title(grid[0][column], f"{method}; {fate[method] or courses[method].end}")
    grid[1][2].set_visible(False)
    panels.legend(grid[1][0])
    regulator = f"Speed loop of {what.speed_hz:g} Hz, friction {what.viscous:g} N·m·s"
    return Drawing(f"{PRINTED}. {regulator}. {BEST}. Time 0: the step.", drawn, tuple(lines))


def _settles_s(course: Course, rpm: float) -> float | None:
    """Time after the step from which the true speed stays within 5 % of its last value; None if only at the end."""
    after = course.within(0.0, float(course.time_s[-1]))
    outside = np.flatnonzero(np.abs(course.true_rpm[after] - rpm) > SETTLED * abs(rpm))
    time_s = course.time_s[after]
    if not outside.size:
        return 0.0
    return float(time_s[outside[-1]]) if time_s[-1] - time_s[outside[-1]] > SETTLED_S else None


@figure(FAMILY, "tian.10")
def torque_reversal(runner: Runner) -> Drawing:
    """Reversal of the torque from 2 A to -2 A."""
    printed = {"conventional": "35", "lock-in": "much smaller"}
    why = "The acceleration of a second-order loop, 1600 / s², adds to the steady error; the paper prints no gains"
    return draw_step(runner, "tian.10", TORQUE, "torque from 2 A to −2 A", printed, why)


@figure(FAMILY, "tian.11")
def load_step(runner: Runner) -> Drawing:
    """Load step of 8 N*m at 60 r/min."""
    printed = {"conventional": "rough", "lock-in": "smooth"}
    return draw_step(runner, "tian.11", LOAD, "8 N·m at 60 r/min", printed, "The paper prints no angle error here")


@figure(FAMILY, "tian.12")
def speed_reversal(runner: Runner) -> Drawing:
    """Reversal of the speed target from 60 r/min."""
    printed = {"conventional": "estimate leaves the speed", "lock-in": "smooth"}
    text = "speed from 60 to −60 r/min"
    return draw_step(runner, "tian.12", SPEED, text, printed, "The paper prints no angle error here")
