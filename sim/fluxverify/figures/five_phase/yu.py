# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Figures 9, 10, 13 and 14 of Yu 2022: separation of the HF current, angle sequences."""

from __future__ import annotations

import math
from collections.abc import Sequence as Many

import numpy as np
from matplotlib.axes import Axes

from fluxlock.config.injection import Sequence
from fluxlock.theory.six_step.plots import GREY, finish
from fluxverify.figures import panels
from fluxverify.figures.figure import Drawing, Entry, figure, near
from fluxverify.figures.five_phase.support import (
    BLUE,
    FAMILY,
    GREEN,
    ORANGE,
    SETTLING,
    Course,
    error,
    speeds,
    took_place,
)
from fluxverify.regression.five_phase.leakage import STEP_A, TS_S, Stepped
from fluxverify.regression.five_phase.leakage import stepped as id_stepped
from fluxverify.regression.five_phase.yu import SCENARIO, closed_form_rad, sequence_run
from fluxverify.regression.runner import RunFailed, Runner
from fluxverify.regression.six_step.measures import event, timeline

STEP_RPM, STEADY_RPM, QUICK_RPM = 50.0, 300.0, 600.0
START_S, END_S, OURS_END_S, QUICK_END_S = 0.01, 0.21, 0.4, 0.04
SEQUENCE_COLOURS: dict[Sequence, str] = {"held": ORANGE, "half-step": BLUE, "exact": GREEN}
NAMES = {"held": "held (before)", "half-step": "half-step (after)", "exact": "exact, ours"}
PRINTED = "Yu's machine, 350 V, 4 kHz double update, 60 V at 2 kHz"
# Of the paper's loop, 115 / 3306: both poles at 57.5 / s.
PRINTED_LOOP = ("drive.vector.pll_order=2", "drive.vector.pll_hz=22.7", "drive.vector.speed_hz=5")
SWINGS = 1.1  # of the speed asked for: what the first swing with the paper's loop exceeds
WHY_START = "The acceleration over 3306 / s² is most of it; the paper's speed rises more slowly"
WHY_MORE = "The paper says which of both is larger, without a number. The acceleration over 3306 / s² is most of it"
WHY_DEAD_TIME = "What the dead time leaves: without it both are within 0.002 of the closed form (yu.10)"
SETTLED_S = 0.02  # at the end of a start


def first_zero(run: Stepped) -> int:
    """Number of a sample, a little before the step, at a zero crossing of the HF current."""
    begin = run.step_sample - 12
    peaks, zeros = (float(np.abs(run.i_d_a[begin + k : run.step_sample : 2]).mean()) for k in (0, 1))
    return begin + int(zeros < peaks)


@figure(FAMILY, "yu.9")
def separation(runner: Runner) -> Drawing:
    """Step of the d current: HF current extracted, fundamental with and without injection."""
    run, without = id_stepped(runner), id_stepped(runner, 0.0)
    drawn, ((left, right),) = panels.page("yu.9: separation without a filter, step of i_d by 5 A", 1, 2, (10.0, 3.8))
    readings = 1e3 * 2 * TS_S * (np.arange(run.d_a.size) - run.step)
    left.plot(readings, 1e3 * (run.d_a - run.d_a[: run.step].mean()), ".-", color=BLUE, linewidth=0.8, label="d")
    left.plot(readings, 1e3 * (run.q_a - run.q_a[: run.step].mean()), ".-", color=ORANGE, linewidth=0.8, label="q")
    finish(left, "about ms after the step", "change of the HF amplitude / mA")
    panels.legend(left, 2)
    # Both runs have the same instants.
    begin, at = first_zero(run), run.time_s[run.step_sample]
    courses = [(1e3 * (part.time_s[begin::2] - at), part.i_d_a[begin::2]) for part in (run, without)]
    for (time_ms, values), colour, label in zip(courses, (BLUE, GREY), ("with injection", "without"), strict=True):
        right.plot(time_ms, values, ".-", color=colour, linewidth=0.8, label=label)
    finish(right, "ms after the step", "i_d at the zero crossings / A")
    right.set_xlim(-1.0, 8.0)
    panels.legend(right, 1, "lower right")
    end_a = float(courses[0][1][-5:].mean())
    count = min(values.size for _, values in courses)
    apart = float(np.abs(courses[0][1][:count] - courses[1][1][:count]).max())
    lines = (
        Entry(
            "largest change of the HF amplitude (mA)",
            "a few",
            f"{1e3 * run.leak_a():.1f}",
            "imposed",
            1e3 * run.leak_a() < 10.0,
            "Of it a step of the converter is 4.9 mA",
        ),
        Entry("HF amplitude on d (A)", "", f"{float(run.d_a[: run.step].mean()):.3f}", "imposed", None),
        Entry(
            "fundamental with and without injection, largest difference (A)",
            "very slight",
            f"{apart:.3f}",
            "imposed",
            apart < 0.01 * STEP_A,
        ),
        Entry("i_d at the end (A)", f"{STEP_A:g}", f"{end_a:.3f}", "imposed", near(STEP_A, end_a, 0.05)),
    )
    condition = (
        f"{PRINTED}, rotor held, no noise, no dead time. Left: what registers of the chip show, every result at least "
        "once; right: current of the machine at the chip's samples. Regulators of the chip: controller C, gain 0.3, "
        "every second sample."
    )
    return Drawing(condition, drawn, lines)


