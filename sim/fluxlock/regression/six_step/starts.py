"""Starts from standstill."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fluxlock.cosim.outcome import Outcome
from fluxlock.regression.case import Row, case
from fluxlock.regression.runner import Runner

START_SEEDS = (1, 2, 3)
LOCKED_RMS_DEG = 1.0


def locked(run: Outcome) -> bool:
    """Whether the crossings carry the machine at the end: forward, commutations within 1 degree rms, no trip."""
    window = run.metrics["locked"]
    rms_deg = window["commutation_error_deg"]["rms"]
    forward = window["speed_rpm"]["min"] > 0
    return not run.result["trips"] and forward and rms_deg is not None and rms_deg < LOCKED_RMS_DEG


@case("six-step/starts")
def starts(runner: Runner) -> Iterator[Row]:
    """Starts from random rotor angles: every one locks, in the right direction, without a trip."""
    count = 1 if runner.quick else 100
    seeds = START_SEEDS[:1] if runner.quick else START_SEEDS
    for seed in seeds:
        angles = np.random.default_rng(seed).uniform(0, 360, count)
        runs = [
            runner.drive("six-step/start.toml", f"{seed}-{i}", f"initial.theta_deg={angle:.2f}", seed=seed)
            for i, angle in enumerate(angles)
        ]
        good = sum(locked(run) for run in runs)
        yield Row(
            f"six-step/starts/seed-{seed}",
            {"motor": "Motor-I", "load": "fan 20 mN*m at 60 000 r/min", "seed": seed, "starts": count},
            {"locks": good, "trips": sum(len(run.result["trips"]) for run in runs)},
            {"locks": (count, count), "trips": (0, 0)},
        )
