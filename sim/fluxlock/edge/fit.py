# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Fit of step, ring and lobe to an oscilloscope record: separable least squares.

Heights, level and slope of the terminal are linear: for given times they follow at once (Golub and Pereyra 1973). Only
the times are searched, from several starts, as logarithms. The signal behind a pole is the terms' own, each integrated
with it.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares

from fluxlock.edge.record import ScopeRecord

FloatArray = npt.NDArray[np.float64]
# Times from which the search starts, as shares of the record.
STEP_STARTS, RING_STARTS, LOBE_STARTS = (0.01, 0.05), (0.05, 0.2), (0.05, 0.2)
SIGNIFICANT = 5.0  # standard deviations of a height: below it the record has no such term
SHORTEST = 0.5  # of a sample: no time constant is shorter


@dataclass(frozen=True)
class Fit:
    """Keys of `[sensing.edge]` (heights at reference_v), rms of what is left (V), and its share of the record's rms."""

    keys: dict[str, float]
    residual_v: float
    residual_share: float


def _behind_pole(time_s: FloatArray, rate: complex, pole_s: float) -> FloatArray:
    """Real part of exp(rate t) behind a pole that is at rest at 0."""
    own = np.exp(rate * time_s)
    if pole_s > 0.0:
        denominator = 1.0 + rate * pole_s
        if abs(denominator) < 1e-6:
            return np.asarray(time_s / pole_s * np.exp(-time_s / pole_s))
        own = (own - np.exp(-time_s / pole_s)) / denominator
    return np.asarray(own.real)


def _shapes(record: ScopeRecord, terms: tuple[str, ...], times: FloatArray) -> FloatArray:
    """One column a linear unknown: level, slope, then the terms with height 1. times: their logarithms, in order."""
    t, pole_s = record.time_s, record.pole_s
    columns = [np.ones(t.size), t / t[-1]]
    left = iter(np.exp(times))
    for term in terms:
        if term == "step":
            columns.append(_behind_pole(t, -1.0 / next(left), pole_s))
        elif term == "ring":
            hz, tau_s = next(left), next(left)
            columns.append(_behind_pole(t, -1.0 / tau_s + 2j * np.pi * hz, pole_s))
        else:
            tau_s = next(left)
            # t / tau exp(1 - t / tau) as the difference of two decays that are close to each other.
            near = 1e-4
            pair = (_behind_pole(t, -(1.0 - sign * near) / tau_s, pole_s) for sign in (1, -1))
            columns.append(math.e * (next(pair) - next(pair)) / (2.0 * near))
    return np.column_stack(columns)


def _heights(record: ScopeRecord, shapes: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.lstsq(shapes, record.volts, rcond=None)[0])


def _ring_hz(record: ScopeRecord) -> float:
    """Frequency of the strongest swing in the record, its level and decay removed by differences."""
    swing = np.diff(record.volts, 2) * np.hanning(record.volts.size - 2)
    # Differences weigh a frequency by its square: undo it, so that noise does not win.
    hz = np.fft.rfftfreq(4 * swing.size, 1.0 / record.sampling_hz)[1:]
    weight = (2.0 * np.sin(np.pi * hz / record.sampling_hz)) ** 2
    size = np.abs(np.fft.rfft(swing, 4 * swing.size))[1:] / np.maximum(weight, 1e-6)
    lowest = 2.0 / record.time_s[-1]
    return float(hz[np.where(hz > lowest, size, 0.0).argmax()])


def _search(record: ScopeRecord, terms: tuple[str, ...]) -> tuple[FloatArray, FloatArray, float]:
    """Best times (logarithms), heights and sum of squares over all starts."""
    length_s = float(record.time_s[-1])
    low, high = np.log(SHORTEST / record.sampling_hz), np.log(length_s)
    hz = _ring_hz(record)
    options: dict[str, list[tuple[float, ...]]] = {
        "step": [(share * length_s,) for share in STEP_STARTS],
        "ring": [(factor * hz, share * length_s) for factor in (1.0, 0.8, 1.25) for share in RING_STARTS],
        "lobe": [(share * length_s,) for share in LOBE_STARTS],
    }
    bounds = {"step": [(low, high)], "ring": [(-high, np.log(record.sampling_hz / 2)), (low, high)]}
    bounds["lobe"] = bounds["step"]
    limits = np.array([limit for term in terms for limit in bounds[term]]).reshape(-1, 2)

    def left(times: FloatArray) -> FloatArray:
        shapes = _shapes(record, terms, times)
        return np.asarray(shapes @ _heights(record, shapes) - record.volts)

    best: tuple[FloatArray, float] | None = None
    starts = [options[term] for term in terms]
    for start in itertools.product(*starts):
        times = np.clip(np.log([value for part in start for value in part]), limits[:, 0] + 1e-6, limits[:, 1] - 1e-6)
        found = least_squares(left, times, bounds=(limits[:, 0], limits[:, 1])) if times.size else None
        end = found.x if found is not None else times
        cost = float(np.sum(left(end) ** 2))
        if best is None or cost < best[1]:
            best = end, cost
    assert best is not None
    return best[0], _heights(record, _shapes(record, terms, best[0])), best[1]


def _significant(
    record: ScopeRecord, terms: tuple[str, ...], times: FloatArray, heights: FloatArray, cost: float
) -> bool:
    """Whether every term's height stands out of its own uncertainty."""
    shapes = _shapes(record, terms, times)
    variance = cost / max(1, record.volts.size - shapes.shape[1] - times.size)
    deviation = np.sqrt(np.maximum(np.diag(np.linalg.pinv(shapes.T @ shapes)), 0.0) * variance)
    return bool(np.all(np.abs(heights[2:]) > SIGNIFICANT * deviation[2:]))


def fit_record(record: ScopeRecord, reference_v: float) -> Fit:
    """Fit the terms that the record shows, the most of them that are all significant."""
    all_terms = ("step", "ring", "lobe") if record.turns_off else ("step", "ring")
    subsets = [s for n in range(len(all_terms), -1, -1) for s in itertools.combinations(all_terms, n)]
    best: tuple[tuple[str, ...], FloatArray, FloatArray, float] | None = None
    for terms in subsets:
        if best is not None and len(terms) < len(best[0]):
            break
        times, heights, cost = _search(record, terms)
        if _significant(record, terms, times, heights, cost) and (best is None or cost < best[3]):
            best = terms, times, heights, cost
    assert best is not None  # without terms there is nothing to be insignificant
    terms, times, heights, cost = best
    keys, scale, left = {"reference_v": reference_v}, reference_v / record.jump_v, iter(np.exp(times))
    for term, height in zip(terms, heights[2:], strict=True):
        keys[f"{term}_v"] = float(scale * height)
        names = {"step": ("step_tau_s",), "ring": ("ring_hz", "ring_tau_s"), "lobe": ("lobe_s",)}[term]
        keys.update({name: float(next(left)) for name in names})
    residual_v = float(np.sqrt(cost / record.volts.size))
    swing_v = float(np.std(record.volts))
    return Fit(keys, residual_v, residual_v / swing_v if swing_v > 0 else 0.0)
