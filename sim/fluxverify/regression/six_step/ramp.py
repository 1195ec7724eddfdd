# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Ramps through whole numbers of carriers a sector."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from fluxlock.cosim.outcome import Run
from fluxverify.regression.case import LOCK_MAY_GO, Condition, Number, Row, case
from fluxverify.regression.runner import Runner
from fluxverify.regression.six_step.measures import Limits, event, timeline
from fluxverify.regression.six_step.support import highest_hz

CARRIER_HZ = 20_000
TOP_RPM = 78_000
# The trip follows the boundary by some turns of a rising speed.
BELOW_INTEGER = 0.1
# By which a lost lock ends: the commutations drive current against the EMF, or the crossings stay away.
CAUSES = frozenset({"phase_current", "dc_current", "lost_lock"})
# A ramp that is to fail ends beyond N = 3.
FAILS_WITHIN_S = 2.5


@dataclass(frozen=True)
class Variant:
    """One ramp at constant torque. fails_below: whole number of carriers just below which the trip comes; 0: none."""

    commutation: str
    compute_back: bool
    load_mnm: int
    fails_below: int = 0

    @property
    def fails(self) -> bool:
        """Whether the lock is to be lost."""
        return self.fails_below > 0

    @property
    def name(self) -> str:
        """Name of the run."""
        return f"{self.commutation}{'-back' if self.compute_back else ''}-{self.load_mnm}mNm"

    @property
    def method(self) -> str:
        """Time of the crossings: RSC without computing back runs with the first sample after."""
        return "first" if self.commutation == "RSC" and not self.compute_back else "interpolated"


QUICK = (Variant("CSC", False, 20), Variant("RSC", False, 20, fails_below=4), Variant("RSC", True, 20))
FULL = (*QUICK, Variant("CSC", False, 30), Variant("RSC", False, 30, fails_below=4), Variant("RSC", True, 30))


def _short(fails: bool) -> list[str]:
    """The short version begins shortly before the whole number of carriers that matters: 4, or 3."""
    from_rpm, accel_rpm_per_s = (49_500, 30_000) if fails else (65_000, 100_000)
    events = [event(0.003, "speed_rpm", TOP_RPM), event(0.004, "command", "start")]
    times = timeline(0.2, events, []) if fails else timeline(0.22, events, [("top", 0.19, 0.22)])
    return [f"initial.speed_rpm={from_rpm}", f"drive.accel_rpm_per_s={accel_rpm_per_s}", *times]


def drive_ramp(runner: Runner, variant: Variant) -> Run:
    """Run one ramp."""
    fails = variant.fails
    return runner.drive(
        "six-step/ramp-1300hz.toml",
        variant.name,
        f"drive.commutation={variant.commutation}",
        f"drive.zcd.compute_back={str(variant.compute_back).lower()}",
        f"drive.zcd.method={variant.method}",
        f"load.constant_nm={variant.load_mnm / 1000}",
        *(_short(fails) if runner.quick else [f"duration_s={FAILS_WITHIN_S}", "window=[]"] if fails else []),
        accept=dict.fromkeys(LOCK_MAY_GO, "RSC loses the lock below a whole number of carriers") if fails else None,
    )


def _row(run: Run, variant: Variant) -> Row:
    frequency_hz = highest_hz(run)
    carriers = CARRIER_HZ / (6 * frequency_hz)
    values: dict[str, Number] = {
        "highest_hz": frequency_hz,
        "carriers_per_sector": carriers,
        "trips": len(run.result["trips"]),
    }
    limits: Limits
    if variant.fails:
        causes = {cause for trip in run.result["trips"] for cause in trip["cause"].split("+")}
        values["below_integer"] = variant.fails_below - carriers
        values["other_causes"] = len(causes - CAUSES)
        low_hz, high_hz = (CARRIER_HZ / (6 * (variant.fails_below - below)) for below in (0.0, BELOW_INTEGER))
        limits = {
            "trips": (1, None),
            "other_causes": (0, 0),
            "highest_hz": (low_hz, high_hz),
            "below_integer": (0.0, BELOW_INTEGER),
        }
    else:
        top = run.metrics["top"]
        values["speed_rpm.mean"] = top["speed_rpm"]["mean"]
        values["freewheel_deg.max"] = top["freewheel_deg"]["max"]
        values["late_crossings"] = top["late_crossings"]
        values["commutation_error_deg.rms"] = top["commutation_error_deg"]["rms"]
        limits = {"trips": (0, 0), "speed_rpm.mean": (0.995 * TOP_RPM, 1.005 * TOP_RPM)}
    conditions: dict[str, Condition] = {
        "motor": "Motor-I",
        "carrier_hz": CARRIER_HZ,
        "commutation": variant.commutation,
        "compute_back": variant.compute_back,
        "method": variant.method,
        "pattern": "ON-PWM",
        "load_mnm": variant.load_mnm,
    }
    return Row(f"six-step/ramp-1300hz/{variant.name}", conditions, values, limits)


@case("six-step/ramp-1300hz")
def ramp_1300hz(runner: Runner) -> Iterator[Row]:
    """CSC passes every integer N on the way to 1300 Hz with a 20 kHz carrier; RSC only with crossings computed back."""
    for variant in QUICK if runner.quick else FULL:
        yield _row(drive_ramp(runner, variant), variant)
