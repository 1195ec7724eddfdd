# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Six-step operation and vector control of the same machine."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fluxlock.cosim.outcome import Run
from fluxverify.regression.case import Row, case
from fluxverify.regression.runner import Runner
from fluxverify.regression.six_step.measures import event, timeline

SPEED_RPM, QUICK_RPM = 60_000, 20_000
SPEED_SHARE = 0.005
END_S = 0.15
METHODS = (("six-step", "six-step/patterns.toml", ("drive.sync_rect=true",)), ("vector", "vector/start.toml", ()))
LOAD = ("load.fan_torque_nm=0.02", "load.fan_speed_rpm=60000")


def current_rms_a(run: Run, window: str) -> float:
    """Rms of the phase currents in a window, over the three phases."""
    span = next(w for w in run.scenario.window if w.name == window)
    records, clock_hz = run.data.records, run.data.clock_hz
    inside = (records["t_cycle"] >= span.from_s * clock_hz) & (records["t_cycle"] < span.to_s * clock_hz)
    return float(np.sqrt(np.mean([np.mean(records[name][inside] ** 2) for name in ("ia", "ib", "ic")])))


def _row(run: Run, method: str, speed_rpm: int) -> Row:
    window = run.metrics["steady"]
    return Row(
        f"vector/method/{method}",
        {
            "motor": "Motor-I",
            "load": "fan 20 mN*m at 60 000 r/min",
            "method": method,
            "carrier_hz": run.scenario.drive.carrier_hz,
            "speed_rpm": speed_rpm,
        },
        {
            "speed_rpm.mean": window["speed_rpm"]["mean"],
            "phase_current_rms_a": current_rms_a(run, "steady"),
            "torque_mnm.mean": 1000 * window["torque_nm"]["mean"],
            "torque_mnm.ripple_pp": 1000 * window["torque_nm"]["ripple_pp"],
            "trips": len(run.result["trips"]),
        },
        {"speed_rpm.mean": ((1 - SPEED_SHARE) * speed_rpm, (1 + SPEED_SHARE) * speed_rpm), "trips": (0, 0)},
    )


@case("vector/method")
def method(runner: Runner) -> Iterator[Row]:
    """`drive.method` chooses on the same machine: speed held, phase current and torque of both."""
    speed_rpm = QUICK_RPM if runner.quick else SPEED_RPM
    # The rotor turns already: either method catches it.
    events = [event(0.003, "speed_rpm", speed_rpm), event(0.004, "command", "start")]
    for name, scenario, settings in METHODS:
        run = runner.drive(
            scenario,
            name,
            f"initial.speed_rpm={speed_rpm}",
            "record.period_s=2e-6",
            "expect=[]",
            *settings,
            *timeline(END_S, events, [("steady", END_S - 0.03, END_S)]),
            *LOAD,
        )
        yield _row(run, name, speed_rpm)
