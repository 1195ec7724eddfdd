# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""When the vector drive changed between its forced and its observed frame, by what the angle did."""

from __future__ import annotations

import numpy as np

from fluxlock.cosim.outcome import Run
from fluxlock.results.angles import wrap_deg
from fluxlock.results.rundata import FloatArray, LogKind

APART_S = 2e-3  # of two changes


def frame_changes_s(run: Run, from_s: float, to_s: float, count: int) -> list[float]:
    """Times of the `count` largest jumps of the estimated angle in a span: the frame is turned at once.

    A correction by the phase-locked loop is smaller than the way of the rotor's angle in the current that pulls it.
    """
    rows = run.data.rows(LogKind.ANGLE)
    time_s = rows[:, 0] / run.data.clock_hz
    rows, time_s = rows[(time_s >= from_s) & (time_s < to_s)], time_s[(time_s >= from_s) & (time_s < to_s)]
    step = wrap_deg(np.diff(rows[:, 2]) * (360.0 / 2**32))
    jump = np.abs(wrap_deg(step[1:-1] - 0.5 * (step[:-2] + step[2:])))
    found: list[float] = []
    for k in np.argsort(jump)[::-1]:
        at_s = float(time_s[k + 2])
        if all(abs(at_s - other) > APART_S for other in found):
            found.append(at_s)
        if len(found) == count:
            break
    return sorted(found)


def angle_errors_deg(run: Run, *spans_s: tuple[float, float]) -> FloatArray:
    """Angle errors at the current samples of spans."""
    clock_hz = run.data.clock_hz
    return np.concatenate([run.analysis.angles.between(a * clock_hz, b * clock_hz).error_deg for a, b in spans_s])


def rms(values: FloatArray) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(values * values)))
