# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Machines held by injection on the whole chip: angle errors in degrees, from a rest that the drive does not know."""

from __future__ import annotations

import numpy as np

from fluxlock.cosim.native_firmware import NativeFirmware
from fluxlock.cosim.outcome import Run
from fluxverify.regression.six_step.measures import event, timeline
from tests.closed_loop.support import drive
from tests.closed_loop.test_native_firmware import speed_rpm, states


def started(end_s: float, settled_s: float, rpm: float) -> list[str]:
    """Overrides of a short run with the window `steady`."""
    events = [event(0.002, "speed_rpm", rpm), event(0.004, "command", "start")]
    return [*timeline(end_s, events, [("steady", settled_s, end_s)]), "expect=[]"]


def turned_deg(run: Run, until_s: float) -> float:
    """Largest mechanical angle from where the rotor stood."""
    records = run.data.records[run.data.records["t_cycle"] < until_s * run.data.clock_hz]
    turned = np.degrees(records["theta_e"] - records["theta_e"][0]) / run.data.pole_pairs
    return float(np.abs(turned).max())


def judged(run: Run, mean_deg: float, most_deg: float) -> None:
    """No trip, and the angle error of the window within limits."""
    assert run.result["trips"] == [] and run.data.fault is None
    error = run.metrics["steady"]["angle_error_deg"]
    assert error["mean"] is not None and abs(error["mean"]) <= mean_deg
    assert error["max"] <= most_deg


def test_five_phases_by_separator() -> None:
    """Yu's machine: unknown angle and polarity found within 50 ms and 1 degree, then faster by the ramp.

    The same C in the simulator's process does as the core does.

    Verifies: INJC-10, SYS-13
    """
    short = [*started(0.13, 0.06, 150), "inverter.dead_time_s=0"]
    core = drive("five-phase/yu.toml", "injection-yu", *short)
    native = drive("five-phase/yu.toml", "injection-yu-native", *short, native=NativeFirmware())
    for run in (core, native):
        judged(run, 0.3, 1.5)
        assert turned_deg(run, 0.054) <= 1.0
        assert run.metrics["steady"]["speed_rpm"]["max"] > 20
        assert not run.verdict.failures and run.data.overruns == 0
    assert states(native.data) == states(core.data)
    t_s = np.linspace(0.0, 0.12, 121)
    apart = np.abs(speed_rpm(native.data, t_s) - speed_rpm(core.data, t_s))
    a, b = (run.metrics["steady"]["angle_error_deg"] for run in (core, native))
    print(f"speeds are apart by at most {apart.max():.2f} r/min; angle error {a}, {b}")
    assert apart.max() < 0.02 * 150
    assert abs(a["mean"] - b["mean"]) < 0.3 and abs(a["rms"] - b["rms"]) < 0.3
