# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A rotor that turns when the vector drive is started."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fluxlock.cosim.outcome import Run
from fluxverify.regression.case import Row, case
from fluxverify.regression.runner import Runner
from fluxverify.regression.six_step.measures import console_word, event, timeline
from fluxverify.regression.vector.frames import angle_errors_deg, rms

SCENARIO = "vector/start.toml"
SPEEDS_RPM, QUICK_RPM = (20_000, 60_000, -60_000, 90_000), (60_000,)
SPEED_SHARE = 0.01
START_S, LOCKED_S, END_S = 0.004, 0.024, 0.09
RMS_DEG, MAX_DEG = 1.0, 5.0  # as in the whole sequence


def _peak_a(run: Run, until_s: float) -> float:
    """Largest phase current until then."""
    records = run.data.records
    early = records[records["t_cycle"] < until_s * run.data.clock_hz]
    return max(float(np.abs(early[name]).max()) for name in ("ia", "ib", "ic"))


@case("vector/catch", tested=True)
def catch(runner: Runner) -> Iterator[Row]:
    """A spinning rotor is caught by its terminal voltages: angle from 20 ms after the start on, speed held."""
    for speed_rpm in QUICK_RPM if runner.quick else SPEEDS_RPM:
        events = [
            event(0.003, "command", f"set speed_rpm {speed_rpm}"),
            event(START_S, "command", "start"),
            event(END_S - 0.005, "command", "get catches"),
        ]
        run = runner.drive(
            SCENARIO,
            f"{speed_rpm}",
            f"initial.speed_rpm={speed_rpm}",
            "initial.theta_deg=100",
            "expect=[]",
            *timeline(END_S, events, [("end", END_S - 0.02, END_S)]),
        )
        errors = angle_errors_deg(run, (LOCKED_S, END_S))
        end_rpm = run.metrics["end"]["speed_rpm"]["mean"]
        yield Row(
            f"vector/catch/{speed_rpm}",
            {"motor": "Motor-I", "load": "fan 20 mN*m at 60 000 r/min", "carrier_hz": 20_000, "speed_rpm": speed_rpm},
            {
                "angle_error_deg.rms": rms(errors),
                "angle_error_deg.max": float(np.abs(errors).max()),
                "phase_current_a.max": _peak_a(run, LOCKED_S),
                "speed_over_wanted": None if end_rpm is None else end_rpm / speed_rpm,
                "catches": int(console_word(run, "catches") or 0),
                "trips": len(run.result["trips"]),
            },
            {
                "angle_error_deg.rms": (None, RMS_DEG),
                "angle_error_deg.max": (None, MAX_DEG),
                "speed_over_wanted": (1 - SPEED_SHARE, 1 + SPEED_SHARE),
                "catches": (1, 1),
                "trips": (0, 0),
            },
        )
