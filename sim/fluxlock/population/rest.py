# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A machine of the population from rest, at its drawn angle with light load: up to 60 % of base speed, and reversed.

Right: it locks and runs at the target in both directions, by the drive's own attempts, without a trip and within the
limit of the current. Late locks and rotors that turn back by more than `BACK_DEG` after the alignment are counted.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from fluxlock.config.motor import RPM_PER_RAD_S
from fluxlock.config.scenario import Event, Initial, Scenario
from fluxlock.config.vector_design import handover_rpm, start_current_a
from fluxlock.cosim.parameters import parameter_block
from fluxlock.firmware.design import Design
from fluxlock.firmware.vector_compiler import CURRENT_RISE_S
from fluxlock.population.draw import parts
from fluxlock.population.judge import Judge, Reason
from fluxlock.population.life import (
    HOLD_S,
    HOLD_TURNS,
    MIDDLE_SHARE,
    SPEED_TOLERANCE,
    Hold,
    Life,
    slope_rpm_per_s,
    told_scenario,
)
from fluxlock.results.rundata import RunData
from fluxlock.results.verdict import RUNNING

START_S = 0.003
LATE_FACTOR, LATE_S = 3.0, 0.3  # times the time of a known angle, and on top of it
BACK_DEG, BACK_MOST_DEG = 60.0, 210.0  # electrical, after the alignment
COAST_TICKS = 12  # a rotor at rest is calm by then (sw/drive/coast.c)
PATIENCE_S, COAST_MOST_S = 2.0, 30.0  # for another attempt, and until a rotor without friction is slow enough


@dataclass(frozen=True)
class RestLife(Life):
    """aligned_s: the alignment ends; locked_s: a lock is late from then on; reversed_s: the target changes its sign."""

    aligned_s: float
    locked_s: float
    reversed_s: float


@dataclass(frozen=True)
class _Start:
    """What a start needs that knows the angle. known_s: from the alignment to the hand-over."""

    align_s: float
    known_s: float
    handover_rad_s: float  # mechanical


def _start(s: Scenario) -> _Start:
    d, block = Design(told_scenario(s)), parameter_block(s)
    if s.drive.method == "vector":
        ticks = block.number("vector_start_align_ticks") + round(CURRENT_RISE_S / d.tick_s)
        torque_nm, omega = d.machine.torque_nm_per_a * start_current_a(d.s), handover_rpm(d.s) / RPM_PER_RAD_S
    else:
        ticks = block.number("precharge_ticks") + 2 * block.number("align_ticks")
        torque_nm, omega = d.machine.k_e * d.start_a, d.w_handover
    return _Start((ticks + COAST_TICKS) * d.tick_s, omega * s.motor.inertia_kgm2 / torque_nm, omega)


def rest_life(life: Life) -> RestLife:
    """The life from rest of the same machine."""
    s, start, slope = life.scenario, _start(life.scenario), slope_rpm_per_s(life.scenario.motor)
    rpm = math.floor(max(life.lowest_rpm, MIDDLE_SHARE * parts(life.draw, life.method).base_rpm))
    load = s.shaft_load
    friction_nm = load.coulomb_nm + load.viscous_nm_s_per_rad * start.handover_rad_s
    coast_s = min(COAST_MOST_S, s.motor.inertia_kgm2 * start.handover_rad_s / max(friction_nm, 1e-12))
    aligned_s = START_S + start.align_s
    locked_s = aligned_s + LATE_FACTOR * start.known_s + LATE_S
    hold_s = max(HOLD_S, HOLD_TURNS * 60.0 / (rpm * s.motor.pole_pairs))
    settled_s = locked_s + PATIENCE_S + rpm / slope
    reversed_s = round(settled_s + hold_s, 3)
    back_s = reversed_s + 2.0 * rpm / slope + coast_s + (locked_s - START_S) + PATIENCE_S
    scenario = s.model_copy(
        update={
            "name": f"{s.name}-rest",
            "description": f"{s.description}, from rest",
            "duration_s": round(back_s + hold_s + 0.005, 3),
            "initial": Initial(theta_deg=life.draw.theta_deg, speed_rpm=0.0),
            "event": [
                Event(at_s=0.0, load_factor=1.0),
                Event(at_s=0.002, speed_rpm=rpm),
                Event(at_s=START_S, command="start"),
                Event(at_s=reversed_s, command=f"set speed_rpm {-rpm}"),
            ],
            "window": [],
            "expect": [],
        }
    )
    holds = (Hold("up", rpm, settled_s, reversed_s), Hold("back", -rpm, back_s, back_s + hold_s))
    whole = replace(life, scenario=scenario, holds=holds, changes=(), caught_s=math.inf)
    return RestLife(**vars(whole), aligned_s=aligned_s, locked_s=locked_s, reversed_s=reversed_s)


@dataclass(frozen=True)
class RestFound:
    """reasons: none if the life is right. lock_s: from the alignment's end; allowed_s: beyond that it is late."""

    reasons: tuple[Reason, ...]
    lock_s: float | None
    allowed_s: float
    back_deg: float
    current: float


def judge_rest(data: RunData, life: RestLife) -> RestFound:
    """A run of a life from rest."""
    j = Judge(data, life)
    j.ended()
    j.lost()
    current = j.largest_current()
    states = data.states()
    times, running = states["t_s"], states["state"] == RUNNING
    begins = times[1:][running[1:] & ~running[:-1]]
    ends = times[1:][~running[1:] & running[:-1]]
    first = begins[begins < life.reversed_s]
    lock_s = float(first[0]) if first.size else None
    if lock_s is None:
        j.wrong("never locked", f"no start by {life.reversed_s:.3f} s")
    for end_s in ends[ends < life.reversed_s][:1]:
        j.wrong("lock lost", f"first start, at {end_s:.4f} s")
    for end_s in ends[ends > begins[begins > life.reversed_s].min(initial=math.inf)][:1]:
        j.wrong("lock lost", f"start after the reversal, at {end_s:.4f} s")
    if not begins.size or begins[-1] < life.reversed_s:
        j.wrong("never locked", "no start after the reversal")
    for hold in life.holds:
        mean_rpm = float(np.mean(j.rpm[(j.time_s >= hold.from_s) & (j.time_s < hold.to_s)]))
        if abs(mean_rpm / hold.rpm - 1.0) > SPEED_TOLERANCE:
            j.wrong("speed", f"{hold.name}: {mean_rpm:.1f} for {hold.rpm:.0f} r/min")
    until_s = life.reversed_s if lock_s is None else lock_s
    turned = np.degrees(data.records["theta_e"][(j.time_s >= life.aligned_s) & (j.time_s < until_s)])
    back_deg = float(np.max(np.maximum.accumulate(turned) - turned, initial=0.0))
    if back_deg > BACK_MOST_DEG:
        j.wrong("turned back", f"{back_deg:.0f} degrees after the alignment")
    return RestFound(
        tuple(j.reasons),
        None if lock_s is None else lock_s - life.aligned_s,
        life.locked_s - life.aligned_s,
        back_deg,
        current,
    )
