# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Machine of Yu 2022 at rated load: what the cross-coupling curve is worth, and the angle at 5 r/min."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from fluxlock.cosim.outcome import Run
from fluxlock.results.rundata import LogKind
from fluxverify.regression.case import Number, Row, case
from fluxverify.regression.five_phase.driven import angle_values, driven
from fluxverify.regression.five_phase.yu import SCENARIO
from fluxverify.regression.runner import Runner

RATED_A, RATED_RPM = 5.0, 150.0
BEYOND_RPM = 600.0  # the speed regulator asks for the whole current at once
KNOWN_START = ("initial.theta_deg=0", "drive.vector.injection.search=false")
SETTLED_S, END_S, QUICK_END_S = 0.2, 0.36, 0.25
RAW_RAD, RAW_TOLERANCE_RAD, PUBLISHED_RAD = 0.30, 0.02, 0.01
CRAWL_RPM = 5.0
CRAWL_END_S, CRAWL_QUICK_S = 0.4, 0.23
CRAWL_MEAN_RAD, CRAWL_RMS_RAD, CRAWL_MOST_RAD = 0.015, 0.02, 0.05


def frame_mean_rad(run: Run, window: str) -> float:
    """Mean error of the frame's own angle, which follows the salient axis, in a window."""
    span = next(w for w in run.scenario.window if w.name == window)
    rows = run.data.rows(LogKind.ANGLE)
    time_s = rows[:, 0] / run.data.clock_hz
    rows = rows[(time_s >= span.from_s) & (time_s < span.to_s)]
    theta = run.analysis.track.theta_rad(rows[:, 0].astype(np.float64))
    error = rows[:, 2] * (2 * math.pi / 2**32) - theta
    return float(np.mean(np.remainder(error + math.pi, 2 * math.pi) - math.pi))


def radians(values: dict[str, Number]) -> dict[str, Number]:
    """The same values with the angle errors in rad."""
    found: dict[str, Number] = {}
    for name, value in values.items():
        head, unit, kind = name.partition("angle_error_deg.")
        if unit:
            found[f"{head}angle_error_rad.{kind}"] = None if value is None else math.radians(value)
        else:
            found[name] = value
    return found


@case("five-phase/yu-compensation", long=True)
def compensation(runner: Runner) -> Iterator[Row]:
    """Driven at 150 r/min with rated current: angle of the salient axis, published angle, both without the curve."""
    end_s = QUICK_END_S if runner.quick else END_S
    for curve, dead_time_us in (("following", 0.0), ("off", 0.0), ("following", 2.0)):
        if runner.quick and (curve, dead_time_us) != ("following", 0.0):
            continue
        overrides = [
            *driven(RATED_RPM, RATED_A, SETTLED_S, end_s, beyond_rpm=BEYOND_RPM),
            *KNOWN_START,
            f"drive.vector.injection.compensation={curve}",
            f"inverter.dead_time_s={dead_time_us * 1e-6:g}",
        ]
        run = runner.drive(SCENARIO, f"{curve}-{dead_time_us:g}us", *overrides)
        values = radians(angle_values(run))
        values["frame_error_rad.mean"] = frame_mean_rad(run, "steady")
        limits: dict[str, tuple[float | None, float | None]] = {"trips": (0, 0)}
        note = "without any curve the frame sends i_q into the d axis, which changes L_q: no limit"
        if curve != "off":
            note = "frame: raw, its references turned by the curve"
            limits["frame_error_rad.mean"] = (RAW_RAD - RAW_TOLERANCE_RAD, RAW_RAD + RAW_TOLERANCE_RAD)
            limits["angle_error_rad.mean"] = (-PUBLISHED_RAD, PUBLISHED_RAD)
        yield Row(
            f"five-phase/yu-compensation/{curve}/{dead_time_us:g}us",
            {"motor": "Yu", "speed_rpm": RATED_RPM, "iq_a": RATED_A, "curve": curve, "dead_time_us": dead_time_us},
            values,
            limits,
            note,
        )


def crawl_run(runner: Runner, dead_time_us: float, i_q_a: float) -> Run:
    """Driven at 5 r/min with a current."""
    overrides = [
        *driven(CRAWL_RPM, i_q_a, SETTLED_S, CRAWL_QUICK_S if runner.quick else CRAWL_END_S, beyond_rpm=BEYOND_RPM),
        *KNOWN_START,
        f"inverter.dead_time_s={dead_time_us * 1e-6:g}",
    ]
    return runner.drive(SCENARIO, f"{dead_time_us:g}us" + ("" if i_q_a else "-no-load"), *overrides)


@case("five-phase/yu-crawl", long=True)
def crawl(runner: Runner) -> Iterator[Row]:
    """Driven at 5 r/min with rated current, mean of 16 converter samples: angle error."""
    for dead_time_us in (0.0, 2.0):
        if runner.quick and dead_time_us:
            continue
        run = crawl_run(runner, dead_time_us, RATED_A)
        yield Row(
            f"five-phase/yu-crawl/{dead_time_us:g}us",
            {"motor": "Yu", "speed_rpm": CRAWL_RPM, "iq_a": RATED_A, "dead_time_us": dead_time_us},
            radians(angle_values(run)),
            {
                "angle_error_rad.mean": (-CRAWL_MEAN_RAD, CRAWL_MEAN_RAD),
                "angle_error_rad.rms": (None, CRAWL_RMS_RAD),
                "angle_error_rad.max": (None, CRAWL_MOST_RAD),
                "trips": (0, 0),
            },
        )
