# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Chapter 3: divider gains, unequal phases, correction B."""

from __future__ import annotations

import re

import numpy as np

from fluxlock.config import load_motor
from fluxlock.config.motor import RPM_PER_RAD_S
from fluxlock.cosim.outcome import Run
from fluxlock.results.metrics import Series
from fluxlock.results.plots import PHASE_COLOURS
from fluxlock.results.rundata import FloatArray
from fluxlock.theory.six_step.plots import finish
from fluxverify.figures import panels
from fluxverify.figures.figure import DRAWN, Drawing, Entry, figure, near
from fluxverify.figures.six_step.support import FAMILY, MOTOR_2, at_speed, drive, numbers, schedule, whole
from fluxverify.regression.runner import Runner

SCENARIO = "six-step/figures/dividers.toml"
GAINS = "inverter.sensing.divider_gain=[1.1,1.0,0.9]"
BENCH = (
    "Motor-II (unequal phases of its table), divider gains 1.10/1.00/0.90, 15 V, load 1.5 mN·m and fan 16 mN·m at "
    "54 000 r/min, 40 kHz, ON-PWM, CSC"
)
SUPPLY_V, CONVERTER_V = 15.0, 3.0
RAMP_RPM_PER_S, FAST_RPM_PER_S, PRINTED_RPM_PER_S = 40_000, 90_000, 12_000
WHY_TRIP = "The thesis's run has no trip either"
STEPS = ("none", "vertical", "both")


def divider_error_deg(tolerance: float, speed_pu: FloatArray) -> FloatArray:
    """(3.27): both resistors of a divider at opposite ends of their tolerance; speed over V/(sqrt(3) psi)."""
    ratio = SUPPLY_V / CONVERTER_V
    gain = (1 + tolerance) / ((1 + tolerance) + (1 - tolerance) * (ratio - 1)) * ratio
    return np.asarray(np.degrees((gain - 1) / (np.sqrt(3.0) * speed_pu)))


@figure(FAMILY, "3.3")
def divider_errors(runner: Runner) -> Drawing:
    """Crossing errors caused by resistor tolerances."""
    speed = np.linspace(0.2, 1.0, 81)
    drawn, ((axes,),) = panels.page("3.3: crossing error of the dividers, 3 V converter, 15 V", 1, 1, (7.5, 4.6))
    for k, percent in enumerate((0.1, 0.5, 1.0, 2.0, 5.0, 10.0)):
        axes.plot(speed, divider_error_deg(percent / 100, speed), color=f"C{k}", label=f"{percent:g} %")
    # The chip: Motor-I has equal phases; one divider wrong as by resistors of 1 %, nothing corrected.
    tolerance = 0.01
    gain = 1.0 + float(np.radians(divider_error_deg(tolerance, np.array([1.0]))[0]) * np.sqrt(3.0))
    rows = []
    for k, speed_rpm in enumerate((20_000,) if runner.quick else (20_000, 40_000, 60_000)):
        run = drive(
            runner,
            "six-step/figures/third-harmonic.toml",
            f"dividers-{speed_rpm}",
            *at_speed(speed_rpm),
            "drive.zcd.source=terminal",
            f"inverter.sensing.divider_gain=[1.0,{gain:.6f},1.0]",
            "window=[]",
            "duration_s=0.16",
        )
        part = whole(run).analysis.crossings.between(0.1 * run.data.clock_hz, 0.16 * run.data.clock_hz)
        # Phase B floats in II (rising) and V (falling): opposite errors of the same size.
        rising, falling = (float(part.error_deg[part.sector == s].mean()) for s in (1, 4))
        found = (rising - falling) / 2
        at_pu = speed_rpm * np.pi / 30 * np.sqrt(3.0) * 1e-3 / SUPPLY_V
        axes.plot(at_pu, abs(found), "ko", label="chip, 1 %" if k == 0 else "_")
        rows.append(
            Entry(
                f"1 %, {speed_rpm} r/min ({at_pu:.3f} pu): error of phase B (deg)",
                "curve, no numbers legible",
                f"chip {abs(found):.3f}, formula {float(divider_error_deg(tolerance, np.array([at_pu]))[0]):.3f}",
                "drive",
                None,
                f"{DRAWN}. The formula is a straight line through the crossing at the supply's voltage; the link is "
                "lower under load and the divider also scales the EMF",
            )
        )
    axes.set_yscale("log")
    finish(axes, "speed / (V / $\\sqrt{3}\\psi$)", "error of a crossing / deg")
    panels.legend(axes, 3)
    return Drawing(
        "(3.27): one resistor of a divider high, the other low by the tolerance. Points: Motor-I at 15 V, 40 kHz, the "
        "divider of B wrong by what 1 % gives, no correction.",
        drawn,
        tuple(rows),
    )


