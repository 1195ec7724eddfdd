"""Starts from standstill."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fluxlock.regression.case import Row, case
from fluxlock.regression.runner import Runner
from fluxlock.regression.six_step.support import locked

START_SEEDS = (1, 2, 3)


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
