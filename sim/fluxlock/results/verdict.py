# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The verdict on a run, in words: the same rule for every command, regression row and figure.

`judge_run` is a pure function of a run and its scenario. `docs/fails` explains each line to users. A run fails for

- a trip or a final fault that the scenario does not expect, or one that it expects and that stays away;
- a console line that the drive refused or did not answer;
- a lost lock, or an angle that is lost while the drive says that it runs: its commutations, the speed of its crossings
  or, of a vector drive, its published angle have left the true rotor;
- a control step that comes too late, tick after tick, so that its voltages miss their update;
- a drive that is not running at the end although it was told to start and not to stop;
- a mean speed, in a window or at the end, off its target by more than `SPEED_TOLERANCE`, or a speed that swings;
- a missed `[[expect]]`.

A current above its limit is told and fails no run: where the least pulse drives more, no limit can hold it.

The verdict judges the speed only where it must have settled: the drive runs, the ramp of the target has ended, and
nothing has moved target, load, supply or settings for ten time constants of the speed loop; where it has been three of
them, a rotor without half the speed fails too. If a limit of the drive
was active there, the line names it with its duration. A scenario can accept a cause in `[[accept]]`. Then the run
passes, and the verdict gives the scenario's reason.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from typing import Any

import numpy as np

from fluxlock.config.console import CURRENT_LIMITS, number_of_line, switch_of_line
from fluxlock.config.fields import with_unit
from fluxlock.config.reach import overloads
from fluxlock.config.scenario import Accept, Scenario
from fluxlock.config.vector_loops import loops_of
from fluxlock.config.vector_timing import vector_timing
from fluxlock.digits import apart
from fluxlock.interface.names import trip_fault, words
from fluxlock.results.metrics import Analysis, judge, largest_current, trips
from fluxlock.results.rundata import FloatArray, Rejection, RunData

SPEED_TOLERANCE = 0.01
# Bandwidth of the six-step speed loop, if the scenario leaves it to the firmware (firmware/compiler.py), and how many
# time constants of the loop a disturbance is given.
SIX_STEP_SPEED_HZ = 30.0
SETTLING = 10.0
# After so many the rotor of a drive that follows has half the speed.
RISING = 3.0
# A vector drive's step is late where this share of the sets of this time missed their update.
LATE_SHARE, LATE_S = 0.1, 0.05
# A settled speed swings: beyond the target by this share of it, on both sides or one, and by this share of the highest.
SWING, SWING_OF_MAX = 0.5, 0.02
# A drive that stops must have slowed its rotor after this time.
STOPPING_S = 0.05
# The end of a run: at least this long, at least a mechanical turn.
END_S = 0.01
# A limit is the cause where it was active for at least this share of the time.
CAUSE_SHARE = 0.5
# An angle is lost beyond this error: there the machine gives no torque. For so long: a turn of commutations, a time.
LOST_DEG = 90.0
LOST_COMMUTATIONS = 6
LOST_S = 1e-3
# The drive's speed is not the rotor's: apart by this share, and by this one of the highest speed, for this time.
APART, APART_OF_MAX, APART_S, APART_TURNS = 0.2, 0.02, 0.05, 1.5
# A current above its limit by this factor is told.
CURRENT_SHARE = 1.15

READY, STARTING, RUNNING, STOPPING, FAULT = 1, 2, 3, 4, 5
STATES = words("state")
# Limits of the firmware by their numbers; the slew is no limit of the speed.
LIMITS = {
    words("limit").index(word): name
    for word, name in (("duty_max", "voltage"), ("duty_min", "duty_min"), ("current", "current"))
}
READ_ONLY = ("help", "status", "get", "faults", "stats")
LIMIT_TEXTS = {
    "duty_min": "the least pulse drives the rotor faster, nothing brakes it",
    "voltage": "the largest duty does not reach the speed",
    "current": "the current limit does not give the torque",
}
REMEDIES = {
    "duty_min": "load the motor, set drive.sync_rect = true, lower drive.carrier_hz or the supply, or raise the target",
    "voltage": "lower the target or the load, raise the supply or drive.duty_max",
    "current": "lower the load or drive.accel_rpm_per_s, or raise drive.current_limit_a",
}


