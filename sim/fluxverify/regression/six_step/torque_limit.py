# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Largest torque that holds the lock (chapter 4, and crossings computed back)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fluxlock.cosim.outcome import Run
from fluxlock.theory.six_step.override import SampleTiming
from fluxlock.theory.six_step.patterns import Chopping
from fluxlock.theory.six_step.soa import VISIBLE_DEG, torque_limits
from fluxlock.theory.six_step.switched import real_inverter
from fluxverify.regression.case import LOCK_MAY_GO, Number, Row, case
from fluxverify.regression.runner import Runner
from fluxverify.regression.six_step.measures import Limits

SPEED_RPM = 60_000
BASE_MNM = 20.0
RAMP_FROM_S = 0.08
# An error of half the way to the next crossing in several commutations of a turn: the crossings no longer lead.
LOST_DEG, LOST_COUNT, LOST_OF = 15.0, 3, 6
# What the drive may be off the circuit's angle, which has ideal commutations: a sample (1 us at 60 000 r/min), and the
# error of commutations that is permitted everywhere (six-step/commutation-error). The freewheel angle is nearly
# proportional to the torque; a limit lies at VISIBLE_DEG or beyond, where the same angle is a smaller share.
ANGLE_DEG = 0.36 + 0.3
# The commutations fail within some turns of the rising load: the torque is read so much late.
LATE_TURNS = 3


def lost_at_s(run: Run) -> float | None:
    """Time of the first commutation of the first turn with LOST_COUNT errors above LOST_DEG; None: never lost."""
    commutations = run.analysis.commutations
    after = commutations.cycle > RAMP_FROM_S * run.data.clock_hz
    cycle, wrong = commutations.cycle[after], np.abs(commutations.error_deg[after]) > LOST_DEG
    count = np.convolve(wrong, np.ones(LOST_OF, dtype=np.int64))[: wrong.size]
    found = np.flatnonzero(count >= LOST_COUNT)
    times = [float(cycle[max(0, found[0] - LOST_OF + 1)]) / run.data.clock_hz] if found.size else []
    times += [trip["time_s"] for trip in run.result["trips"] if trip["time_s"] > RAMP_FROM_S]
    return min(times, default=None)


def _load_mnm(time_s: float, end_mnm: float, ramp_s: float) -> float:
    return BASE_MNM + (end_mnm - BASE_MNM) * min(1.0, (time_s - RAMP_FROM_S) / ramp_s)


def _theory(run: Run, pattern: Chopping) -> dict[str, Number]:
    """Limits of the switched circuit at ideal commutations (`fluxlock soa`), mN*m."""
    limits = torque_limits(
        run.scenario.motor,
        real_inverter(run.scenario.inverter),
        np.array([float(SPEED_RPM)]),
        chopping=pattern,
        carrier_hz=run.scenario.drive.carrier_hz,
        timing=SampleTiming(),
        commutation="CSC",
        steps=17,
    )
    return {
        "circuit_seen_mnm": float(1000 * limits.visible_nm[0]),
        "circuit_computed_back_mnm": float(1000 * limits.recovered_nm[0]),
    }


@case("six-step/torque-limit")
def torque_limit(runner: Runner) -> Iterator[Row]:
    """60 000 r/min, 40 kHz, CSC: crossings computed back raise the torque limit of ON-PWM by at least 40 %."""
    limit_mnm: dict[tuple[Chopping, bool], float | None] = {}
    patterns: tuple[Chopping, ...] = ("ON-PWM",) if runner.quick else ("ON-PWM", "PWM-ON")
    for pattern in patterns:
        for back in (False, True):
            end_mnm, ramp_s = 120.0, 0.1 if runner.quick else 0.5
            run = runner.drive(
                "six-step/torque-limit.toml",
                f"{pattern}-{'back' if back else 'seen'}",
                f"drive.pattern={pattern}",
                f"drive.zcd.compute_back={str(back).lower()}",
                f"event[2].load_factor={end_mnm / BASE_MNM}",
                f"event[2].ramp_s={ramp_s}",
                f"duration_s={RAMP_FROM_S + ramp_s + 0.001}",
                accept=dict.fromkeys(LOCK_MAY_GO, "the load rises until the lock is lost"),
            )
            lost_s = lost_at_s(run)
            limit_mnm[pattern, back] = None if lost_s is None else _load_mnm(lost_s, end_mnm, ramp_s)
    for pattern in patterns:
        theory = {} if runner.quick else _theory(run, pattern)
        seen, computed = limit_mnm[pattern, False], limit_mnm[pattern, True]
        limits: Limits = {"ratio": (1.4, None) if pattern == "ON-PWM" else (1.0, None)}
        values: dict[str, Number] = {}
        if theory:
            late_mnm = LATE_TURNS * 60 / SPEED_RPM * (end_mnm - BASE_MNM) / ramp_s
            for name, found in (("seen", seen), ("computed_back", computed)):
                circuit = float(theory[f"circuit_{name}_mnm"] or 0.0)
                key, off_mnm = f"{name}_less_circuit_mnm", circuit * ANGLE_DEG / VISIBLE_DEG
                values[key] = None if found is None else found - circuit
                # Computed back, the circuit supposes the worst wait for a sample: the drive may do better.
                limits[key] = (-off_mnm, off_mnm + late_mnm if name == "seen" else None)
        yield Row(
            f"six-step/torque-limit/{pattern}",
            {
                "motor": "Motor-I",
                "supply_v": 25,
                "speed_rpm": SPEED_RPM,
                "carrier_hz": 40_000,
                "commutation": "CSC",
                "pattern": pattern,
                "ramp_mnm_per_s": round((end_mnm - BASE_MNM) / ramp_s),
            },
            {
                "seen_mnm": seen,
                "computed_back_mnm": computed,
                **theory,
                **values,
                "ratio": None if seen is None or computed is None else computed / seen,
            },
            limits,
        )
