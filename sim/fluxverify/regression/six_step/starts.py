# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Starts from standstill."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from fluxlock.cosim.outcome import Run
from fluxlock.results.rundata import LogKind
from fluxverify.regression.case import Row, case
from fluxverify.regression.runner import Runner
from fluxverify.regression.six_step.support import locked

START_SEEDS = (1, 2, 3)
STARTS, QUICK_STARTS = 100, 1
# A field turns the rotor the shorter way, by half a turn at most. A swing about it, counted from the foremost angle, is
# no wider than twice what it began with; a whole turn backward is no alignment any more. Once the field steps forward
# the rotor may swing about it, but not fall back a sector.
ALIGNING_DEG, STARTING_DEG = 360.0, 60.0
# A retry begins with the gates off until the rotor is calm, 8 control ticks at least (COAST_CALM_TICKS); what a running
# drive leaves open is shorter than a tick.
RETRY_OFF_S = 200e-6
NOTE = (
    "The speed at the end is above the target of 15 000 r/min: without synchronous rectification the pulses at the "
    "lower limit of the voltage carry as much torque as the fan takes there (docs/theory/six-step-limits.md)."
)


def backward_deg(run: Run) -> tuple[float, float]:
    """Farthest turn back from the foremost angle so far: until the first forced commutation, and from it on."""
    records = run.data.records
    angle = np.degrees(records["theta_e"])
    commutations = run.data.rows(LogKind.COMMUTATION)[:, 0]
    split = int(np.searchsorted(records["t_cycle"], commutations[0])) if commutations.size else angle.size
    aligning, starting = angle[:split], angle[split:]
    back = [float(np.max(np.maximum.accumulate(part) - part, initial=0.0)) for part in (aligning, starting)]
    return back[0], back[1]


def retries(run: Run) -> int:
    """Attempts after the first one: spans without gates between the first gate on and the last."""
    gates = run.gates()
    on = np.flatnonzero(gates[:, 1])
    if not on.size:
        return 0
    gates = gates[on[0] : on[-1] + 1]
    off = np.flatnonzero(gates[:-1, 1] == 0)
    lengths = (gates[off + 1, 0] - gates[off, 0]) / run.data.clock_hz
    return int(np.count_nonzero(lengths > RETRY_OFF_S))


@dataclass(frozen=True)
class _Start:
    """What counts of one start."""

    locked: bool
    trips: int
    retries: int
    final_speed_rpm: float
    backward_deg: tuple[float, float]


def _start(run: Run) -> _Start:
    return _Start(
        locked(run),
        len(run.result["trips"]),
        retries(run),
        run.metrics["locked"]["speed_rpm"]["mean"],
        backward_deg(run),
    )


def starts(runner: Runner, seed: int) -> Iterator[Row]:
    """Starts from random rotor angles: every one locks, in the right direction, without a trip."""
    count = QUICK_STARTS if runner.quick else STARTS
    angles = np.random.default_rng(seed).uniform(0, 360, count)
    found = [
        _start(runner.drive("six-step/start.toml", f"{i}", f"initial.theta_deg={angle:.2f}", seed=seed))
        for i, angle in enumerate(angles)
    ]
    speeds_rpm = [start.final_speed_rpm for start in found]
    yield Row(
        f"six-step/starts/seed-{seed}",
        {"motor": "Motor-I", "load": "fan 20 mN*m at 60 000 r/min", "seed": seed, "starts": count},
        {
            "locks": sum(start.locked for start in found),
            "retries": sum(start.retries for start in found),
            "trips": sum(start.trips for start in found),
            "final_speed_rpm.min": min(speeds_rpm),
            "final_speed_rpm.max": max(speeds_rpm),
            "backward_aligning_deg": max(start.backward_deg[0] for start in found),
            "backward_starting_deg": max(start.backward_deg[1] for start in found),
        },
        {
            "locks": (count, count),
            "retries": (0, 0),
            "trips": (0, 0),
            "backward_aligning_deg": (None, ALIGNING_DEG),
            "backward_starting_deg": (None, STARTING_DEG),
        },
        NOTE,
    )


for start_seed in START_SEEDS:
    case(f"six-step/starts/seed-{start_seed}", long=True)(functools.partial(starts, seed=start_seed))