def start(runner: Runner, sequence: Sequence, dead_time_us: float, loop: Many[str]) -> Course:
    """Target of 50 r/min at once, no load; time since the step."""
    end_s = QUICK_END_S if runner.quick else END_S if loop else OURS_END_S
    events = [event(0.002, "speed_rpm", STEP_RPM), event(START_S, "command", "start")]
    overrides = [
        *timeline(end_s, events, [("steady", 0.8 * end_s, end_s)]),
        "expect=[]",
        *loop,
        "drive.accel_rpm_per_s=100000",
        f"inverter.dead_time_s={dead_time_us * 1e-6:g}",
        "initial.theta_deg=0",
        "drive.vector.injection.search=false",
        f"drive.vector.injection.sequence={sequence}",
    ]
    may = {"speed": SETTLING} | ({"lost_angle": "the printed loop lags behind the start"} if loop else {})
    name = f"start-{sequence}-{dead_time_us:g}us-{'printed' if loop else 'best'}"
    return Course.of(runner.drive(SCENARIO, name, *overrides, accept=may), START_S)


def draw_start(axes: Axes, speed: Axes, runner: Runner, dead_time_us: float, printed: Many[str]) -> list[Entry]:
    """Error and speed of the start with the paper's two sequences, and with our scheme."""
    cases: tuple[tuple[str, Sequence, Many[str]], ...] = (
        ("held (before)", "held", PRINTED_LOOP),
        ("half-step (after)", "half-step", PRINTED_LOOP),
        ("exact, loop of 90 Hz", "exact", ()),
    )
    lines, largest = [], []
    for (text, sequence, loop), word in zip(cases, (*printed, ""), strict=True):
        course = start(runner, sequence, dead_time_us, loop)
        end_s, colour = float(course.time_s[-1]), SEQUENCE_COLOURS[sequence]
        error(axes, course, 0.0, end_s, colour, text, radians=True)
        speeds(speed, course, 0.0, end_s, colour, text)
        top_rpm = float(course.true_rpm.max())
        if not runner.quick and not loop:
            took_place(course, f"start, {text}", STEP_RPM, end_s - SETTLED_S, end_s)
        elif not runner.quick and top_rpm < SWINGS * STEP_RPM:
            raise RunFailed(f"start, {text}: {top_rpm:.1f} r/min at most, though the speed is said to swing")
        largest.append(math.radians(course.largest(0.0, end_s)))
        found = f"{largest[-1]:.3f}, up to {top_rpm:.0f} r/min, {course.end}"
        if word == "less":
            agrees: bool | None = largest[1] < largest[0]
        else:
            agrees = None if word in ("", "more") else near(float(word), largest[-1], 0.0005)
        why = WHY_MORE if word in ("more", "less") else WHY_START
        lines.append(Entry(f"0 to 50 r/min, {text}: largest 5 ms mean (rad), speed", word, found, "drive", agrees, why))
    panels.title(axes, "0 to 50 r/min at once, no load; with the paper's loop the speed swings")
    for panel in (axes, speed):
        panel.set_xlim(0.0, END_S - START_S)
    panels.legend(axes, 1, "lower right")
    return lines


