# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""How a run has ended: ridden through, stopped with a right name, or wrong, and why.

Wrong is, from the disturbance on:
  a leg with both gates on, or a gap between them shorter than the dead time;
  a phase current above the trip's limit for more than 100 us while any gate is on;
  torque against the commanded direction, mean of a millisecond, for more than 10 ms while a lock drives a rotor that
  turns that way at a tenth of its highest speed or more, slower than asked for by then (one that is driven faster is
  braked);
  a stop by a name that does not belong to the fault, or by none; a drive that runs on where it had to stop.
  a gate that is on, or an enable of the drivers that toggles, later than the fault allows.
All phases and legs of the machine count. A drive that boot refuses, with the name of a fault, has stopped, and so has
one whose CANopen node has told the name and opened the gates. Gates all off for a pulse's pause count as on. A chip
that cannot tell a name, as its clock stands or it begins anew, has halted: gates and currents are judged.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fluxlock.config import Scenario
from fluxlock.config.motor import RPM_PER_RAD_S
from fluxlock.results.angles import phase_currents
from fluxlock.results.gates import gate_safety
from fluxlock.results.rundata import BoolArray, LogKind, RecordArray, RunData
from fluxverify.campaign.grid import ANY, Fault

RIDDEN, STOPPED, HALTED, WRONG = "ridden through", "stopped by name", "halted", "wrong"
CURRENT_S, TORQUE_S, MEAN_S, PULSE_S = 100e-6, 10e-3, 1e-3, 60e-6
# Of the limit: converter and noise. Of the rated torque: ripple, and what friction of the diodes leaves.
CURRENT_MARGIN, TORQUE_SHARE, SLOW_SHARE = 1.03, 0.1, 0.1
ASKED_SHARE = 0.99  # of the speed asked for: what the regulator may be off


@dataclass(frozen=True)
class Verdict:
    """outcome: RIDDEN, STOPPED, HALTED or WRONG; state and fault as the console told them last ("": it did not)."""

    outcome: str
    reasons: tuple[str, ...]
    state: str
    fault: str
    over_current_s: float
    against_s: float


def _stretches(true: BoolArray) -> tuple[np.ndarray, np.ndarray]:
    """First rows of the stretches in which something holds, and the rows behind them."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], true, [False])).astype(np.int8)))
    return edges[::2], edges[1::2]


def longest_s(t_s: np.ndarray, wrong: BoolArray) -> float:
    """Longest time for which something held without a break."""
    begin, end = _stretches(wrong)
    if not begin.size:
        return 0.0
    return float(np.max(t_s[np.minimum(end, t_s.size - 1)] - t_s[begin]))


def gates_in_use(t_s: np.ndarray, on: BoolArray) -> BoolArray:
    """Rows with a gate on, and those of the short pauses between them."""
    used = on.copy()
    for begin, end in zip(*_stretches(~on), strict=True):
        if begin > 0 and end < t_s.size and t_s[end] - t_s[begin] < PULSE_S:
            used[begin:end] = True
    return used


def over_current_s(records: RecordArray, clock_hz: float, limit_a: float) -> float:
    """Longest time for which a phase current was above the trip's limit while a gate was on."""
    t_s = records["t_cycle"] / clock_hz
    peak = np.max(np.abs(np.stack([records[name] for name in phase_currents(records)])), axis=0)
    return longest_s(t_s, (peak > CURRENT_MARGIN * limit_a) & gates_in_use(t_s, records["gates"] != 0))


def _console(data: RunData, name: str) -> str:
    """The value that a name had last, also behind a line that a restart has cut off."""
    found = re.findall(rf"(?<![a-z_]){name} (\w+)", "\n".join(data.uart))
    return found[-1] if found else ""


