# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Six-step behind a filter that is slower than a sample."""

from __future__ import annotations

from tests.closed_loop.support import drive

POLE = "inverter.sensing.divider_pole_s=1e-6"
EVENTS = 'event=[{at_s=0.003,command="set speed_rpm 6000"},{at_s=0.004,command="start"}]'
STEADY = 'window=[{name="steady",from_s=0.025,to_s=0.04}]'


def test_a_slow_divider_makes_no_crossings() -> None:
    """A spindle that turns is caught and held: every sector long enough, no trip, crossings within 0.25 degrees rms.

    With one sample after a diode's clamp the answer of the divider was a crossing, 40 degrees early: over-current.

    Verifies: FRONT-95
    """
    run = drive(
        "own-spindle.toml",
        "slow-divider",
        POLE,
        EVENTS,
        STEADY,
        "initial.speed_rpm=6000",
        "expect=[]",
        "duration_s=0.04",
    )
    assert run.result["trips"] == []
    steady = run.metrics["steady"]
    assert steady["commutation_interval_deg"]["min"] > 59.0
    assert steady["commutation_error_deg"]["rms"] < 0.25
    assert steady["late_crossings"] == 0
