# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Correction B: thresholds that learn divider gains and inductances."""

from __future__ import annotations

from collections.abc import Iterator

from fluxlock.theory.six_step.unequal import (
    commutation_intervals_deg,
    crossing_intervals_deg,
    sector_errors_deg,
)
from fluxverify.regression.case import Condition, Number, Row, case
from fluxverify.regression.runner import Runner
from fluxverify.regression.six_step.measures import (
    Limits,
    commutation_intervals,
    crossing_intervals,
    event,
    extremes_about,
    interval_values,
    line_drop_v,
    printed_thresholds,
    timeline,
)

CONDITIONS: dict[str, Condition] = {
    "motor": "Motor-II",
    "supply_v": 15,
    "carrier_hz": 40_000,
    "divider_gain": "1.10/1.00/0.90",
    "fan_mnm_at_54000": 16,
}
SPEED_RPM = 20_000
# Of a crossing interval, from what the theory gives.
ALLOWED_DEG = 0.7
THRESHOLD_PU = {"A": 0.550, "C": 0.450}
# Sectors in which a phase floats.
SECTORS = {"A": (2, 5), "B": (1, 4), "C": (0, 3)}


def _phase_thresholds(pu: tuple[float, ...]) -> dict[str, Number]:
    """Mean threshold of each phase's two sectors (its divider), and half their difference (its neighbours)."""
    if len(pu) != 6:
        return {f"threshold_pu.{phase}": None for phase in SECTORS}
    means: dict[str, Number] = {f"threshold_pu.{x}": (pu[s] + pu[t]) / 2 for x, (s, t) in SECTORS.items()}
    return means | {f"difference_pu.{x}": (pu[t] - pu[s]) / 2 for x, (s, t) in SECTORS.items()}


@case("six-step/balance")
def balance(runner: Runner) -> Iterator[Row]:
    """Divider gains 1.10, 1.00, 0.90: the thresholds learn them, and with them the machine's asymmetry."""
    modes = ("both",) if runner.quick else ("none", "vertical", "both")
    times = [
        "drive.zcd.balance=both",
        *timeline(
            0.30,
            [
                event(0.003, "speed_rpm", SPEED_RPM),
                event(0.004, "command", "start"),
                event(0.29, "command", "get threshold_pu"),
            ],
            [("both", 0.22, 0.29)],
        ),
    ]
    run = runner.drive("six-step/balance.toml", "modes", *(times if runner.quick else ()))
    for mode in modes:
        values: dict[str, Number] = {
            **interval_values(crossing_intervals(run, mode), "crossing_interval_deg"),
            **interval_values(commutation_intervals(run, mode), "commutation_interval_deg"),
            "phase_current_pp_a": run.metrics[mode]["phase_current_pp_a"],
            "speed_rpm.mean": run.metrics[mode]["speed_rpm"]["mean"],
            "trips": len(run.result["trips"]),
        }
        limits: Limits = {"trips": (0, 0), "speed_rpm.mean": (0.99 * SPEED_RPM, 1.01 * SPEED_RPM)}
        if mode == "both":
            values |= _phase_thresholds(printed_thresholds(run))
            limits |= extremes_about((60.0,), ALLOWED_DEG, "crossing_interval_deg")
            limits["crossing_interval_deg.rms"] = (None, 0.25)
            limits |= {f"threshold_pu.{x}": (pu - 0.005, pu + 0.005) for x, pu in THRESHOLD_PU.items()}
        else:
            # Vertical correction leaves what the phases' inductances do; without correction the dividers add theirs.
            gains = run.scenario.inverter.sensing.divider_gain if mode == "none" else (1.0, 1.0, 1.0)
            supply_v = run.scenario.inverter.supply_v
            errors = sector_errors_deg(run.scenario.motor, supply_v, SPEED_RPM, gains, line_drop_v(run, mode))
            limits |= extremes_about(crossing_intervals_deg(errors), ALLOWED_DEG, "crossing_interval_deg")
            # 3/2 of an interval less 1/2 of the one before: of their deviations, up to twice.
            limits |= extremes_about(commutation_intervals_deg(errors), 2 * ALLOWED_DEG, "commutation_interval_deg")
        conditions = CONDITIONS | {"speed_rpm": SPEED_RPM, "balance": mode}
        yield Row(f"six-step/balance/{mode}", conditions, values, limits)


@case("six-step/balance-ramp")
def balance_ramp(runner: Runner) -> Iterator[Row]:
    """From 18 000 to 54 000 r/min and back: the crossings stay even while the thresholds follow."""
    low_rpm, top_rpm, accel_rpm_per_s = (42_000, 54_000, 120_000) if runner.quick else (18_000, 54_000, 12_000)
    times = (
        timeline(
            0.46,
            [
                event(0.003, "speed_rpm", low_rpm),
                event(0.004, "command", "start"),
                event(0.20, "speed_rpm", top_rpm),
                event(0.33, "speed_rpm", low_rpm),
            ],
            [("up", 0.20, 0.33), ("down", 0.33, 0.45)],
        )
        if runner.quick
        else []
    )
    run = runner.drive(
        "six-step/balance-ramp.toml",
        "ramp",
        f"initial.speed_rpm={low_rpm}",
        f"drive.accel_rpm_per_s={accel_rpm_per_s}",
        *times,
    )
    for window in ("up", "down"):
        yield Row(
            f"six-step/balance-ramp/{window}",
            CONDITIONS
            | {"low_rpm": low_rpm, "top_rpm": top_rpm, "accel_rpm_per_s": accel_rpm_per_s, "balance": "both"},
            {
                **interval_values(crossing_intervals(run, window), "crossing_interval_deg"),
                **interval_values(commutation_intervals(run, window), "commutation_interval_deg"),
                "speed_rpm.min": run.metrics[window]["speed_rpm"]["min"],
                "speed_rpm.max": run.metrics[window]["speed_rpm"]["max"],
                "trips": len(run.result["trips"]),
            },
            {
                "crossing_interval_deg.min": (59.0, None),
                "crossing_interval_deg.max": (None, 61.0),
                "speed_rpm.min": (None, 1.02 * low_rpm),
                "speed_rpm.max": (0.99 * top_rpm, None),
                "trips": (0, 0),
            },
        )
