# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Mean of the output under CSC, section 5.4.3: a pulse that the commutation cuts changes it.

All duties are 0..1, `n` is carriers a sector, a minimum pulse is in carriers. Arguments broadcast.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fluxlock.results.rundata import FloatArray, IntArray

# N this close below a whole number counts as the whole number.
WHOLE = 1e-9


def whole_and_rest(n: npt.ArrayLike) -> tuple[IntArray, FloatArray]:
    """N_Z and N_D of (5.10): whole and fractional part of the carriers a sector."""
    number = np.asarray(n, dtype=np.float64)
    whole = np.floor(number + WHOLE)
    return whole.astype(np.int64), np.maximum(number - whole, 0.0)


def mean_output(duty: npt.ArrayLike, n: npt.ArrayLike) -> FloatArray:
    """Mean of the output: (5.16) where the last pulse is whole (M <= N_D), else (5.17)."""
    m = np.asarray(duty, dtype=np.float64)
    whole, rest = whole_and_rest(n)
    return np.asarray((whole * m + np.minimum(m, rest)) / np.asarray(n, dtype=np.float64))


def compensated_duty(mean: npt.ArrayLike, n: npt.ArrayLike) -> FloatArray:
    """Duty that gives a wanted mean: M1 of (5.18) where it is valid (M1 <= N_D), else M2.

    Exactly one of the two is valid: both conditions change at mean = N_D (N_Z + 1) / N. N < 1: always M1. Clipped to
    0..1.
    """
    wanted = np.asarray(mean, dtype=np.float64)
    number = np.asarray(n, dtype=np.float64)
    whole, rest = whole_and_rest(number)
    first = number / (whole + 1) * wanted
    second = 1.0 - number / np.maximum(whole, 1) * (1.0 - wanted)
    return np.clip(np.where((first <= rest) | (whole == 0), first, second), 0.0, 1.0)


def mean_with_min_pulse(duty: npt.ArrayLike, n: npt.ArrayLike, min_pulse: float) -> FloatArray:
    """Mean of the output if no pulse and no gap may be shorter than min_pulse (carriers).

    Rule, carrier by carrier and without an account of what is lost: a pulse below the minimum is not started, also
    one that the commutation would cut below it; a gap below the minimum is not opened, also one that the
    commutation would end too soon. (`fl_carrier` has the same rule and returns the difference in the next pulse.)
    """
    m = np.asarray(duty, dtype=np.float64)
    whole, rest = whole_and_rest(n)
    full = np.where(m < min_pulse, 0.0, np.where(1.0 - m < min_pulse, 1.0, m))
    # The cut carrier: a pulse of the least of full and rest, then the gap up to the commutation.
    last = np.minimum(full, rest)
    last = np.where(last < min_pulse, 0.0, last)
    last = np.where((last > 0.0) & (rest - last < min_pulse), rest, last)
    # Without gaps before it the cut carrier goes on with the pulse.
    last = np.where(full >= 1.0, rest, last)
    return np.asarray((whole * full + last) / np.asarray(n, dtype=np.float64))
