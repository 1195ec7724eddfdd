# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Errors of commutations by where in a carrier their crossings fall: what switching edges do to them shows here.

The phase of an instant is its distance from the last beginning of a pulse over the distance of that to the next one. A
pulse begins where one upper and one lower switch of two legs are on and the clock before only one of all switches was.
Where commutations have moved or swallowed a beginning, the usual distance of the run's pulses stands in its place.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fluxlock.results.rundata import BoolArray, FloatArray, IntArray

BINS = 32
LEAST_IN_BIN = 2  # errors; a bin with fewer has no mean
USUAL = 0.1  # share of the usual distance within which a distance of two beginnings counts as regular


@dataclass(frozen=True)
class PhaseBins:
    """Errors (degrees) in BINS equal parts of a carrier: how many, mean (NaN where too few) and rms about zero."""

    count: IntArray
    mean_deg: FloatArray
    rms_deg: FloatArray

    @property
    def pp_deg(self) -> float | None:
        """Largest less smallest mean of the bins; None with fewer than two means."""
        means = self.mean_deg[np.isfinite(self.mean_deg)]
        return float(np.ptp(means)) if means.size > 1 else None


def pulse_starts(cycle: IntArray, gates: IntArray) -> IntArray:
    """Cycles at which pulses of a three-leg inverter begin, from the gate log (cycle, gates of each change)."""
    upper, lower = sum(gates >> 2 * x & 1 for x in range(3)), sum(gates >> 2 * x + 1 & 1 for x in range(3))
    on: BoolArray = np.asarray((upper == 1) & (lower == 1))
    single: BoolArray = np.asarray(upper + lower == 1)
    found: IntArray = cycle[1:][on[1:] & single[:-1]]
    return found


def pwm_phase(at: FloatArray, starts: IntArray) -> FloatArray:
    """Phase, 0 to 1, of instants (cycles); NaN before the first pulse and where pulses are too rare to tell."""
    if starts.size < 2 or not at.size:
        return np.full(at.size, np.nan)
    last = np.searchsorted(starts, at, side="right") - 1
    usual = float(np.median(np.diff(starts)))
    begin = starts[np.maximum(last, 0)]
    gap = starts[np.minimum(last + 1, starts.size - 1)] - begin
    period = np.where(np.abs(gap - usual) <= USUAL * usual, gap, usual)
    phase: FloatArray = (at - begin) / period % 1.0
    known = (last >= 0) & (at - begin < 4 * usual)
    return np.where(known, phase, np.nan)


def phase_bins(phase: FloatArray, error_deg: FloatArray) -> PhaseBins:
    """Sort errors into the bins of their phases; a phase that is not known is left out."""
    known = np.isfinite(phase) & np.isfinite(error_deg)
    place = np.minimum((phase[known] * BINS).astype(np.int64), BINS - 1)
    errors = error_deg[known]
    count = np.bincount(place, minlength=BINS)
    total, square = (np.bincount(place, weights=w, minlength=BINS) for w in (errors, errors**2))
    enough = count >= LEAST_IN_BIN
    divisor = np.maximum(count, 1)
    return PhaseBins(
        count, np.where(enough, total / divisor, np.nan), np.where(enough, np.sqrt(square / divisor), np.nan)
    )
