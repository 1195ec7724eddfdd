# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What a sweep on the twin takes: memory over a thousand runs, time per run, and its overhead by pairs.

`python -m fluxverify.sweep_bench` prints a line for each hundred runs. A pair is the same run by itself and as a point
of a sweep that keeps its results, in turn first; the overhead is the median of their ratio, by processor time.
"""

from __future__ import annotations

import argparse
import resource
import statistics
import sys
import tempfile
import time
from collections.abc import Callable

from fluxlock.api import scenario_of, simulate
from fluxlock.base.writable import guarded
from fluxlock.config import Scenario
from fluxlock.sweeps import Axis, Grid, Row

# A rotor that turns already is caught and held.
POINT = {
    "duration_s": 0.12,
    "initial.speed_rpm": 14_000.0,
    "event": [{"at_s": 0.004, "speed_rpm": 15_000.0}, {"at_s": 0.005, "command": "start"}],
    "window": [{"name": "held", "from_s": 0.08, "to_s": 0.12}],
    "expect": [],
}
EVERY = 100


def peak_mb() -> float:
    """Most memory that this process has held so far."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def long_sweep(scenario: Scenario, runs: int, told: Callable[[str], None]) -> list[float]:
    """Peak memory, MB, after each hundred of so many runs."""
    peaks: list[float] = []
    begin = time.process_time()

    def done(row: Row) -> None:
        count = int(row["point"]) + 1
        if count % EVERY == 0:
            peaks.append(peak_mb())
            told(f"{count} runs: {peaks[-1]:.1f} MB, {1e3 * (time.process_time() - begin) / count:.1f} ms per run")

    Grid.of(scenario, [Axis("seed", tuple(range(1, runs + 1)))]).run(twin=True, done=done)
    return peaks


def overhead(scenario: Scenario, pairs: int) -> list[float]:
    """Processor time of a point of a sweep over that of the same run by itself, less 1, of each pair."""
    found: list[float] = []
    with tempfile.TemporaryDirectory() as folder:

        def by_itself(seed: int) -> None:
            simulate(scenario, twin=True, seed=seed)

        def as_point(seed: int) -> None:
            grid.run(twin=True, seed=seed, folder=folder)

        grid = Grid.of(scenario, [Axis("seed", (1,))])
        for way in (by_itself, as_point):
            way(0)
        for seed in range(1, pairs + 1):
            took = {}
            for way in (by_itself, as_point) if seed % 2 else (as_point, by_itself):
                begin = time.process_time()
                way(seed)
                took[way] = time.process_time() - begin
            found.append(took[as_point] / took[by_itself] - 1.0)
    return found


def error_of_median(found: list[float]) -> float:
    """Standard error of the median, from the distance of the quartiles: other work on the machine leaves outliers."""
    low, _, high = statistics.quantiles(found, n=4)
    return float(1.2533 * (high - low) / 1.349 / len(found) ** 0.5)


def main() -> int:
    """Print what both measure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=1_000, help="runs of the long sweep (default 1000)")
    parser.add_argument("--pairs", type=int, default=40, help="pairs for the overhead (default 40)")
    options = parser.parse_args()
    scenario = scenario_of("scenarios/own-spindle.toml", POINT)
    found = overhead(scenario, options.pairs)
    median, error = (100 * share for share in (statistics.median(found), error_of_median(found)))
    print(f"overhead of a point: median {median:.2f} % +- {error:.2f} % of {options.pairs} pairs", flush=True)
    long_sweep(scenario, options.runs, lambda text: print(text, flush=True))
    return 0


if __name__ == "__main__":
    sys.exit(guarded(main))