@dataclass(frozen=True)
class Finding:
    """A reason for which a run fails. kind: as `[[accept]]` names it, empty if nothing accepts it."""

    kind: str
    line: str
    window: str | None = None


@dataclass(frozen=True)
class Verdict:
    """passed; lines: why the run failed, else what was found, the first one alone says enough.

    notes: what the scenario asks of the drive on purpose, and a current above its limit.
    """

    passed: bool
    lines: list[str]
    notes: tuple[str, ...] = ()

    @property
    def failures(self) -> list[str]:
        """Why the run failed; empty if it passed."""
        return [] if self.passed else self.lines

    def as_json(self) -> dict[str, Any]:
        """As `result.json` has it."""
        notes = {"notes": list(self.notes)} if self.notes else {}
        return {"passed": self.passed, "lines": self.lines, **notes}


def say(verdict: Verdict, quiet: bool = False) -> None:
    """The verdict first in a command's result: `ok: ...` on stdout unless quiet, `failed: ...` on stderr."""
    if verdict.passed and quiet:
        return
    if verdict.passed:
        print("\n  ".join([f"ok: {verdict.lines[0]}", *verdict.lines[1:], *verdict.notes]), flush=True)
    else:
        for line in verdict.notes:
            print(f"note: {line}", file=sys.stderr, flush=True)
        for line in verdict.lines:
            print(f"failed: {line}", file=sys.stderr, flush=True)


@dataclass(frozen=True)
class Command:
    """What holds from at_s on. target_rpm: signed, None: no speed is asked for. until_s: its ramp ends."""

    at_s: float
    until_s: float
    target_rpm: float | None
    accel_rpm_per_s: float


@dataclass(frozen=True)
class Span:
    """A time in which the speed has settled. where: in words; window: its name, None at the end of the run."""

    where: str
    window: str | None
    from_s: float
    to_s: float
    target_rpm: float
    mean_rpm: float
    least_rpm: float
    most_rpm: float

    @property
    def deviation(self) -> float:
        """Of the mean from the target, relative."""
        return (self.mean_rpm - self.target_rpm) / abs(self.target_rpm)

    @property
    def text(self) -> str:
        """Speed, target and place."""
        return f"{self.mean_rpm:.1f} r/min for {self.target_rpm:g} r/min {self.where}"

    def swings(self, max_speed_rpm: float) -> bool:
        """Whether the speed goes to and fro about a mean that may be right."""
        far = max(SWING * abs(self.target_rpm), SWING_OF_MAX * max_speed_rpm)
        return max(self.most_rpm - self.target_rpm, self.target_rpm - self.least_rpm) > far


@dataclass(frozen=True)
class Miss:
    """A span off its target. limit: of the drive that was active there, and in all for how long until its end."""

    span: Span
    limit: str | None
    active_s: float

    @property
    def kind(self) -> str:
        """As `[[accept]]` names it."""
        return self.limit or "speed"


def commands_of(scenario: Scenario) -> tuple[list[Command], bool | None]:
    """Commands of a scenario's events by time, and whether the last of start and stop was a start; None: neither.

    Every event that can move the speed is one, also a load step or a fault: it holds the same target as before.
    """
    target: float | None = None
    accel, torque, frozen = scenario.accel_rpm_per_s, scenario.drive.mode == "torque", False
    told: bool | None = None
    found = []
    for e in scenario.events_in_order():
        line = e.command or ""
        word = (line.split() or [""])[0]
        if e.command is not None and word in READ_ONLY:
            continue
        target = target if e.speed_target_rpm is None else e.speed_target_rpm
        accel = e.accel_rpm_per_s or number_of_line(line, "accel_rpm_s") or accel
        mode, freeze = switch_of_line(line, "mode"), switch_of_line(line, "freeze")
        torque, frozen = torque if mode is None else mode, frozen if freeze is None else freeze
        if word in ("start", "stop"):
            told = word == "start"
        asked = target if told and not torque and not frozen else None
        found.append(Command(e.at_s, e.at_s + e.ramp_s, asked, accel))
    return found, told


