# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Section 7.4: angle and EMF of an observer with the right and with a wrong delay."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from fluxlock.theory.six_step.plots import GREY, finish
from fluxlock.theory.vector.model import emf
from fluxlock.theory.vector.sensorless import rest
from fluxlock.theory.vector.study import SPEEDS, delay_course, delay_drive
from fluxverify.figures import panels
from fluxverify.figures.blac.support import (
    ANALYTIC,
    CONTROLLER_COLOURS,
    CURRENT_A,
    FAMILY,
    FS_HZ,
    THETA,
    bench,
    percent,
)
from fluxverify.figures.figure import Drawing, Entry, figure, near
from fluxverify.regression.runner import Runner
from fluxverify.regression.vector.observer import drive_at

SAMPLES = 600
WHY_SIZE = (
    "Without current it is |Γ'| / |Γ|, above 1 for both wrong delays; a load lowers it with T'_d < T_d "
    "and raises it with T'_d > T_d"
)
WHY_CHIP = (
    "What it is off the closed form is noise, ripple in the sample and what the dead time leaves; the share of each is "
    "not known"
)
ON_CHIP = (
    "Points: the chip with the switched inverter and 12-bit noise, imposed speed, T'_d given from the start, loop of "
    "400 Hz: the last 12 ms of a run, at the end of the axis."
)


def _chip(axes: Axes, runner: Runner, speed: float, delay: float, believed: float, colour: str, end_ms: float) -> float:
    """Draw the angle error at the chip's samples so that it ends at end_ms; its mean, deg."""
    run = drive_at(runner, speed * FS_HZ, delay, believed)
    span, clock_hz = run.scenario.window[0], run.data.clock_hz
    series = run.analysis.angles.between(span.from_s * clock_hz, span.to_s * clock_hz)
    time_ms = end_ms + 1e3 * (series.cycle / clock_hz - span.to_s)
    axes.plot(time_ms, series.error_deg, "o", color=colour, markersize=3, markevery=6, fillstyle="none")
    return float(series.error_deg.mean())


def draw_sensorless(number: str, delay: float, runner: Runner, on_chip: Sequence[float], samples: int) -> Drawing:
    """Angle and EMF with three delays in the observer; on_chip: speeds over f_s at which the chip stands beside."""
    heading = f"{number}: sensorless, $T_d$ = {delay:g} $T_s$; the observer is given $T'_d$ at t = 0"
    drawn, grid = panels.page(heading, 2, 2, (11.0, 5.6))
    lines: list[Entry] = []
    for column, speed in enumerate(SPEEDS):
        upper, lower = grid[0][column], grid[1][column]
        true = float(np.abs(emf(bench().machine, bench().omega(speed))))
        time_ms = np.arange(samples) / bench().fs_hz * 1e3
        found, chip = [], []
        for believed, colour in zip((0.0, delay, 1.0), CONTROLLER_COLOURS.values(), strict=True):
            course = delay_course(bench(), speed, delay, believed, CURRENT_A, samples)
            drive = delay_drive(bench(), speed, delay, believed, CURRENT_A)
            closed = float(rest(drive, bench().omega(speed), drive.current).error_deg)
            size, label = np.abs(course.emf), f"$T'_d$ = {believed:g} $T_s$"
            upper.plot(time_ms, course.error_deg, color=colour, linewidth=1, label=label)
            upper.axhline(closed, color=colour, linewidth=0.6, linestyle=":")
            lower.plot(time_ms, size, color=colour, linewidth=1, label=label)
            found.append((float(course.error_deg[-1]), closed, float(size[-1]) / true))
            if speed in on_chip:
                chip.append(_chip(upper, runner, speed, delay, believed, colour, float(time_ms[-1])))
        at = f"{bench().fs_hz * speed:g} Hz, T'_d = 0 / {delay:g} / 1 T_s"
        simulated, closed_forms = (" / ".join(_signed(line[k]) for line in found) for k in (0, 1))
        sizes = " / ".join(f"{line[2]:.3f}" for line in found)
        signs = [line[1] for line in found]
        lines += [
            Entry(
                f"{at}: error (deg)",
                "negative / none / positive",
                simulated,
                "no run",
                signs[0] > 0 > signs[2] and abs(signs[1]) < 0.005,
                THETA,
            ),
            Entry("in closed form", "", closed_forms, "no run", None),
            *([Entry("on the chip", "", " / ".join(map(_signed, chip)), "imposed", None, WHY_CHIP)] if chip else []),
            Entry(
                "estimated over true EMF",
                "less / accurate / greater",
                sizes,
                "no run",
                found[0][2] < 1 < found[2][2] and near(1.0, found[1][2], 0.0005),
                WHY_SIZE,
            ),
        ]
        lower.axhline(true, color=GREY, linewidth=0.8)
        panels.title(upper, percent(speed))
        finish(upper, "time / ms", "θ̂ − θ / deg")
        finish(lower, "time / ms", "|ê| / V; grey: true")
        for axes in (upper, lower):
            axes.set_xlim(0.0, float(time_ms[-1]))
    panels.legend(grid[1][0], 3, "center right")
    condition = (
        f"Motor-I, f_s 15 kHz, i_q {CURRENT_A:g} A in the estimated frame, controller C, poles 0.7, loop of 100 Hz; "
        f"dotted: closed form. {ON_CHIP if on_chip else ANALYTIC}"
    )
    return Drawing(condition, drawn, tuple(lines))


def _signed(value: float) -> str:
    return f"{value:+.2f}" if abs(value) >= 0.005 else "0.00"


@figure(FAMILY, "7.13")
def quarter_delay(runner: Runner) -> Drawing:
    """Sensorless operation at a quarter of a sample period with three delays in the observer."""
    return draw_sensorless("7.13", 0.25, runner, () if runner.quick else SPEEDS, SAMPLES)


@figure(FAMILY, "7.14")
def half_delay(runner: Runner) -> Drawing:
    """Sensorless operation at half a sample period with three delays in the observer."""
    return draw_sensorless("7.14", 0.5, runner, () if runner.quick else SPEEDS, SAMPLES)


@figure(FAMILY, "7.15")
def three_quarter_delay(runner: Runner) -> Drawing:
    """Sensorless operation at three quarters of a sample period with three delays in the observer."""
    return draw_sensorless("7.15", 0.75, runner, () if runner.quick else SPEEDS, SAMPLES)