def _asked_rpm(scenario: Scenario, t_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """At these times: the way asked for, 1 or -1, and the speed that way (r/min) that the slope allows by then.

    The slope begins with the command, from where the one before has led to or from the rotor's first speed.
    """
    way, asked = np.ones(t_s.size), np.zeros(t_s.size)
    targets = scenario.speed_targets()
    value = scenario.initial.speed_rpm
    for (at_s, target), (end_s, _) in zip(targets, [*targets[1:], (np.inf, 0.0)], strict=True):
        here = (t_s >= at_s) & (t_s < end_s)
        change = (target > value) - (target < value)
        slope = scenario.accel_rpm_per_s * change
        low, high = min(value, target), max(value, target)
        way[here] = -1 if target < 0 else 1
        asked[here] = np.maximum(0.0, way[here] * np.clip(value + slope * (t_s[here] - at_s), low, high))
        value = float(np.clip(value + slope * (end_s - at_s), low, high)) if slope else target
    return way, asked


def late(data: RunData, from_cycle: float) -> list[str]:
    """What is energised from a cycle on: a gate that is on then or goes on later, an enable that toggles."""
    gates, enable = data.rows(LogKind.GATES), data.rows(LogKind.ENABLE)
    ends = np.append(gates[1:, 0], np.inf)[: len(gates)]
    on = (gates[:, 2] != 0) & (ends > from_cycle)
    found = []
    if on.any():
        ends_cycle = min(float(ends[on].max()), data.cycles)
        found.append(f"a gate on {1e6 * (ends_cycle - from_cycle) / data.clock_hz:.2f} us after the time for it")
    if toggles := int(np.count_nonzero(enable[:, 0] > from_cycle)):
        found.append(f"enable of the drivers toggles {toggles} times after the time for it")
    if enable.size and enable[-1, 2]:
        found.append("enable of the drivers stays high")
    return found


def judge(data: RunData, scenario: Scenario, fault: Fault, since_cycle: int, told: Sequence[str] = ()) -> Verdict:
    """Judge a run that was disturbed at a cycle. told: names that the CANopen node has sent since."""
    records = data.records[data.records["t_cycle"] >= since_cycle]
    t_s = records["t_cycle"] / data.clock_hz
    gated = gates_in_use(t_s, records["gates"] != 0)
    over_s = over_current_s(records, data.clock_hz, scenario.inverter.protection.phase_current_a)
    count = max(1, round(MEAN_S / max(float(np.median(np.diff(t_s))) if t_s.size > 1 else MEAN_S, 1e-9)))
    mean_nm = np.convolve(records["torque_nm"], np.ones(count) / count, mode="same") if t_s.size else np.zeros(0)
    rated_nm = scenario.motor.rated_torque_nm
    way, asked_rpm = _asked_rpm(scenario, t_s)
    speed_rpm = way * records["omega_e"] / scenario.motor.pole_pairs * RPM_PER_RAD_S
    turns = speed_rpm > SLOW_SHARE * scenario.motor.max_speed_rpm
    slower = speed_rpm < ASKED_SHARE * asked_rpm
    against_s = longest_s(t_s, (way * mean_nm < -TORQUE_SHARE * rated_nm) & gated & turns & slower)
    reasons = late(data, since_cycle + fault.off_s * data.clock_hz) if fault.off_s is not None else []
    safety = gate_safety(data)
    if safety.shoot_throughs:
        reasons.append(f"both gates of a leg on, {safety.shoot_throughs} times")
    if safety.least_dead_time_s is not None and safety.least_dead_time_s < scenario.inverter.dead_time_s - 1e-9:
        reasons.append(f"dead time {1e9 * safety.least_dead_time_s:.0f} ns")
    if over_s > CURRENT_S:
        reasons.append(f"current above the limit for {1e6 * over_s:.0f} us")
    state, name = _console(data, "state"), _console(data, "fault")
    stopped = state == "fault" or (state == "init" and name != "none")
    if told and not stopped and not safety.on_at_end:
        stopped, name = True, told[0]
    if fault.names != ANY and against_s > TORQUE_S:
        reasons.append(f"torque against the command for {1e3 * against_s:.0f} ms")
    if fault.names != ANY and not fault.silent:
        if not state:
            reasons.append("console silent")
        if state == "ready" and not stopped and gated.any():
            reasons.append("stopped without a name")
        if stopped and name not in fault.names:
            reasons.append(f"stopped as {name}")
        if not stopped and fault.must_stop:
            reasons.append(f"{state}, had to stop")
        if stopped and safety.on_at_end:
            reasons.append("gates on in the fault state")
    outcome = WRONG if reasons else HALTED if fault.silent else STOPPED if stopped else RIDDEN
    return Verdict(outcome, tuple(reasons), state, name, over_s, against_s)