class Judge:
    """One run against its scenario. by_bus: the drive is commanded from outside, its target is what it says itself."""

    def __init__(self, data: RunData, scenario: Scenario, analysis: Analysis, by_bus: bool) -> None:
        self.data, self.scenario, self.analysis, self.by_bus = data, scenario, analysis, by_bus
        self.states = data.states()
        self.time_s = self.states["t_s"]
        self.commands, self.told = commands_of(scenario)
        loop_hz = scenario.drive.speed_bandwidth_hz or SIX_STEP_SPEED_HZ
        if scenario.drive.method == "vector":
            loop_hz = loops_of(scenario).speed_hz
        self.settling_s = SETTLING / (2.0 * math.pi * loop_hz)
        self.segments = self._running()
        self.unjudged: list[str] = []

    # The drive's own state.

    def _running(self) -> list[tuple[float, float]]:
        """Times in which the drive says that it runs, begin and end."""
        running = np.concatenate(([False], self.states["state"] == RUNNING, [False]))
        change = np.flatnonzero(np.diff(running.astype(np.int8)))
        ends = [*self.time_s, self.data.duration_s]
        return [(float(ends[a]), float(ends[b])) for a, b in zip(change[::2], change[1::2], strict=True)]

    def state_findings(self) -> list[Finding]:
        """A drive that ended in another state than it was told to."""
        if not self.states.size:
            return [Finding("", "the drive has reported no state: its program did not run")]
        last = int(self.states["state"][-1])
        name = STATES[last] if last < len(STATES) else f"state {last}"
        asked = any(e.speed_target_rpm for e in self.scenario.event)
        text = ""
        if last == STARTING:
            since = self.time_s[np.flatnonzero(self.states["state"] != STARTING)]
            began_s = float(since[-1]) if since.size else 0.0
            text = f"ended in starting, since {began_s:.3f} s: it has not found its lock; run longer or see drive.start"
        elif last == FAULT and self.data.fault is None:
            text = "ended in a fault that its console does not name"
        elif self.told and last not in (RUNNING, STOPPING, FAULT):
            text = f"was told to start and ended in {name}"
        elif self.told is None and asked and not self.by_bus and last != RUNNING:
            text = f'was given a speed and never told to start: it ended in {name}; add command = "start"'
        elif self.told is False and last in (STARTING, RUNNING):
            text = f"was told to stop and ended in {name}"
        elif self.told is False and last == STOPPING:
            text = self._unslowed()
        return [Finding("end_state", f"the drive {text}")] if text else []

    def late_findings(self) -> list[Finding]:
        """A vector drive whose sets of voltages miss their update again and again: its control step takes too long."""
        drive = self.scenario.drive
        if drive.method != "vector":
            return []
        timing = vector_timing(drive, self.scenario.inverter)
        tick_s = timing.tick_samples * timing.sample_cycles / self.data.clock_hz
        ticks = np.rint(np.diff(self.time_s) / tick_s)
        at_work = np.isin(self.states["state"][:-1], (STARTING, RUNNING))
        missed = np.where(at_work, np.maximum(ticks - 1.0, 0.0), 0.0)
        gone, done = np.cumsum(missed), np.cumsum(ticks)
        before = np.searchsorted(self.time_s[:-1], self.time_s[:-1] - LATE_S)
        share = (gone - gone[before]) / np.maximum(done - done[before], LATE_S / tick_s / 2.0)
        if not share.size or share.max() <= LATE_SHARE:
            return []
        at_s = self.time_s[before[int(np.argmax(share > LATE_SHARE))]]
        line = f"the control step is too late: from {at_s:.3f} s on {100.0 * share.max():.0f} % of its voltages missed"
        remedy = "give it more time: raise drive.vector.observer_every, lower drive.carrier_hz"
        return [Finding("", f"{line} their update; {remedy}")]

    def _unslowed(self) -> str:
        """Of a drive that is still stopping: that its rotor has become no slower, if that is so."""
        since = self.time_s[np.flatnonzero(self.states["state"] != STOPPING)]
        begin_s, end_s = (float(since[-1]) if since.size else 0.0), float(self.time_s[-1])
        before, now = np.abs(self._rotor_rpm(np.array([begin_s, end_s])))
        if end_s - begin_s < STOPPING_S or now < before:
            return ""
        return f"has been stopping since {begin_s:.3f} s and the rotor is no slower: {now:.0f} r/min, {before:.0f} then"

    # The angle.

    def angle_findings(self) -> list[Finding]:
        """Lost locks by the drive's own count, and a lost angle that it does not know of."""
        found = []
        lost = self.states["lost_locks"]
        # A trip beside it is its name, or its consequence, and is judged itself.
        if lost.size and lost[-1] and not trips(self.data):
            at_s = float(self.time_s[np.flatnonzero(lost)[0]])
            count = int(lost[-1])
            found.append(Finding("lost_lock", f"the drive lost its lock at {at_s:.3f} s, {count} in all"))
        for begin_s, end_s in self.segments:
            # What the drive ends itself has a name already: lost lock, trip or fault.
            open_end = end_s >= self.time_s[-1] or self._state_at(end_s) == STOPPING
            text = self._angle_text(begin_s, end_s, open_end) or self._apart_text(begin_s, end_s, open_end)
            if text:
                return [*found, Finding("lost_angle", f"the angle was lost: {text}")]
        return found

    def _state_at(self, t_s: float) -> int:
        return int(self.states["state"][np.searchsorted(self.time_s, t_s, side="right") - 1])

    def _angle_text(self, begin_s: float, end_s: float, open_end: bool) -> str:
        clock = self.data.clock_hz
        vector = self.scenario.drive.method == "vector"
        series = self.analysis.angles if vector else self.analysis.commutations
        part = series.between(begin_s * clock, end_s * clock)
        error = part.error_deg[np.isfinite(part.error_deg)]
        time = part.cycle[np.isfinite(part.error_deg)] / clock
        error = np.degrees(np.unwrap(np.radians(error)))
        what = "published angle" if vector else "commutation"
        for a, b in _stretches(np.abs(error) > LOST_DEG, open_end):
            if (time[b - 1] - time[a] >= LOST_S) if vector else (b - a >= LOST_COMMUTATIONS):
                far = float(np.abs(error[a:b]).max())
                return f"from {time[a]:.4f} s on the {what} is up to {far:.0f} deg from the rotor while the drive runs"
        return ""

    def _apart_text(self, begin_s: float, end_s: float, open_end: bool) -> str:
        """Of the speed that six-step operation measures. A vector drive's may lag while its angle, judged, is right."""
        if self.scenario.drive.method == "vector":
            return ""
        inside = (self.time_s >= begin_s) & (self.time_s < end_s)
        time, drive = self.time_s[inside], np.abs(self.states["speed_rpm"][inside])
        rotor = np.abs(self._rotor_rpm(time))
        floor = APART_OF_MAX * self.scenario.motor.max_speed_rpm
        for a, b in _stretches(np.abs(drive - rotor) > np.maximum(APART * np.maximum(drive, rotor), floor), open_end):
            # A mean over an electrical turn, which a slow rotor that accelerates leaves behind.
            turn_s = 60.0 / (self.scenario.motor.pole_pairs * max(drive[a], floor))
            if time[b - 1] - time[a] >= max(APART_S, APART_TURNS * turn_s):
                return f"from {time[a]:.4f} s on the drive measures {drive[a]:.0f} r/min, the rotor has {rotor[a]:.0f}"
        return ""

    def _rotor_rpm(self, time_s: FloatArray) -> FloatArray:
        omega = self.analysis.track.omega_rad_s(time_s * self.data.clock_hz)
        return omega * 30.0 / math.pi / self.data.pole_pairs

    # The speed.

    def spans(self) -> list[Span]:
        """Windows, and the end of the run, in which the speed must have settled; the others are noted as not judged."""
        if self.scenario.mechanics.mode != "free":
            self.unjudged.append(f"the speed is not the drive's: mechanics.mode = {self.scenario.mechanics.mode}")
            return []
        found = [self._span(f"in {w.name}", w.name, w.from_s, w.to_s) for w in self.scenario.window]
        end_s = self.analysis.track.last_cycle / self.data.clock_hz
        target = self._target_before(end_s)
        length_s = max(END_S, 60.0 / abs(target)) if target else END_S
        found.append(self._span("at the end", None, end_s - length_s, end_s))
        return [span for span in found if span is not None]

    def _target_before(self, t_s: float) -> float | None:
        """Speed that the drive was asked for until t_s: a span ends where a command at its end begins."""
        if self.by_bus:
            row = np.searchsorted(self.time_s, t_s, side="left") - 1
            return float(self.states["target_rpm"][row]) or None if row >= 0 else None
        return next((c.target_rpm for c in reversed(self.commands) if c.at_s < t_s), None)

    def _span(self, where: str, window: str | None, from_s: float, to_s: float) -> Span | None:
        target = self._target_before(to_s)
        segment = next((s for s in self.segments if s[0] <= from_s and to_s <= s[1]), None)
        reason = ""
        if not target:
            reason = "no speed was asked for"
        elif segment is None:
            reason = "the drive does not run throughout"
        if reason or not target or segment is None:
            self.unjudged.append(f"speed {where} not judged: {reason}")
            return None
        due_s = self._due_s(segment[0], to_s)
        span = self._measured(where, window, from_s, to_s, target)
        slow = span.mean_rpm / target < 0.5 and from_s >= due_s + RISING / SETTLING * self.settling_s
        if from_s < due_s + self.settling_s and not slow:
            self.unjudged.append(f"speed {where} not judged: the speed has had no time to settle")
            return None
        return span

    def _measured(self, where: str, window: str | None, from_s: float, to_s: float, target: float) -> Span:
        clock, track = self.data.clock_hz, self.analysis.track
        low, high = max(from_s * clock, track.first_cycle), min(to_s * clock, track.last_cycle)
        turned = track.theta_rad(np.array([low, high]))
        mean = float(turned[1] - turned[0]) * clock / (high - low) * 30.0 / math.pi / self.data.pole_pairs
        records = self.data.records
        inside = records["omega_e"][(records["t_cycle"] >= low) & (records["t_cycle"] <= high)]
        least, most = np.array([inside.min(), inside.max()]) * 30.0 / math.pi / self.data.pole_pairs
        return Span(where, window, from_s, to_s, target, mean, float(least), float(most))

    def _due_s(self, begin_s: float, to_s: float) -> float:
        """When the ramp of a drive that runs since begin_s has ended, and all that disturbs it before to_s."""
        if self.by_bus:
            # Its reference is on the way to the target, or follows a torque.
            away = np.abs(np.abs(self.states["reference_rpm"]) - np.abs(self.states["target_rpm"])) > 1.0
            away |= np.diff(self.states["target_rpm"], prepend=0.0) != 0.0
            late = self.time_s[away & (self.time_s <= to_s)]
            return max(begin_s, float(late[-1]) if late.size else 0.0)
        reference = float(self._rotor_rpm(np.array([begin_s]))[0])
        now_s, goal, accel, disturbed_s = begin_s, self._target_before(begin_s), self.scenario.accel_rpm_per_s, begin_s
        for c in self.commands:
            if c.at_s >= to_s:
                break
            if c.at_s > begin_s:
                way = 0.0 if goal is None else goal - reference
                reference += math.copysign(min(abs(way), accel * (c.at_s - now_s)), way)
                now_s = c.at_s
            goal, accel = c.target_rpm, c.accel_rpm_per_s
            disturbed_s = max(disturbed_s, c.until_s)
        due_s = now_s + abs((goal or 0.0) - reference) / accel
        return max(due_s, disturbed_s)

    def misses(self, spans: list[Span]) -> list[Miss]:
        """Spans off their targets."""
        return [self._miss(span) for span in spans if not abs(span.deviation) <= SPEED_TOLERANCE]

    def swing_findings(self, spans: list[Span]) -> list[Finding]:
        """Spans whose mean is right and whose speed is not."""
        most = self.scenario.motor.max_speed_rpm
        return [
            Finding("speed", f"{s.text}, but it swings from {s.least_rpm:.1f} to {s.most_rpm:.1f} r/min", s.window)
            for s in spans
            if abs(s.deviation) <= SPEED_TOLERANCE and s.swings(most)
        ]

    def _miss(self, span: Span) -> Miss:
        shares = {name: self._share(code, span.from_s, span.to_s) for code, name in LIMITS.items()}
        limit = max(shares, key=lambda name: shares[name])
        if shares[limit] < CAUSE_SHARE:
            return Miss(span, None, 0.0)
        begin_s = next(a for a, b in self.segments if a <= span.from_s and span.to_s <= b)
        code = next(code for code, name in LIMITS.items() if name == limit)
        return Miss(span, limit, self._share(code, begin_s, span.to_s) * (span.to_s - begin_s))

    def _share(self, code: int, from_s: float, to_s: float) -> float:
        """Share of a time in which a limit was active."""
        inside = (self.time_s >= from_s) & (self.time_s < to_s)
        return float(np.mean(self.states["limit"][inside] == code)) if inside.any() else 0.0

    def target_findings(self) -> list[Finding]:
        """A drive that runs with another target than the scenario gave it."""
        if self.by_bus or not self.states.size or self.states["state"][-1] != RUNNING:
            return []
        given = [target for _, target in self.scenario.speed_targets()]
        has = float(self.states["target_rpm"][-1])
        if not given or abs(has - given[-1]) < 1.0:
            return []
        return [Finding("speed", f"the drive's target is {has:g} r/min, it was given {given[-1]:g} r/min")]

    # The current.

    def current_notes(self) -> list[str]:
        """A current above the limit of the file; with a limit that is set on the way it is not known."""
        lines = (event.command or "" for event in self.scenario.event)
        if self.by_bus or any(line.startswith(f"set {key} ") for line in lines for key in CURRENT_LIMITS):
            return []
        most_a, at_s = largest_current(self.data, self.scenario.drive.method == "vector")
        share = most_a / self.scenario.current_limit_a
        if share <= CURRENT_SHARE:
            return []
        limit = with_unit(self.scenario.current_limit_a, "A")
        return [f"current: {most_a:.3g} A for a millisecond from {at_s:.4f} s on, {share:.0%} of its limit of {limit}"]