def spread(run: Run, from_s: float, to_s: float) -> FloatArray:
    """True angles between successive crossings of a span (deg)."""
    return _between(run, from_s, to_s).intervals_deg()


def _between(run: Run, from_s: float, to_s: float) -> Series:
    return run.analysis.crossings.between(from_s * run.data.clock_hz, to_s * run.data.clock_hz)


def _comparison(runner: Runner, number: str, speed_rpm: int, printed: dict[str, tuple[str, str]]) -> Drawing:
    length_s, learn_s = (0.03, 0.10) if runner.quick else (0.05, 0.22)
    ends = {"none": 0.10 + length_s}
    ends["vertical"] = ends["none"] + learn_s
    ends["both"] = ends["vertical"] + learn_s
    run = drive(
        runner,
        SCENARIO,
        f"steady-{speed_rpm}",
        GAINS,
        *at_speed(
            speed_rpm,
            (ends["none"], "command", "set balance vertical"),
            (ends["vertical"], "command", "set balance both"),
            (ends["both"] - 0.002, "command", "get threshold_pu"),
        ),
        "record.period_s=2e-6",
        f"duration_s={ends['both'] + 0.002:g}",
    )
    drawn, grid = panels.page(f"{number}: {speed_rpm} r/min, correction B", 3, 3, (11.0, 6.6))
    rows, shown_s = [], 2.5 / (speed_rpm / 60)
    for column, step in enumerate(STEPS):
        from_s, to_s = ends[step] - length_s, ends[step] - 0.002
        found = panels.intervals(grid[0][column], run.analysis.crossings, run.data, from_s, to_s)
        grid[0][column].set_ylim(40, 80)
        panels.title(grid[0][column], f"balance {step}: interval of crossings")
        panels.currents(grid[1][column], run.data, to_s - shown_s, to_s)
        panels.gates(grid[2][column], run.data, to_s - shown_s, to_s)
        panels.mark_commutations(grid[2][column], run.analysis, to_s - shown_s, to_s)
        ripple = panels.peak_to_peak_a(run, from_s, to_s)
        span, current = printed[step]
        rows.append(
            Entry(
                f"{step}: interval of crossings (deg); current, peak to peak (A)",
                f"{span}; {current}",
                f"{panels.span_text(found)}; {ripple:.2f}",
                "drive",
                False,
                {
                    "none": "Mutual inductances of Motor-II are not legible, taken as 0: they change the relative "
                    "difference of the phases",
                    "vertical": "What is left is the inductances', whose mutual part is not legible; the load is not "
                    "printed",
                    "both": "The load is not printed: taken so that the currents are near at both speeds. The printed "
                    "60 is that of a timer, without its spread",
                }[step],
            )
        )
    most = max(abs(value) for axes in grid[1] for value in axes.get_ylim())
    for axes in grid[1]:
        axes.set_ylim(-most, most)
    rows.append(Entry("trips", "none", panels.trip_text(run), "drive", not run.result["trips"], WHY_TRIP))
    return Drawing(
        f"{BENCH}, interpolated crossings. One run, the correction is switched on at the console. Dotted: commutations "
        "due by the true angle.",
        drawn,
        tuple(rows),
    )


@figure(FAMILY, "3.10")
def steady_20(runner: Runner) -> Drawing:
    """Wrong dividers at 20 000 r/min: none, vertical, both corrections."""
    printed = {"none": ("50 … 75", "7.44"), "vertical": ("55 … 65", "6.52"), "both": ("60", "6.02")}
    return _comparison(runner, "3.10", 20_000, printed)


@figure(FAMILY, "3.11")
def steady_54(runner: Runner) -> Drawing:
    """Wrong dividers at 54 000 r/min: none, vertical, both corrections."""
    printed = {"none": ("not 60", "26.2"), "vertical": ("closer to 60", "-"), "both": ("60", "22.2")}
    return _comparison(runner, "3.11", 54_000, printed)


def thresholds(run: Run) -> FloatArray:
    """Replies to `get threshold_pu`: [n, 6], over vdc, sectors I to VI."""
    rows = [line.split()[1:] for line in run.data.uart if re.match(r"threshold_pu\s", line)]
    return np.array([[float(v) for v in row] for row in rows])


def settling_s(time_s: FloatArray, values: FloatArray, from_s: float, to_s: float) -> float:
    """Time after from_s from which all columns stay within 0.002 of their last value before to_s."""
    inside = (time_s >= from_s) & (time_s < to_s)
    away = np.abs(values[inside] - values[inside][-1]).max(axis=1) > 0.002
    last = np.flatnonzero(away)
    return float(time_s[inside][last[-1] + 1] - from_s) if last.size else 0.0


