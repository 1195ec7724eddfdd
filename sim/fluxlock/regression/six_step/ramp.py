"""Ramps through whole numbers of carriers a sector."""

from __future__ import annotations

import math
from collections.abc import Iterator

from fluxlock.cosim.outcome import Outcome
from fluxlock.regression.case import Condition, Number, Row, case
from fluxlock.regression.runner import Runner
from fluxlock.regression.six_step.measures import Limits, event, timeline
from fluxlock.regression.six_step.support import highest_hz

CARRIER_HZ = 20_000
TOP_RPM = 78_000
# Commutation, crossings computed back. Without that, RSC runs with the first sample after a crossing.
VARIANTS = (("CSC", False), ("RSC", False), ("RSC", True))
# The trip follows the boundary by some turns of a rising speed.
BELOW_INTEGER = 0.25
# 30 mN*m at 60 000 r/min are 50.7 mN*m and 30.7 A at the top, more than the motor's rated current.
CURRENT_LIMIT_A = {20: 30, 30: 40}


def _short(fails: bool) -> list[str]:
    """The short version begins shortly before the whole number of carriers that matters: 4, or 3."""
    from_rpm, accel_rpm_per_s = (46_000, 120_000) if fails else (65_000, 100_000)
    events = [event(0.003, "speed_rpm", TOP_RPM), event(0.004, "command", "start")]
    times = timeline(0.12, events, []) if fails else timeline(0.22, events, [("top", 0.19, 0.22)])
    return [f"initial.speed_rpm={from_rpm}", f"drive.accel_rpm_per_s={accel_rpm_per_s}", *times]


def _run(runner: Runner, load_mnm: int, commutation: str, compute_back: bool) -> Outcome:
    fails = commutation == "RSC" and not compute_back
    return runner.drive(
        "six-step/ramp-1300hz.toml",
        f"{commutation}{'-back' if compute_back else ''}-{load_mnm}",
        f"drive.commutation={commutation}",
        f"drive.zcd.compute_back={str(compute_back).lower()}",
        f"drive.zcd.method={'first' if fails else 'interpolated'}",
        f"drive.current_limit_a={CURRENT_LIMIT_A[load_mnm]}",
        f"load.fan_torque_nm={load_mnm / 1000}",
        *(_short(fails) if runner.quick else ["window=[]"] if fails else []),
    )


@case("six-step/ramp-1300hz")
def ramp_1300hz(runner: Runner) -> Iterator[Row]:
    """CSC passes every integer N on the way to 1300 Hz with a 20 kHz carrier; RSC only with crossings computed back."""
    for load_mnm in (20,) if runner.quick else (20, 30):
        for commutation, compute_back in VARIANTS:
            run = _run(runner, load_mnm, commutation, compute_back)
            frequency_hz = highest_hz(run)
            values: dict[str, Number] = {"highest_hz": frequency_hz, "trips": len(run.result["trips"])}
            conditions: dict[str, Condition] = {
                "motor": "Motor-I",
                "carrier_hz": CARRIER_HZ,
                "commutation": commutation,
                "compute_back": compute_back,
                "method": run.scenario.drive.zcd.method,
                "pattern": "ON-PWM",
                "fan_mnm_at_60000": load_mnm,
            }
            row_id = f"six-step/ramp-1300hz/{commutation}{'-back' if compute_back else ''}-{load_mnm}mNm"
            if "top" not in run.metrics:
                carriers = CARRIER_HZ / (6 * frequency_hz)
                values |= {"carriers_per_sector": carriers, "below_integer": math.ceil(carriers) - carriers}
                limits: Limits = {
                    "trips": (1, None),
                    "highest_hz": (None, 1300),
                    "below_integer": (None, BELOW_INTEGER),
                }
                yield Row(row_id, conditions, values, limits)
                continue
            top = run.metrics["top"]
            values["speed_rpm.mean"] = top["speed_rpm"]["mean"]
            values["freewheel_deg.max"] = top["freewheel_deg"]["max"]
            values["late_crossings"] = top["late_crossings"]
            values["commutation_error_deg.rms"] = top["commutation_error_deg"]["rms"]
            limits = {"trips": (0, 0), "speed_rpm.mean": (0.995 * TOP_RPM, 1.005 * TOP_RPM)}
            yield Row(row_id, conditions, values, limits)