def _stretches(mask: np.ndarray, open_end: bool) -> list[tuple[int, int]]:
    """Begin and end of each stretch of True; one that lasts to the end only with open_end."""
    change = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False])).astype(np.int8)))
    found = list(zip(change[::2].tolist(), change[1::2].tolist(), strict=True))
    return [(a, b) for a, b in found if open_end or b < mask.size]


def trip_failures(trip_list: list[dict[str, Any]], expected_trips: list[Any]) -> list[str]:
    """Trips that were not expected, and expected ones that did not happen, a line each."""
    lines = []
    seen: set[str] = set()
    for trip in trip_list:
        causes = set(str(trip["cause"]).split("+"))
        seen |= causes
        if not causes & set(expected_trips):
            lines.append(f"trip at {trip['time_s']:.6f} s: {trip['cause']}")
    return lines + [f"expected trip did not happen: {cause}" for cause in expected_trips if cause not in seen]


def fault_failures(
    fault: str | None, trip_list: list[dict[str, Any]], expected: str | None, phase: str | None = None
) -> list[str]:
    """A fault in which the drive ended and that was not expected, and an expected one that is not there.

    A fault that a trip of the run means is judged with the trip. A lost lock alone is no end: the drive starts again.
    phase: of the start, in which its last attempt failed.
    """
    causes = {cause for trip in trip_list for cause in str(trip["cause"]).split("+")} - {"lost_lock"}
    missing = expected is not None and fault != expected
    lines = [f"expected fault is not there at the end: {expected}"] if missing else []
    if fault is not None and fault != expected and fault not in map(trip_fault, causes):
        lines.append(f"the drive ended in fault {fault}" + (f": its last attempt failed in {phase}" if phase else ""))
    return lines


