"""Highest electrical frequency (a machine of low inductance and flux)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fluxlock.regression.case import Row, case
from fluxlock.regression.runner import Runner

SCENARIO = "six-step/highest-speed.toml"
# A quarter of a sector; a missed crossing or a skipped sector is a whole one off.
WRONG_DEG = 15.0


@case("six-step/highest-speed")
def highest_speed(runner: Runner) -> Iterator[Row]:
    """10 kHz electrical, 600 000 r/min of two poles, held for 0.2 s without a wrong commutation."""
    short = ("duration_s=0.2", "window.held.to_s=0.2") if runner.quick else ()
    run = runner.drive(SCENARIO, "held", *short)
    clock_hz, window = run.data.clock_hz, run.scenario.window[0]
    commutations = run.analysis.commutations.between(window.from_s * clock_hz, window.to_s * clock_hz)
    metrics = run.metrics["held"]
    hz_per_rpm = run.scenario.motor.pole_pairs / 60
    steps = commutations.intervals_deg()
    yield Row(
        "six-step/highest-speed/held",
        {
            "motor": run.scenario.motor.name,
            "supply_v": run.scenario.inverter.supply_v,
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
            "lowest_hz": (10_000, None),
            "wrong_commutations": (0, 0),
            "largest_interval_deg": (None, 60 + WRONG_DEG),
            "commutations": (round(0.99 * 60_000 * (window.to_s - window.from_s)), None),
            "trips": (0, 0),
        },
    )
