# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Stability of the loop crossing -> commutation -> freewheeling -> crossing, section 5.3.

Under RSC a commutation waits for the next carrier start. If the freewheeling after it then hides the crossing, the
crossing counts as detected when it ends, the next commutation is later still, and the error accumulates:

    trg[k] = zcp[k-1] + 30                  (5.4)
    act[k] = ceil(trg[k] N / 60) 60 / N     (5.5)
    zcp[k] = max(60 k + 30, act[k] + phi)   (5.8)

Once every crossing is hidden, act advances by ceil(phi N / 60 + N / 2) carriers a sector. The error stays below one
carrier if these are at most N, and grows without bound otherwise, so the loop is stable exactly for

    phi <= 60 floor(N) / N - 30

With crossings computed back (see `override`) the crossing is always ideal, only it may become known after the
commutation was due: trg[k] = max(60 k, act[k-1] + phi), stable for phi <= 60 floor(N) / N, 30 degrees more. Without
the carrier's delay (NSC, CSC) the limits are 30 and 60 degrees at every N.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import numpy.typing as npt

from fluxlock.results.rundata import BoolArray, FloatArray
from fluxlock.theory.six_step.linearity import whole_and_rest
from fluxlock.theory.six_step.patterns import Commutation

# Rounding in carriers: what is due this little after a carrier start still makes it.
TOLERANCE = 1e-6
# The error of a stable loop in carriers: below one under RSC, none under the others.
BOUND: dict[Commutation, float] = {"RSC": 1.001, "NSC": 0.001, "CSC": 0.001}
SEARCH_TO_DEG = 64.0


def _walk(
    n: FloatArray,
    freewheel_deg: FloatArray,
    carrier_phase: FloatArray,
    sectors: int,
    commutation: Commutation,
    back_computed: bool,
) -> Iterator[FloatArray]:
    """Lateness of commutation 1, 2, ... in carriers, relative to the ideal one: long runs lose no digits."""
    freewheel = freewheel_deg / 60.0 * n
    trigger = np.zeros(n.shape)
    start = -np.mod(n + carrier_phase, 1.0)  # of a carrier
    for _ in range(sectors):
        late = trigger
        if commutation == "RSC":
            late = start + np.ceil(trigger - start - TOLERANCE)
        yield late
        end = late + freewheel
        known_at = n if back_computed else n / 2
        trigger = np.maximum(end - known_at, 0.0)
        start = np.mod(start - n, 1.0)


def _arrays(n: npt.ArrayLike, phi: npt.ArrayLike, phase: npt.ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
    a, b, c = np.broadcast_arrays(*(np.asarray(x, dtype=np.float64) for x in (n, phi, phase)))
    if np.any(a < 1.0) or np.any(b < 0.0):
        raise ValueError("n must be at least 1 carrier a sector, freewheel_deg at least 0")
    return a, b, c


def commutation_errors_deg(
    n: npt.ArrayLike,
    freewheel_deg: npt.ArrayLike,
    sectors: int,
    *,
    commutation: Commutation = "RSC",
    back_computed: bool = False,
    carrier_phase: npt.ArrayLike = 0.0,
) -> FloatArray:
    """Lateness of the commutations 1 .. sectors (deg), (5.9): shape [sectors, ...].

    n: carriers a sector, at least 1; freewheel_deg: phi, constant; carrier_phase: 0..1, of the carrier at the ideal
    commutation 0; all broadcast. Starts with an ideal crossing.
    """
    number, phi, phase = _arrays(n, freewheel_deg, carrier_phase)
    late = np.stack(list(_walk(number, phi, phase, sectors, commutation, back_computed)))
    return np.asarray(late * 60.0 / number)


def is_stable(
    n: npt.ArrayLike,
    freewheel_deg: npt.ArrayLike,
    *,
    commutation: Commutation = "RSC",
    back_computed: bool = False,
    carrier_phase: npt.ArrayLike = 0.0,
    sectors: int = 2000,
) -> BoolArray:
    """Whether the map's error stays in bounds for a number of sectors; arguments broadcast."""
    number, phi, phase = _arrays(n, freewheel_deg, carrier_phase)
    stable = np.ones(number.shape, dtype=np.bool_)
    for late in _walk(number, phi, phase, sectors, commutation, back_computed):
        stable &= late < BOUND[commutation]
        if not stable.any():
            break
    return stable


def stable_freewheel_deg(
    n: npt.ArrayLike,
    *,
    commutation: Commutation = "RSC",
    back_computed: bool = False,
    carrier_phase: npt.ArrayLike = 0.0,
    sectors: int = 2000,
    resolution_deg: float = 0.01,
    progress: Callable[[float], None] | None = None,
) -> FloatArray:
    """Largest freewheel angle (deg) at which the map is stable, by bisection; same shape as n.

    progress: called with the finished part, 0..1.
    """
    number = np.asarray(n, dtype=np.float64)
    low, high = np.zeros(number.shape), np.full(number.shape, SEARCH_TO_DEG)
    steps = int(np.ceil(np.log2(SEARCH_TO_DEG / resolution_deg)))
    for step in range(steps):
        middle = (low + high) / 2
        stable = is_stable(
            number,
            middle,
            commutation=commutation,
            back_computed=back_computed,
            carrier_phase=carrier_phase,
            sectors=sectors,
        )
        low, high = np.where(stable, middle, low), np.where(stable, high, middle)
        if progress:
            progress((step + 1) / steps)
    return np.asarray((low + high) / 2)


def freewheel_limit_deg(
    n: npt.ArrayLike, *, commutation: Commutation = "RSC", back_computed: bool = False
) -> FloatArray:
    """The closed form of the boundary (deg), same shape as n."""
    number = np.asarray(n, dtype=np.float64)
    whole, _ = whole_and_rest(number)
    visible = np.where(commutation == "RSC", 60.0 * whole / number, 60.0)
    return np.asarray(visible if back_computed else visible - 30.0)