def rejected_findings(rejected: list[Rejection]) -> list[Finding]:
    """Console lines that were refused or not answered, a line each."""
    return [Finding("rejected", f'console at {r.time_s:.6f} s: "{r.line}" was rejected: {r.reason}') for r in rejected]


def expectation_failures(expectations: list[dict[str, Any]]) -> list[str]:
    """Expectations that were missed, a line each."""
    lines = []
    for e in expectations:
        if not e["pass"]:
            limits = {word: e[word] for word in ("min", "max") if e[word] is not None}
            value = "no value" if e["value"] is None else apart(e["value"], limits.values())
            expected = " and ".join(f"{word} {limit:.12g}" for word, limit in limits.items())
            lines.append(f"{e['window']}: {e['metric']} is {value}, expected {expected}")
    return lines


def _speed_findings(misses: list[Miss]) -> list[Finding]:
    """A line per limit and target, of all places where it was missed."""
    groups: dict[tuple[str, float], list[Miss]] = {}
    for miss in misses:
        groups.setdefault((miss.kind, miss.span.target_rpm), []).append(miss)
    found = []
    for (kind, _), group in groups.items():
        first = group[0].span
        line = f"{first.text} ({100.0 * first.deviation:+.1f} %)"
        line += "".join(f", {m.span.mean_rpm:.1f} {m.span.where}" for m in group[1:])
        if kind in REMEDIES:
            active_s = max(m.active_s for m in group)
            line += f": limit {kind} active for {active_s:.3f} s ({LIMIT_TEXTS[kind]}); {REMEDIES[kind]}, "
            line += f'or state it: [[accept]] what = "{kind}"'
        else:
            line += ", and no limit of the drive was active"
        found.append(Finding(kind, line, first.window))
    return found


