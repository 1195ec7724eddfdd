# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What the figures of five-phase injection share: courses of angle, error and speed of a run, and their panels."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes

from fluxlock.cosim.outcome import Run
from fluxlock.results.plots import PHASE_COLOURS
from fluxlock.results.rundata import FloatArray, LogKind
from fluxlock.theory.injection.plots import running_mean
from fluxlock.theory.six_step.plots import GREY, finish
from fluxverify.figures.panels import trip_text
from fluxverify.regression.runner import RunFailed

FAMILY = "five-phase"
BLUE, ORANGE, GREEN = PHASE_COLOURS
METHOD_COLOURS = {"conventional": ORANGE, "lock-in": BLUE, "best": GREEN}
MEAN_S = 5e-3
RPM = 30.0 / math.pi
NOT_RUN = "not in the short run"


@dataclass(frozen=True)
class Course:
    """At the current samples of a run: time since an instant (s), angles (rad), error (deg), speeds (r/min).

    frame_rad: angle that Park uses; published_rad: what the user gets; speeds and mean_deg over MEAN_S.
    """

    time_s: FloatArray
    frame_rad: FloatArray
    published_rad: FloatArray
    true_rad: FloatArray
    error_deg: FloatArray
    estimated_rpm: FloatArray
    true_rpm: FloatArray
    end: str

    @staticmethod
    def of(run: Run, from_s: float = 0.0) -> Course:
        """Of a run; time from an instant."""
        data, rows = run.data, run.data.rows(LogKind.ANGLE)
        cycle = rows[:, 0].astype(np.float64)
        time_s = cycle / data.clock_hz
        turn = 2 * math.pi / 2**32
        published = np.unwrap((rows[:, 2] + rows[:, 3]) * turn)
        true = run.analysis.track.theta_rad(cycle)
        slope = np.gradient(published, time_s) * RPM / data.pole_pairs
        count = round(MEAN_S / float(np.median(np.diff(time_s))))
        return Course(
            time_s - from_s,
            np.asarray(rows[:, 2] * turn),
            np.asarray(published),
            true,
            run.analysis.angles.error_deg,
            running_mean(np.asarray(slope), count),
            np.asarray(run.analysis.track.omega_rad_s(cycle) * RPM / data.pole_pairs),
            trip_text(run),
        )

    @property
    def mean_deg(self) -> FloatArray:
        """Error, mean over MEAN_S up to each sample."""
        return running_mean(self.error_deg, self.count)

    @property
    def count(self) -> int:
        """Samples in MEAN_S."""
        return round(MEAN_S / float(np.median(np.diff(self.time_s))))

    def within(self, from_s: float, to_s: float) -> slice:
        """Samples of a span."""
        low, high = np.searchsorted(self.time_s, (from_s, to_s))
        return slice(int(low), int(high))

    def mean(self, from_s: float, to_s: float) -> float:
        """Mean error of a span (deg)."""
        return float(self.error_deg[self.within(from_s, to_s)].mean())

    def largest(self, from_s: float, to_s: float) -> float:
        """Largest 5 ms mean of the error in a span (deg)."""
        part = self.error_deg[self.within(from_s, to_s)]
        return float(np.abs(np.convolve(part, np.full(self.count, 1 / self.count), mode="valid")).max())


# Why the verdict on a run leaves its speed to the figure.
SETTLING = "the figure itself checks the speed before and after its event, within 5 %: a speed loop's tail is longer"


def took_place(course: Course, what: str, rpm: float, from_s: float, to_s: float, part: float = 0.05) -> None:
    """RunFailed unless the shaft's true mean speed in a span is the one asked for: what is drawn has to have happened.

    part: what the speed may be off, of the speed asked for.
    """
    span = course.within(from_s, to_s)
    found = float(course.true_rpm[span].mean()) if span.stop > span.start else math.nan
    if not abs(found - rpm) <= part * abs(rpm):
        raise RunFailed(
            f"{what}: the event did not take place: {found:.1f} r/min from {from_s:.3f} to {to_s:.3f} s instead of "
            f"{rpm:g} r/min; {course.end}"
        )


def wrapped_deg(angle_rad: FloatArray) -> FloatArray:
    """Angle in 0 to 360 deg, with a gap where it wraps."""
    found = np.degrees(np.mod(angle_rad, 2 * math.pi))
    jumps = np.abs(np.diff(found, append=found[-1])) > 180
    return np.where(jumps, np.nan, found)


def angles(axes: Axes, course: Course, from_s: float, to_s: float, colour: str = BLUE) -> None:
    """Estimated and true angle of a span."""
    part = course.within(from_s, to_s)
    axes.plot(course.time_s[part], wrapped_deg(course.true_rad[part]), color=GREY, linewidth=1.6, label="true")
    axes.plot(
        course.time_s[part], wrapped_deg(course.published_rad[part]), color=colour, linewidth=0.8, label="estimated"
    )
    axes.set_xlim(from_s, to_s)
    finish(axes, "time / s", "angle / deg")


def error(
    axes: Axes, course: Course, from_s: float, to_s: float, colour: str, label: str, radians: bool = False
) -> None:
    """Error of a span, 5 ms mean."""
    part = course.within(from_s, to_s)
    values = np.radians(course.mean_deg) if radians else course.mean_deg
    axes.plot(course.time_s[part], values[part], color=colour, linewidth=1, label=label)
    axes.set_xlim(from_s, to_s)
    finish(axes, "time / s", f"θ̂ − θ / {'rad' if radians else 'deg'}, 5 ms mean")


def speeds(axes: Axes, course: Course, from_s: float, to_s: float, colour: str, label: str = "estimated") -> None:
    """Estimated and true speed of a span."""
    part = course.within(from_s, to_s)
    axes.plot(course.time_s[part], course.estimated_rpm[part], color=colour, linewidth=0.8, label=label)
    axes.plot(course.time_s[part], course.true_rpm[part], color=GREY, linewidth=1)
    axes.set_xlim(from_s, to_s)
    finish(axes, "time / s", "speed / r/min; grey: true")


def seconds(value: float | int | None) -> str:
    """`0.035 s`, or `never`."""
    return "never" if value is None else f"{value:.3f} s"
