# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Driven shafts: an imposed speed, and i_q at the limit of the current, for the speed asked for is never reached."""

from __future__ import annotations

import numpy as np

from fluxlock.cosim.outcome import Run
from fluxverify.regression.case import Number
from fluxverify.regression.six_step.measures import event, timeline

START_S, TURNING_S, AT_SPEED_S = 0.004, 0.03, 0.13
BEYOND_RPM = 10.0  # that is asked for beyond the imposed speed
NO_CURRENT_A = 0.05


def driven(
    rpm: float,
    i_q_a: float,
    settled_s: float,
    end_s: float,
    beyond_rpm: float = BEYOND_RPM,
    at_speed_s: float = AT_SPEED_S,
) -> list[str]:
    """Overrides: 0 to rpm at at_speed_s, i_q_a with its sign, window `steady` from settled_s to the end."""
    asked = rpm + (beyond_rpm if i_q_a >= 0 else -beyond_rpm)
    start = [event(0.002, "command", f"set speed_rpm {asked:g}"), event(START_S, "command", "start")]
    return [
        *timeline(end_s, start, [("steady", settled_s, end_s)]),
        "expect=[]",
        "mechanics.mode=imposed",
        f"mechanics.profile=[[0.0, 0.0], [{TURNING_S}, 0.0], [{at_speed_s}, {rpm!r}]]",
        f"drive.current_limit_a={max(abs(i_q_a), NO_CURRENT_A)!r}",
        "drive.accel_rpm_per_s=100000",
    ]


def angle_values(run: Run) -> dict[str, Number]:
    """Angle error, current and trips of the window."""
    found = run.metrics["steady"]
    return {
        **{f"angle_error_deg.{kind}": found["angle_error_deg"][kind] for kind in ("mean", "rms", "max")},
        "iq_a": found["iq_a"],
        "trips": len(run.result["trips"]),
    }


def largest_mean_deg(run: Run, begin_s: float, window_s: float = 5e-3) -> Number:
    """Largest size of the angle error's mean over a sliding window from begin_s on."""
    angles = run.analysis.angles
    time_s = angles.cycle / run.data.clock_hz
    error = angles.error_deg[time_s >= begin_s]
    count = max(round(window_s / float(np.median(np.diff(time_s)))), 1)
    if error.size < count:
        return None
    return float(np.abs(np.convolve(error, np.full(count, 1.0 / count), mode="valid")).max())
