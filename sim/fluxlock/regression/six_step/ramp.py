"""Ramps through whole numbers of carriers a sector."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from fluxlock.cosim.outcome import Outcome
from fluxlock.regression.case import Condition, Number, Row, case
from fluxlock.regression.runner import Runner
from fluxlock.regression.six_step.measures import Limits, event, timeline
from fluxlock.regression.six_step.support import highest_hz

CARRIER_HZ = 20_000
TOP_RPM = 78_000
# 30 mN*m at 60 000 r/min are 50.7 mN*m and 30.7 A at the top, more than the motor's rated current.
CURRENT_LIMIT_A = {20: 30, 30: 40}
# The trip follows the boundary by some turns of a rising speed.
BELOW_INTEGER = 0.25
# Freewheel angle that hides the crossing, less what sampling and the last turns take.
HIDDEN_DEG = 27.0
BEFORE_TRIP_S = 5e-3


@dataclass(frozen=True)
class Variant:
    """One ramp.

    ends: "top", "integer" (trip just below a whole number of carriers), "hidden" (trip at a freewheel angle of 30 deg).
    """

    commutation: str
    compute_back: bool
    load_mnm: int
    ends: str
    note: str = ""

    @property
    def name(self) -> str:
        """Name of the run."""
        return f"{self.commutation}{'-back' if self.compute_back else ''}-{self.load_mnm}mNm"

    @property
    def method(self) -> str:
        """Time of the crossings: RSC without computing back runs with the first sample after."""
        return "first" if self.commutation == "RSC" and not self.compute_back else "interpolated"


QUICK = (Variant("CSC", False, 20, "top"), Variant("RSC", False, 20, "integer"), Variant("RSC", True, 20, "top"))
FULL = (
    *QUICK,
    Variant(
        "CSC",
        False,
        30,
        "hidden",
        "The freewheel angle reaches 30 deg before 1300 Hz (fluxlock soa): the crossing is hidden from there on. With "
        "crossings computed back the ramp completes.",
    ),
    Variant("CSC", True, 30, "top"),
    Variant("RSC", False, 30, "integer"),
    Variant(
        "RSC",
        True,
        30,
        "top",
        "RSC is stable up to a freewheel angle of 60 floor(N)/N, the wait for a pulse in it: 40 deg just below N = 3. "
        "Its late commutations raise the current, and with it the angle.",
    ),
)


def _short(fails: bool) -> list[str]:
    """The short version begins shortly before the whole number of carriers that matters: 4, or 3."""
    from_rpm, accel_rpm_per_s = (46_000, 120_000) if fails else (65_000, 100_000)
    events = [event(0.003, "speed_rpm", TOP_RPM), event(0.004, "command", "start")]
    times = timeline(0.12, events, []) if fails else timeline(0.22, events, [("top", 0.19, 0.22)])
    return [f"initial.speed_rpm={from_rpm}", f"drive.accel_rpm_per_s={accel_rpm_per_s}", *times]


def _run(runner: Runner, variant: Variant) -> Outcome:
    fails = variant.ends == "integer"
    return runner.drive(
        "six-step/ramp-1300hz.toml",
        variant.name,
        f"drive.commutation={variant.commutation}",
        f"drive.zcd.compute_back={str(variant.compute_back).lower()}",
        f"drive.zcd.method={variant.method}",
        f"drive.current_limit_a={CURRENT_LIMIT_A[variant.load_mnm]}",
        f"load.fan_torque_nm={variant.load_mnm / 1000}",
        *(_short(fails) if runner.quick else ["duration_s=0.5", "window=[]"] if fails else []),
    )


def _freewheel_before_trip_deg(run: Outcome) -> Number:
    """Largest freewheel angle in the last turns before the first trip, the very last one left out."""
    if not run.result["trips"]:
        return None
    end = (run.result["trips"][0]["time_s"] - 1e-3) * run.data.clock_hz
    angles = run.analysis.freewheel_deg(end - BEFORE_TRIP_S * run.data.clock_hz, end)
    return float(np.max(angles)) if angles.size else None


def _row(run: Outcome, variant: Variant) -> Row:
    frequency_hz = highest_hz(run)
    carriers = CARRIER_HZ / (6 * frequency_hz)
    values: dict[str, Number] = {
        "highest_hz": frequency_hz,
        "carriers_per_sector": carriers,
        "trips": len(run.result["trips"]),
    }
    limits: Limits
    if variant.ends == "top":
        top = run.metrics["top"]
        values["speed_rpm.mean"] = top["speed_rpm"]["mean"]
        values["freewheel_deg.max"] = top["freewheel_deg"]["max"]
        values["late_crossings"] = top["late_crossings"]
        values["commutation_error_deg.rms"] = top["commutation_error_deg"]["rms"]
        limits = {"trips": (0, 0), "speed_rpm.mean": (0.995 * TOP_RPM, 1.005 * TOP_RPM)}
    elif variant.ends == "integer":
        values["below_integer"] = math.ceil(carriers) - carriers
        limits = {"trips": (1, None), "highest_hz": (None, 1300), "below_integer": (None, BELOW_INTEGER)}
    else:
        values["freewheel_before_trip_deg"] = _freewheel_before_trip_deg(run)
        limits = {"trips": (1, None), "freewheel_before_trip_deg": (HIDDEN_DEG, None)}
    conditions: dict[str, Condition] = {
        "motor": "Motor-I",
        "carrier_hz": CARRIER_HZ,
        "commutation": variant.commutation,
        "compute_back": variant.compute_back,
        "method": variant.method,
        "pattern": "ON-PWM",
        "fan_mnm_at_60000": variant.load_mnm,
    }
    return Row(f"six-step/ramp-1300hz/{variant.name}", conditions, values, limits, variant.note)


@case("six-step/ramp-1300hz")
def ramp_1300hz(runner: Runner) -> Iterator[Row]:
    """CSC passes every integer N on the way to 1300 Hz with a 20 kHz carrier; RSC only with crossings computed back."""
    for variant in QUICK if runner.quick else FULL:
        yield _row(_run(runner, variant), variant)