def shift_pu(speed_rpm: float) -> list[float]:
    """Shifts of BC, CA, AB by unequal inductances (3.12) over the supply, for phases A, B, C."""
    motor = load_motor(MOTOR_2)
    line_v = np.sqrt(3.0) * motor.psi_vs[0] * motor.pole_pairs * speed_rpm / RPM_PER_RAD_S
    a, b, c = motor.inductance_h
    return [-0.5 * (1.0 - line_v / SUPPLY_V) * (x - y) / (x + y) for x, y in ((b, c), (c, a), (a, b))]


@figure(FAMILY, "3.12")
def convergence(runner: Runner) -> Drawing:
    """Thresholds while they are learnt at 18 000 r/min."""
    first_s, learn_s = 0.10, (0.12 if runner.quick else 0.28)
    second_s, end_s = first_s + learn_s, first_s + 2 * learn_s
    asked = np.arange(0.06, end_s - 0.001, 0.01)
    run = drive(
        runner,
        SCENARIO,
        "convergence",
        GAINS,
        *at_speed(
            18_000,
            (first_s, "command", "set balance vertical"),
            (second_s, "command", "set balance both"),
            *((float(t) + 0.0005, "command", "get threshold_pu") for t in asked),
        ),
        f"duration_s={end_s:g}",
    )
    drawn, grid = panels.page("3.12: learning the thresholds, 18 000 r/min", 3, 1, (10.0, 8.0))
    sector, phase, level = (line[0] for line in grid)
    part = _between(run, 0.06, end_s)
    theta = np.degrees(part.theta_rad)
    for k in range(6):
        own = np.flatnonzero(part.sector[1:] == k) + 1
        sector.plot(
            part.cycle[own] / run.data.clock_hz, (theta[own] - theta[own - 1]), ".", markersize=2, color=f"C{k}"
        )
    # Between the falling and the rising crossing of a phase lie three sectors.
    for k, name in ((0, "C"), (1, "B"), (2, "A")):
        own = np.flatnonzero(part.sector == k + 3)
        own = own[own >= 3]
        angles = theta[own] - theta[own - 3]
        phase.plot(
            part.cycle[own] / run.data.clock_hz,
            angles,
            ".",
            markersize=2,
            color=PHASE_COLOURS["ABC".index(name)],
            label=name,
        )
    found = thresholds(run)
    for k in range(6):
        colour = PHASE_COLOURS["ABC".index("CBACBA"[k])]
        style = "-" if k < 3 else "--"
        level.plot(asked[: len(found)], found[:, k], style, color=colour, label=f"sector {k + 1}, {'CBACBA'[k]}")
    for axes, text in (
        (sector, "sector interval / deg"),
        (phase, "I→IV, II→V, III→VI / deg"),
        (level, "threshold / vdc"),
    ):
        for at_s in (first_s, second_s):
            axes.axvline(at_s, color="black", linewidth=0.8, linestyle=":")
        finish(axes, "time / s", text)
        axes.set_xlim(0.06, end_s)
    panels.legend(phase, 3)
    panels.legend_above(level, 6)
    before = spread(run, 0.06, first_s)
    vertical, both = spread(run, second_s - 0.03, second_s), spread(run, end_s - 0.03, end_s)
    last = found[-1]
    settled = settling_s(asked[: len(found)], found, first_s, second_s - 0.005)
    middle = {name: (last[k] + last[k + 3]) / 2 for k, name in ((0, "C"), (1, "B"), (2, "A"))}
    return Drawing(
        f"{BENCH}, 18 000 r/min. Vertical from {first_s:g} s (thesis 2 s), both from {second_s:g} s (6 s).",
        drawn,
        (
            Entry(
                "thresholds of A, C (vdc)",
                "0.55, 0.45",
                f"{middle['A']:.4f}, {middle['C']:.4f}; B {middle['B']:.4f}",
                "drive",
                near(0.55, middle["A"], 0.005) and near(0.45, middle["C"], 0.005),
            ),
            Entry(
                "sector interval before; vertical; both (deg)",
                "50 … 75; not 60; 60",
                f"{panels.span_text(before)}; {panels.span_text(vertical)}; {panels.span_text(both)}",
                "drive",
                False,
                "Mutual inductances not legible, taken as 0",
            ),
            Entry(
                "thresholds of sectors I to VI (vdc)",
                "drawn, no numbers",
                numbers(last, 4),
                "drive",
                None,
                f"{DRAWN}. Mean of opposite sectors: the divider; half of their difference: the inductances",
            ),
            Entry(
                "half differences of A (III, VI), B (V, II), C (I, IV) (vdc)",
                f"Δv of (3.12) for the table's inductances: {numbers(shift_pu(18_000.0), 4)}",
                numbers([(last[2] - last[5]) / 2, (last[4] - last[1]) / 2, (last[0] - last[3]) / 2], 4),
                "drive",
                False,
                "(3.12) takes the EMF's slope as a straight line, and all dividers as right",
            ),
            Entry(
                "vertical: time until all thresholds stay within 0.002 vdc of their value (ms)",
                "drawn, below 4 s",
                f"{settled * 1e3:.0f}",
                "drive",
                settled < 4.0,
                "Read every 10 ms. The bandwidth follows from that of the speed loop; the thesis prints no gains",
            ),
        ),
    )


