# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Commutation errors by place in the carrier, and the margin of demagnetisation."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from fluxlock.results.metrics import Analysis
from fluxlock.results.pwm_phase import BINS, phase_bins, pulse_starts, pwm_phase
from tests.results.synthetic import Drive, make_run


def test_pulses_and_phases() -> None:
    """A pulse begins where the chopping switch joins the other; phases count from there, over a lost beginning too.

    Verifies: FRONT-93
    """
    cycle, gates = [], []
    for k in range(10):
        if k == 5:  # a commutation has swallowed this beginning
            continue
        cycle += [1000 * k, 1000 * k + 400]
        gates += [0b001001, 0b001000]
    starts = pulse_starts(np.array([-10, *cycle]), np.array([0b001000, *gates]))
    assert starts.tolist() == [1000 * k for k in range(10) if k != 5]
    phase = pwm_phase(np.array([-5.0, 250.0, 3999.0, 5500.0, 20_000.0]), starts)
    assert np.isnan(phase[[0, 4]]).all()
    assert phase[1:4] == pytest.approx([0.25, 0.999, 0.5])
    # A commutation moves on inside of a pulse: no beginning.
    assert pulse_starts(np.array([0, 10]), np.array([0b001001, 0b100001])).size == 0


def test_bins() -> None:
    """Each error counts in the bin of its phase; a bin with fewer than two has no mean.

    Verifies: FRONT-93
    """
    phase = np.array([0.0, 0.01, 0.5, 0.51, 0.999, np.nan])
    found = phase_bins(phase, np.array([1.0, 3.0, -1.0, -1.0, 9.0, 50.0]))
    assert found.count.sum() == 5 and found.count[[0, BINS // 2, BINS - 1]].tolist() == [2, 2, 1]
    assert found.mean_deg[0] == 2.0 and found.rms_deg[0] == pytest.approx(np.sqrt(5.0))
    assert found.pp_deg == 3.0 and np.isnan(found.mean_deg[-1])


def test_metric_finds_what_depends_on_the_carrier() -> None:
    """Errors that follow the carrier show their peak-to-peak; equal ones do not.

    Verifies: FRONT-93
    """

    def window(size_deg: float) -> dict[str, Any]:
        # 60 000 r/min and 40 kHz: a sector is 6.67 carriers, so every third commutation is at the same place.
        analysis = Analysis(make_run(Drive(duration_s=0.1, commutation_error=lambda k: size_deg * (k % 3 == 0))))
        # The synthetic drive begins a carrier at each commutation: here the carrier goes on.
        analysis.__dict__["pulses"] = np.arange(0, 5_000_000, 1250)
        return analysis.window(0.005, 0.095)

    flat, waved = window(0.0), window(0.6)
    assert flat["pwm_phase_error_pp_deg"] == pytest.approx(0.0, abs=0.02)
    assert waved["pwm_phase_error_pp_deg"] == pytest.approx(0.6, abs=0.05)


def test_margin_of_demagnetisation() -> None:
    """Freewheeling of 9 degrees leaves 21 of the 30 to the crossing; without commutations there is no margin.

    Verifies: FRONT-93
    """
    data = make_run(Drive(freewheel_deg=9.0))
    assert Analysis(data).window(0.002, 0.018)["demagnetisation_margin_deg"] == pytest.approx(21.0, abs=0.1)
    data.log = data.log[:0]
    empty = Analysis(data).window(0.002, 0.018)
    assert empty["demagnetisation_margin_deg"] is None and empty["pwm_phase_error_pp_deg"] is None
