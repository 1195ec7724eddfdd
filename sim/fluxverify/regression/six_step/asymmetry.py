# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Machines whose phases differ in EMF or mutual inductance (left open by the thesis, ch. 8)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fluxlock.base.paths import ROOT
from fluxlock.cosim.outcome import Run
from fluxlock.theory.six_step.recording import torque_lines, whole_turns
from fluxverify.regression.case import Condition, Number, Row, case
from fluxverify.regression.runner import Runner
from fluxverify.regression.six_step.measures import (
    Limits,
    commutation_intervals,
    event,
    interval_values,
    phase_crossing_errors,
    printed_thresholds,
    theory_errors,
    timeline,
)

MACHINES = {"equal": "motor-1.toml", "emf": "motor-1-weak-phase.toml", "mutual": "motor-1-mutual.toml"}
SPEED_RPM = 40_130
# A sample of 1 us: what crossings may be off the theory.
SAMPLE_DEG = 1e-6 * 6 * SPEED_RPM
# Corrections in force in the windows of the scenario.
WINDOWS = {"none": (False, "none"), "a": (True, "none"), "b": (False, "both"), "both": (True, "both")}
# What the corrections must reach elsewhere: A at this speed with 5 uH in a phase (six-step/correction-a), B with
# unequal dividers (six-step/balance). Deviation of an interval from 60 deg, largest and rms.
CORRECTED_DEG = {"a": (0.4, 0.2), "b": (0.7, 0.25), "both": (0.4, 0.2)}


def _torque_second_harmonic_nm(run: Run, window: str) -> float:
    """Amplitude of the torque at twice the electrical frequency: what unequal EMFs leave with even commutations."""
    span = next(w for w in run.scenario.window if w.name == window)
    turns = whole_turns(run.data, span.from_s, span.to_s)
    return float(2 * np.abs(torque_lines(run.data, turns, np.array([2.0])).amplitude[0]))


@case("six-step/asymmetry")
def asymmetry(runner: Runner) -> Iterator[Row]:
    """One EMF 5 % low, or unequal mutual inductances: what corrections A and B leave of the error."""
    for kind, motor in MACHINES.items():
        if kind == "equal" and runner.quick:
            continue
        times = [
            event(0.003, "speed_rpm", SPEED_RPM),
            event(0.004, "command", "start"),
            event(0.11, "command", "set correction_a 1"),
        ]
        short: list[str] = []
        windows = tuple(WINDOWS)
        if kind == "equal":
            windows = ("none",)
            short = timeline(0.20, times[:2], [("none", 0.15, 0.20)])
        elif runner.quick:
            windows = ("none", "a")
            short = timeline(0.17, times, [("none", 0.08, 0.11), ("a", 0.14, 0.17)])
        run = runner.drive("six-step/asymmetry.toml", kind, f"motor={ROOT / 'motors' / motor}", *short)
        for window in windows:
            a, b = WINDOWS[window]
            error = run.metrics[window]["commutation_error_deg"]
            values: dict[str, Number] = {
                "commutation_error_deg.mean": error["mean"],
                "commutation_error_deg.rms": error["rms"],
                "commutation_error_deg.max": error["max"],
                **interval_values(commutation_intervals(run, window), "commutation_interval_deg"),
                "phase_current_pp_a": run.metrics[window]["phase_current_pp_a"],
                "torque_2fe_mnm": 1000 * _torque_second_harmonic_nm(run, window),
                "trips": len(run.result["trips"]),
            }
            values |= phase_crossing_errors(run, window)
            theory: dict[str, Number] = {}
            if b == "none":
                theory = theory_errors(run, window, SPEED_RPM)
                values |= theory
            if window == "both":
                values |= {f"threshold_pu.{n}": pu for n, pu in enumerate(printed_thresholds(run), 1)}
            limits: Limits = {"trips": (0, 0)}
            if b == "none":
                for name, late_deg in theory.items():
                    allowed = (float(late_deg or 0.0) - SAMPLE_DEG, float(late_deg or 0.0) + SAMPLE_DEG)
                    limits[name.replace("_theory", "")] = allowed
            if window in CORRECTED_DEG:
                most_deg, rms_deg = CORRECTED_DEG[window]
                limits["commutation_interval_deg.min"] = (60 - most_deg, None)
                limits["commutation_interval_deg.max"] = (None, 60 + most_deg)
                limits["commutation_interval_deg.rms"] = (None, rms_deg)
            conditions: dict[str, Condition] = {
                "motor": run.scenario.motor.name,
                "supply_v": 15,
                "carrier_hz": 40_000,
                "speed_rpm": SPEED_RPM,
                "correction_a": a,
                "balance": b,
            }
            yield Row(f"six-step/asymmetry/{kind}-{window}", conditions, values, limits)