def _accepts(accept: Accept, kind: str, window: str | None) -> bool:
    covers = accept.what == kind or (accept.what == "speed" and kind in REMEDIES)
    return covers and (accept.window is None or accept.window == window)


def judge_run(
    data: RunData,
    scenario: Scenario,
    analysis: Analysis,
    metrics: dict[str, dict[str, Any]],
    *,
    by_bus: bool = False,
    broken: str | None = None,
) -> Verdict:
    """Whether a run can be vouched for.

    metrics: of the scenario's windows. by_bus: see `Judge`. broken: why the simulation ended early; what follows from
    that is not listed.
    """
    judge_of = Judge(data, scenario, analysis, by_bus)
    trip_list = trips(data)
    accepted: dict[str, str] = {}

    def open_(kind: str, window: str | None = None) -> bool:
        found = next((a for a in scenario.accept if _accepts(a, kind, window)), None)
        if found is not None:
            accepted[kind] = found.why
        return found is None

    def left(findings: list[Finding]) -> list[str]:
        return [f.line for f in findings if open_(f.kind, f.window)]

    faults = fault_failures(data.fault, trip_list, scenario.expect_fault, data.failed_phase)
    causes = [
        *([f"simulation: {broken}"] if broken else []),
        *left([Finding("trip", line) for line in trip_failures(trip_list, scenario.expect_trip)]),
        *left([Finding("fault", line) for line in faults]),
        *left(rejected_findings(data.rejected)),
    ]
    spans: list[Span] = []
    if not broken:
        angle = judge_of.angle_findings()
        causes += left([f for f in angle if f.kind != "lost_lock" or "lost_lock" not in scenario.expect_trip])
        causes += left(judge_of.late_findings())
    if not causes:
        causes += left([*judge_of.state_findings(), *judge_of.target_findings()])
    if not causes:
        spans = judge_of.spans()
        causes += [f.line for f in _speed_findings([m for m in judge_of.misses(spans) if open_(m.kind, m.span.window)])]
        causes += left(judge_of.swing_findings(spans))
    notes = (*(f"overload on purpose: {line}" for line in overloads(scenario)), *judge_of.current_notes())
    expectations = [judge(e, metrics) for e in scenario.expect]
    causes += expectation_failures(expectations)
    if causes:
        return Verdict(False, causes, notes)
    text = ", ".join(span.text for span in spans) or "no speed to judge"
    if expectations:
        text += f"; {len(expectations)} limits kept"
    lines = [text, *(f"accepted {kind}: {why}" for kind, why in accepted.items()), *judge_of.unjudged]
    return Verdict(True, lines, notes)
