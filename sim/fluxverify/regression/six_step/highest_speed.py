# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Highest electrical frequency (a machine of low inductance and flux)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fluxlock.cosim.outcome import Run
from fluxverify.regression.case import Row, case
from fluxverify.regression.runner import Runner

SCENARIO = "six-step/highest-speed.toml"
# A sixth of the way from a crossing to its commutation; at 10 kHz a sample comes every 3.6 degrees.
WRONG_DEG = 5.0
# Half as fast again: one carrier a sector, and the supply raised on the way, which the EMF calls for. For 50 ms after
# the ramp, while the speed regulator learns what the fan takes more, the speed is up to 0.35 % low.
FURTHEST = (
    "motor.max_speed_rpm=960000",
    "inverter.sensing.voltage_full_scale_v=50",
    "inverter.protection.over_voltage_v=48",
    "load.fan_torque_nm=2e-4",
    "load.fan_speed_rpm=600000",
    'event=[{at_s=0.003, speed_rpm=600000}, {at_s=0.004, command="start"}, '
    "{at_s=0.1, supply_v=36, ramp_s=0.02}, {at_s=0.12, speed_rpm=950000}]",
    "window.held.from_s=0.22",
    "window.held.to_s=0.25",
    "duration_s=0.25",
)


@case("six-step/highest-speed")
def highest_speed(runner: Runner) -> Iterator[Row]:
    """10 kHz electrical, 600 000 r/min of two poles, held for 0.2 s without a wrong commutation."""
    short = ("duration_s=0.2", "window.held.to_s=0.2") if runner.quick else ()
    yield _row("held", runner.drive(SCENARIO, "held", *short), 10_000)
    if not runner.quick:
        yield _row("furthest", runner.drive(SCENARIO, "furthest", *FURTHEST), 15_800)


def _row(name: str, run: Run, least_hz: float) -> Row:
    clock_hz, window = run.data.clock_hz, run.scenario.window[0]
    # Behind the last record there is no angle.
    end = min(window.to_s * clock_hz, run.analysis.track.last_cycle)
    commutations = run.analysis.commutations.between(window.from_s * clock_hz, end)
    metrics = run.metrics[window.name]
    hz_per_rpm = run.scenario.motor.pole_pairs / 60
    steps = commutations.intervals_deg()
    supplies = [event.supply_v for event in run.scenario.events_in_order() if event.supply_v is not None]
    return Row(
        f"six-step/highest-speed/{name}",
        {
            "motor": run.scenario.motor.name,
            "supply_v": [run.scenario.inverter.supply_v, *supplies][-1],
            "carrier_hz": run.scenario.drive.carrier_hz,
            "sample_s": run.scenario.inverter.sensing.sample_period_s,
            "held_s": round(window.to_s - window.from_s, 6),
        },
        {
            "lowest_hz": metrics["speed_rpm"]["min"] * hz_per_rpm,
            "commutations": commutations.cycle.size,
            "wrong_commutations": int(np.sum(np.abs(commutations.error_deg) > WRONG_DEG)),
            "largest_interval_deg": float(steps.max()),
            "commutation_error_deg.mean": metrics["commutation_error_deg"]["mean"],
            "commutation_error_deg.rms": metrics["commutation_error_deg"]["rms"],
            "commutation_error_deg.max": metrics["commutation_error_deg"]["max"],
            "late_crossings": metrics["late_crossings"],
            "trips": len(run.result["trips"]),
        },
        {
            "lowest_hz": (least_hz, None),
            "wrong_commutations": (0, 0),
            "largest_interval_deg": (None, 60 + WRONG_DEG),
            "commutations": (round(0.99 * 6 * least_hz * (window.to_s - window.from_s)), None),
            "trips": (0, 0),
        },
    )