def draw_steady(axes: Axes, runner: Runner, dead_time_us: float, printed: Many[str]) -> list[Entry]:
    """Error at a steady speed with the three sequences."""
    rpm = QUICK_RPM if runner.quick else STEADY_RPM
    shown: tuple[Sequence, ...] = ("held", "half-step", "exact")
    lines = []
    for sequence, word in zip(shown, printed, strict=False):
        if runner.quick and sequence != "half-step":
            continue
        run = sequence_run(runner, sequence, rpm, dead_time_us)
        course, window = Course.of(run), run.scenario.window[0]
        part = course.within(window.from_s, window.to_s)
        time_ms, values = 1e3 * (course.time_s[part] - window.from_s), np.radians(course.error_deg[part])
        axes.plot(time_ms, values, color=SEQUENCE_COLOURS[sequence], linewidth=0.8, label=NAMES[sequence])
        form = closed_form_rad(run.scenario.motor, rpm, sequence)
        text = f"{rpm:g} r/min, {NAMES[sequence]}: mean, closed form (rad)"
        mean = float(values.mean())
        agrees = None
        if word:
            agrees = mean < 0 if word == "lags" else mean > 0 if word == "leads" else near(0.042, mean, 0.0005)
        why = WHY_DEAD_TIME if dead_time_us else ""
        lines.append(Entry(text, word, f"{mean:+.4f}, {form:+.4f}", "imposed", agrees, why))
    axes.axhline(0.0, color=GREY, linewidth=0.8)
    panels.title(axes, f"{rpm:g} r/min, no load")
    finish(axes, "time / ms", "θ̂ − θ / rad")
    low, high = axes.get_ylim()
    axes.set_ylim(bottom=low - 0.2 * (high - low))  # room for the legend
    panels.legend(axes, 3, "lower right")
    return lines


def condition_of(dead_time_us: float) -> str:
    """What holds for starts and steady speeds."""
    dead = f"dead time {dead_time_us:g} µs, compensated" if dead_time_us else "no dead time"
    return (
        f"{PRINTED}, {dead}, noise. Start: loop 115 / 3306, speed regulator 0.07 A s/rad; ours third order, 90 Hz. "
        "Steady: driven, machine without saturation, loop of 90 Hz, which does not change the mean."
    )


@figure(FAMILY, "yu.10")
def simulated_sequences(runner: Runner) -> Drawing:
    """Error before and after the optimized sequence, without dead time: start and steady speed."""
    drawn, (upper, lower) = panels.page("yu.10: angle sequences, no dead time", 2, 2, (10.0, 6.0))
    lines = draw_start(upper[0], upper[1], runner, 0.0, ("more", "less"))
    lines += draw_steady(lower[0], runner, 0.0, ("lags", "leads", ""))
    lower[1].set_visible(False)
    return Drawing(condition_of(0.0), drawn, tuple(lines))


@figure(FAMILY, "yu.13")
def measured_start(runner: Runner) -> Drawing:
    """Start to 50 r/min without load, with dead time: before and after the optimized sequence."""
    drawn, ((left, right),) = panels.page("yu.13: angle sequences, dead time 2 µs", 1, 2, (10.0, 3.8))
    lines = draw_start(left, right, runner, 2.0, ("0.204", "0.162"))
    return Drawing(condition_of(2.0), drawn, tuple(lines))


@figure(FAMILY, "yu.14")
def measured_steady(runner: Runner) -> Drawing:
    """Error at 300 r/min without load, with dead time: before and after the optimized sequence."""
    drawn, ((axes,),) = panels.page("yu.14: angle sequences, dead time 2 µs", 1, 1, (7.0, 3.8))
    lines = draw_steady(axes, runner, 2.0, ("lags", "+0.042 (−0.042 of θ − θ̂); formula 0.053"))
    return Drawing(condition_of(2.0), drawn, tuple(lines))
