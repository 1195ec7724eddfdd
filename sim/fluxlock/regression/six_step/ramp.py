"""Ramps through whole numbers of carriers a sector."""

from __future__ import annotations

from collections.abc import Iterator

from fluxlock.regression.case import Condition, Row, case
from fluxlock.regression.runner import Runner
from fluxlock.regression.six_step.support import highest_hz


@case("six-step/ramp-1300hz")
def ramp_1300hz(runner: Runner) -> Iterator[Row]:
    """CSC passes every integer N on the way to 1300 Hz with a 20 kHz carrier; RSC fails just below one."""
    loads = (20,) if runner.quick else (20, 30)
    for load_mnm in loads:
        for commutation in ("CSC", "RSC"):
            run = runner.drive(
                "six-step/ramp-1300hz.toml",
                f"{commutation}-{load_mnm}",
                f"drive.commutation={commutation}",
                f"load.fan_torque_nm={load_mnm / 1000}",
                *(() if commutation == "CSC" else ("window=[]",)),
            )
            frequency_hz = highest_hz(run)
            values: dict[str, float | int | None] = {"highest_hz": frequency_hz, "trips": len(run.result["trips"])}
            conditions: dict[str, Condition] = {
                "motor": "Motor-I",
                "carrier_hz": 20_000,
                "commutation": commutation,
                "pattern": "ON-PWM",
                "fan_mnm_at_60000": load_mnm,
            }
            row_id = f"six-step/ramp-1300hz/{commutation}-{load_mnm}mNm"
            if commutation == "CSC":
                values["speed_rpm.mean"] = run.metrics["top"]["speed_rpm"]["mean"]
                yield Row(row_id, conditions, values, {"trips": (0, 0), "speed_rpm.mean": (77_600, 78_400)})
            else:
                values["carriers_per_sector"] = 20_000 / (6 * frequency_hz)
                yield Row(row_id, conditions, values, {"trips": (1, None), "highest_hz": (None, 1300)})
