# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Hand-over between injection and EMF observer: standstill, rated speed, standstill, under load."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from fluxlock.config.motor import RPM_PER_RAD_S
from fluxlock.cosim.outcome import Run
from fluxlock.firmware.vector_compiler import BACK_SHARE
from fluxlock.results.rundata import FloatArray
from fluxverify.regression.case import Number, Row, case
from fluxverify.regression.five_phase.driven import angle_values
from fluxverify.regression.runner import Runner
from fluxverify.regression.six_step.measures import event, timeline

JUMP_DEG, DIP_PERCENT = 3.0, 5.0
BEFORE_S, AFTER_S, END_S = 0.02, 0.035, 0.05  # of the hand-over, which takes 30 ms
MEAN_S = 2e-3  # of angle error and torque
LOAD_S, LOAD_RAMP_S = 0.07, 0.06  # beginning of the load, once the rotor turns


@dataclass(frozen=True)
class Course:
    """A machine's way: speeds in r/min, load by Coulomb friction in N*m."""

    name: str
    scenario: str
    top_rpm: float
    handover_rpm: float
    accel_rpm_per_s: float
    load_nm: float
    back_s: float
    end_s: float
    overrides: tuple[str, ...] = ()

    def timeline(self) -> list[str]:
        """Overrides of the run."""
        events = [
            event(0.0, "load_factor", 0.0),
            event(0.002, "speed_rpm", self.top_rpm),
            event(0.004, "command", "start"),
            {**event(LOAD_S, "load_factor", 1.0), "ramp_s": LOAD_RAMP_S},
            event(self.back_s, "command", "set speed_rpm 0"),
        ]
        return [
            *timeline(self.end_s, events, [("steady", 0.06, self.end_s)]),
            "expect=[]",
            f"drive.vector.handover_rpm={self.handover_rpm:g}",
            f"drive.accel_rpm_per_s={self.accel_rpm_per_s:g}",
            f"load.coulomb_nm={self.load_nm:g}",
            *self.overrides,
        ]


YU_DEAD = Course(
    "yu-2us", "five-phase/yu.toml", 1500.0, 450.0, 3000.0, 4.0, 0.60, 1.07,
    ("drive.vector.speed_hz=8", "load.viscous_nm_s_per_rad=0"),
)  # fmt: skip
YU = replace(YU_DEAD, name="yu", overrides=(*YU_DEAD.overrides, "inverter.dead_time_s=0"))
YU_SHORT = replace(YU_DEAD, load_nm=6.0, back_s=0.26, end_s=0.48)
IPM = Course("ipm", "vector/ipm-injection.toml", 3000.0, 700.0, 6000.0, 0.7, 0.64, 1.14)


def means(time_s: FloatArray, values: FloatArray, from_s: float, to_s: float) -> tuple[FloatArray, FloatArray]:
    """Centres and means of consecutive stretches of MEAN_S, those without values left out."""
    edges = np.arange(from_s, to_s, MEAN_S)
    place = np.searchsorted(edges, time_s, side="right") - 1
    inside = (place >= 0) & (place < edges.size - 1) & (time_s < to_s)
    count = np.bincount(place[inside], minlength=edges.size)
    total = np.bincount(place[inside], weights=values[inside], minlength=edges.size)
    there = count > 0
    return edges[there] + MEAN_S / 2, total[there] / count[there]


def handed_over_s(run: Run, course: Course) -> tuple[float, float]:
    """When the rotor passes the speed of the hand-over, and that of the way back."""
    records = run.data.records
    time_s = records["t_cycle"] / run.data.clock_hz
    rpm = records["omega_e"] / run.data.pole_pairs * RPM_PER_RAD_S
    back = (time_s > course.back_s) & (rpm < BACK_SHARE * course.handover_rpm)
    return float(time_s[rpm > course.handover_rpm][0]), float(time_s[back][0])


def jump_deg(run: Run, at_s: float) -> float:
    """Largest change of the published angle's error against its mean before the hand-over."""
    angles = run.analysis.angles
    time_s = angles.cycle / run.data.clock_hz
    centre_s, error = means(time_s, angles.error_deg, at_s - BEFORE_S, at_s + END_S)
    return float(np.abs(error[centre_s > at_s] - error[centre_s < at_s].mean()).max())


def dip_percent(run: Run, at_s: float) -> float:
    """Largest change of the torque against the straight line from its mean before the hand-over to that after it."""
    records = run.data.records
    time_s = records["t_cycle"] / run.data.clock_hz
    centre_s, torque = means(time_s, records["torque_nm"], at_s - BEFORE_S, at_s + END_S)
    before, after = centre_s < at_s, centre_s > at_s + AFTER_S
    ends_s, ends_nm = ([float(values[part].mean()) for part in (before, after)] for values in (centre_s, torque))
    line = np.interp(centre_s, ends_s, ends_nm)
    return float(100.0 * np.abs(torque / line - 1.0)[~before].max())


@case("five-phase/hand-over", long=True)
def hand_over(runner: Runner) -> Iterator[Row]:
    """Standstill, rated speed, standstill under load, without a wave above the hand-over: jump of the angle, torque."""
    for course in (YU_SHORT,) if runner.quick else (YU, YU_DEAD, IPM):
        run = runner.drive(course.scenario, course.name, *course.timeline())
        up_s, down_s = handed_over_s(run, course)
        values: dict[str, Number] = {
            "up.jump_deg": jump_deg(run, up_s),
            "down.jump_deg": jump_deg(run, down_s),
            "up.torque_percent": dip_percent(run, up_s),
            "down.torque_percent": dip_percent(run, down_s),
            **angle_values(run),
            "speed_rpm.max": run.metrics["steady"]["speed_rpm"]["max"],
        }
        yield Row(
            f"five-phase/hand-over/{course.name}",
            {
                "motor": run.scenario.motor.name,
                "speed_rpm": course.top_rpm,
                "handover_rpm": course.handover_rpm,
                "load_nm": course.load_nm,
                "dead_time_us": run.scenario.inverter.dead_time_s * 1e6,
            },
            values,
            {
                "up.jump_deg": (None, JUMP_DEG),
                "down.jump_deg": (None, JUMP_DEG),
                "up.torque_percent": (None, DIP_PERCENT),
                "down.torque_percent": (None, DIP_PERCENT),
                "trips": (0, 0),
            },
        )