@figure(FAMILY, "3.13")
def ramp(runner: Runner) -> Drawing:
    """18 000 → 54 000 → 18 000 r/min with none, vertical, both corrections."""
    top_rpm = 27_000 if runner.quick else 54_000
    up_s = 0.26
    printed = {
        "none": "50 … 75 at 18 000 r/min; over-current trip while accelerating",
        "vertical": "53 … 66 at 18 000, 57 … 62 at 54 000 r/min",
        "both": "59 … 61 throughout",
    }
    # The thesis's own slope beside ours, where the two differ in what is printed.
    courses = (
        ("none", FAST_RPM_PER_S),
        ("vertical", FAST_RPM_PER_S),
        ("both", RAMP_RPM_PER_S),
        *(() if runner.quick else (("none", PRINTED_RPM_PER_S), ("both", PRINTED_RPM_PER_S))),
    )
    drawn, grid = panels.page(f"3.13: 18 000 → {top_rpm} → 18 000 r/min", 3, len(courses), (16.0, 7.0))
    rows = []
    for column, (step, slope) in enumerate(courses):
        down_s = up_s + (top_rpm - 18_000) / slope + 0.05
        returns = step == "both" and slope == RAMP_RPM_PER_S
        end_s = down_s + ((top_rpm - 18_000) / FAST_RPM_PER_S + 0.03 if returns else 0.002)
        back = ((down_s - 0.002, "accel_rpm_per_s", FAST_RPM_PER_S), (down_s, "speed_rpm", 18_000)) if returns else ()
        run = drive(
            runner,
            SCENARIO,
            f"ramp-{step}" + ("-printed" if slope == PRINTED_RPM_PER_S else ""),
            GAINS,
            "initial.speed_rpm=18000",
            schedule(18_000, (up_s, "speed_rpm", top_rpm), *back),
            f"drive.zcd.balance={step}",
            f"drive.accel_rpm_per_s={slope}",
            f"duration_s={end_s:g}",
            accept={"trip": "the thesis's run without correction trips here"} if step == "none" else None,
        )
        panels.speed(grid[0][column], run.data)
        panels.title(grid[0][column], f"balance {step}, {slope} r/min/s")
        trips = run.result["trips"]
        last_s = trips[0]["time_s"] if trips else end_s
        found = panels.intervals(grid[1][column], run.analysis.crossings, run.data, up_s - 0.02, last_s)
        grid[1][column].set_ylim(40, 80)
        panels.currents(grid[2][column], run.data, min(down_s, last_s) - 0.01, min(down_s, last_s) - 0.007)
        slow, fast = spread(run, up_s - 0.02, up_s), spread(run, down_s - 0.02, down_s)
        rows.append(
            Entry(
                f"{step}, up at {slope} r/min/s: interval of crossings (deg)",
                printed[step],
                f"18 000: {panels.span_text(slow)}; {top_rpm}: {panels.span_text(fast)}; whole: "
                f"{panels.span_text(found)}; {panels.trip_text(run)}",
                "drive",
                bool(found.min() > 58.5 and found.max() < 61.5 and not trips) if step == "both" else False,
                {
                    "none": "Uneven, but stable; the trip stands at 18 A. The thesis's limit and load are not printed",
                    "vertical": "What is left is the inductances', whose mutual part is not legible, taken as 0",
                    "both": "While a turn changes by more than 1/128 the thresholds rest",
                }[step],
            )
        )
    return Drawing(
        f"{BENCH}. Learning begins with the start, {up_s:g} s before the ramp. The thesis goes up and down in 3 s, at "
        f"{PRINTED_RPM_PER_S} r/min/s: here up only, with none and both, beside steeper ramps ({FAST_RPM_PER_S} down).",
        drawn,
        tuple(rows),
    )
