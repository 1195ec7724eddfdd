# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Commutation error over speed, method and wrong motor values (chapters 2 and 3)."""

from __future__ import annotations

from collections.abc import Iterator

from fluxverify.regression.case import LOCK_MAY_GO, Condition, Number, Row, case
from fluxverify.regression.runner import Runner

SCENARIO = "six-step/commutation-error.toml"
# Above the speed of the motor file; 25 V suffice: docs/theory/six-step-limits.md.
TOP_RPM = 125_000
LIMIT_DEG = 0.3
SPEEDS_RPM = (20_000, 40_000, 60_000, 80_000, 100_000, 120_000)
ERROR_SPEEDS_RPM, SINGLE_RPM = (20_000, 60_000, 120_000), 60_000  # all wrong at each, single ones at one
# Averaging and computing back use the flux that the firmware is told.
USING_FLUX = "averaged-back"
# Name of a row -> keys of drive.zcd. Once a carrier there is nothing but the first sample after the crossing.
METHODS = {
    "interpolated": {"method": "interpolated"},
    "averaged": {"method": "averaged"},
    USING_FLUX: {"method": "averaged", "compute_back": "true"},
    "first": {"method": "first"},
    "once-a-carrier": {"method": "first", "sampling": "carrier"},
}
# The limit cycle of a sample a carrier is 12 degrees wide at 80 000 r/min, 15 at 100 000.
ONCE_HELD_RPM = 80_000
ONCE_NOTE = "one sample per carrier may lose the lock, and catch the rotor again on its way"
QUANTITIES = {"R": "resistance", "L": "inductance", "psi": "flux"}
MIXED = {"R": 0.8, "L": 1.2, "psi": 0.8}


def _window(quick: bool) -> tuple[str, ...]:
    return ("duration_s=0.1", "window.steady.from_s=0.07", "window.steady.to_s=0.1") if quick else ()


def _row(runner: Runner, speed_rpm: int, method: str, factors: dict[str, float]) -> Row:
    """One run. factors: quantity of the firmware's motor over the machine's, by the names of QUANTITIES."""
    wrong = "-".join(f"{name}{100 * (factor - 1):+.0f}%" for name, factor in factors.items())
    name = f"{speed_rpm}-{method}" + (f"-{wrong}" if wrong else "")
    run = runner.drive(
        SCENARIO,
        name,
        *_window(runner.quick),
        f"motor.max_speed_rpm={TOP_RPM}",
        f"initial.speed_rpm={speed_rpm}",
        f"event[0].speed_rpm={speed_rpm}",
        *(f"drive.zcd.{key}={value}" for key, value in METHODS[method].items()),
        # Records come with samples.
        *(("record.period_s=1e-6",) if method == "once-a-carrier" else ()),
        *(f"drive.motor_error.{QUANTITIES[key]}={factor}" for key, factor in factors.items()),
        accept=dict.fromkeys((*LOCK_MAY_GO, "speed"), ONCE_NOTE) if method == "once-a-carrier" else None,
    )
    steady = next(window for window in run.scenario.window if window.name == "steady")
    window = run.metrics["steady"]
    error = window["commutation_error_deg"]
    values: dict[str, Number] = {
        "commutation_error_deg.mean": error["mean"],
        "commutation_error_deg.rms": error["rms"],
        "commutation_error_deg.max": error["max"],
        "speed_rpm.mean": window["speed_rpm"]["mean"],
        "trips": len(run.result["trips"]),
    }
    conditions: dict[str, Condition] = {
        "motor": "Motor-I",
        "supply_v": 25,
        "constant_mnm": 10,
        "carrier_hz": 40_000,
        "speed_rpm": speed_rpm,
        "method": method,
        **({"firmware": wrong} if wrong else {}),
    }
    limits: dict[str, tuple[float | None, float | None]] = {
        "trips": (0, 0),
        "speed_rpm.mean": (0.995 * speed_rpm, 1.005 * speed_rpm),
    }
    note = ""
    if method == "once-a-carrier":
        values["trips.window"] = sum(steady.from_s <= trip["time_s"] <= steady.to_s for trip in run.result["trips"])
        if speed_rpm > ONCE_HELD_RPM:
            limits = {"trips": (1, None)}
            note = "late by up to a carrier from sector to sector: does not hold the lock"
        else:
            limits = {"trips.window": (0, 0), "speed_rpm.mean": limits["speed_rpm.mean"]}
            note = "late by up to a carrier from sector to sector: may lose the lock while it catches, then holds it"
    # The others are there for comparison; a wrong flux bends the averages, by how much is shown.
    if method in ("interpolated", "averaged") or (method == USING_FLUX and not factors):
        limits["commutation_error_deg.mean"] = (-LIMIT_DEG, LIMIT_DEG)
        limits["commutation_error_deg.rms"] = (None, LIMIT_DEG)
    return Row(f"six-step/commutation-error/{name}", conditions, values, limits, note)


@case("six-step/commutation-error")
def commutation_error(runner: Runner) -> Iterator[Row]:
    """20 000 to 120 000 r/min, 25 V, 10 mN*m: mean and rms within 0.3 degrees, also with wrong motor values."""
    if runner.quick:
        yield _row(runner, 20_000, "interpolated", {})
        yield _row(runner, 60_000, "once-a-carrier", {})
        return
    for speed_rpm in SPEEDS_RPM:
        for method in METHODS:
            yield _row(runner, speed_rpm, method, {})
    for speed_rpm in ERROR_SPEEDS_RPM:
        for factors in (dict.fromkeys(QUANTITIES, 0.8), dict.fromkeys(QUANTITIES, 1.2), MIXED):
            yield _row(runner, speed_rpm, USING_FLUX, factors)
    for speed_rpm in ERROR_SPEEDS_RPM:
        for factor in (0.8, 1.2):
            for quantity in QUANTITIES if speed_rpm == SINGLE_RPM else ():
                yield _row(runner, speed_rpm, "interpolated", {quantity: factor})
            yield _row(runner, speed_rpm, "interpolated", dict.fromkeys(QUANTITIES, factor))
