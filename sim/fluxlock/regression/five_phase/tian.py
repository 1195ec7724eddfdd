"""Machine of Tian 2019: angle error of I/Q demodulation with the exact angle sequence."""

from __future__ import annotations

from collections.abc import Iterator

from fluxlock.regression.case import Row, case
from fluxlock.regression.five_phase.driven import angle_values, driven
from fluxlock.regression.runner import Runner

SCENARIO = "five-phase/tian.toml"
POINTS = ((100.0, 2.0),)  # r/min, A
MEAN_DEG, RMS_DEG = 0.3, 0.5
SETTLED_S, END_S = 0.19, 0.25
BEYOND_RPM = 30.0


@case("five-phase/tian-best", long=True)
def best(runner: Runner) -> Iterator[Row]:
    """Driven shaft, without dead time: mean and rms of the angle error from an estimate that is 10 degrees off."""
    for rpm, i_q_a in POINTS:
        if runner.quick and (rpm, i_q_a) != POINTS[0]:
            continue
        overrides = [
            *driven(rpm, i_q_a, SETTLED_S, END_S, beyond_rpm=BEYOND_RPM),
            "inverter.dead_time_s=0",
            "motor.max_speed_rpm=150",
            "motor.load.viscous_nm_s_per_rad=0",
            "drive.vector.speed_hz=12",
        ]
        run = runner.drive(SCENARIO, f"{rpm:g}-{i_q_a:g}", *overrides)
        yield Row(
            f"five-phase/tian-best/{rpm:g}rpm-{i_q_a:g}A",
            {"motor": "Tian", "speed_rpm": rpm, "iq_a": i_q_a, "dead_time_us": 0.0},
            angle_values(run),
            {
                "angle_error_deg.mean": (-MEAN_DEG, MEAN_DEG),
                "angle_error_deg.rms": (None, RMS_DEG),
                "trips": (0, 0),
            },
        )
