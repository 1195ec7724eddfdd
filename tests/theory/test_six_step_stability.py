# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Stability of the zero-crossing loop: map against closed form and against the equations in exact arithmetic."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest

from fluxlock.theory.six_step.stability import (
    commutation_errors_deg,
    freewheel_limit_deg,
    is_stable,
    stable_freewheel_deg,
)

RESOLUTION_DEG = 0.01
# The map must run into the boundary: 2000 sectors resolve it to this.
SEARCH_TOL_DEG = 0.05


def exact_errors(n: Fraction, freewheel_deg: Fraction, sectors: int, back_computed: bool = False) -> list[Fraction]:
    """(5.4) to (5.9) in fractions, absolute angles, initial value zcp[0] = 30."""
    zcp = Fraction(30)
    errors = []
    for k in range(1, sectors + 1):
        trigger = zcp + 30
        actual = math.ceil(trigger * n / 60) * Fraction(60) / n
        errors.append(actual - 60 * k)
        end = actual + freewheel_deg
        ideal = Fraction(60 * k + 30)
        # Computed back: the crossing is the ideal one, but known at the end of the freewheeling, 30 degrees of room.
        zcp = max(ideal, end - 30) if back_computed else max(ideal, end)
    return errors


@pytest.mark.parametrize("back_computed", [False, True])
def test_map_is_that_of_the_thesis(back_computed: bool) -> None:
    """The same sequences in exact arithmetic, integers and fractions just beside them included.

    Verifies: THEORY-06
    """
    rng = np.random.default_rng(2)
    cases = [(Fraction(3), Fraction(30)), (Fraction(29, 10), Fraction(15)), (Fraction(31, 10), Fraction(15))]
    cases += [(Fraction(int(rng.integers(100, 700)), 100), Fraction(int(rng.integers(0, 600)), 10)) for _ in range(40)]
    for n, phi in cases:
        exact = np.array([float(e) for e in exact_errors(n, phi, 200, back_computed)])
        found = commutation_errors_deg(float(n), float(phi), 200, back_computed=back_computed)
        assert found == pytest.approx(exact, abs=1e-6), (n, phi)


@pytest.mark.parametrize("back_computed", [False, True])
@pytest.mark.parametrize("carrier_phase", [0.0, 0.37])
def test_boundary(back_computed: bool, carrier_phase: float) -> None:
    """Boundary found by following the map: 60 floor(N) / N - 30, and 30 degrees more with crossings computed back.

    Verifies: THEORY-06
    """
    rng = np.random.default_rng(3)
    n = np.concatenate([rng.uniform(1.0, 8.0, 200), [1.0, 2.0, 3.0, 4.0, 5.0, 2.999, 3.001, 25 / 8, 10 / 3, 29 / 10]])
    found = stable_freewheel_deg(
        n, back_computed=back_computed, carrier_phase=carrier_phase, resolution_deg=RESOLUTION_DEG
    )
    difference = np.abs(found - freewheel_limit_deg(n, back_computed=back_computed))
    print(f"largest difference {difference.max():.4f} deg at N = {n[difference.argmax()]:.4f}")
    assert difference.max() < SEARCH_TOL_DEG


@pytest.mark.parametrize(("n", "limit"), [(2, 0.0), (3, 10.0), (4, 15.0), (5, 18.0)])
def test_boundary_at_integers(n: int, limit: float) -> None:
    """30 degrees at an integer; just below 2, 3, 4, 5 only 0, 10, 15, 18 degrees.

    Verifies: THEORY-06
    """
    assert float(freewheel_limit_deg(n)) == 30.0
    assert float(freewheel_limit_deg(n - 1e-6)) == pytest.approx(limit, abs=1e-4)
    assert float(stable_freewheel_deg(float(n))) == pytest.approx(30.0, abs=RESOLUTION_DEG)
    assert float(stable_freewheel_deg(n - 1e-3)) == pytest.approx(limit, abs=SEARCH_TOL_DEG)


def test_examples_of_figure_5_7() -> None:
    """15 degrees: unbounded at N = 2.9, bounded at 3.1; computed back, bounded at both.

    Verifies: THEORY-06
    """
    assert not is_stable(2.9, 15.0) and is_stable(3.1, 15.0)
    assert is_stable(2.9, 15.0, back_computed=True)
    assert commutation_errors_deg(2.9, 15.0, 100)[-1] > 180.0
    for n, back in ((2.9, True), (3.1, False)):
        assert commutation_errors_deg(n, 15.0, 1000, back_computed=back).max() < 60.0 / n


def test_without_the_carriers_delay() -> None:
    """CSC and NSC: 30 degrees at every N, 60 with crossings computed back; no error below.

    Verifies: THEORY-06
    """
    n = np.linspace(1.0, 6.0, 51)
    for back, limit in ((False, 30.0), (True, 60.0)):
        found = stable_freewheel_deg(n, commutation="CSC", back_computed=back, resolution_deg=RESOLUTION_DEG)
        assert np.abs(found - limit).max() < SEARCH_TOL_DEG
        assert np.all(commutation_errors_deg(n, limit - 0.1, 100, commutation="NSC", back_computed=back) == 0.0)


def test_too_few_carriers() -> None:
    """Below one carrier a sector the map of RSC has no meaning.

    Verifies: THEORY-06
    """
    with pytest.raises(ValueError, match="at least 1"):
        is_stable(0.9, 10.0)
