# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Metrics of a run: errors of crossings and commutations against the plant's true angle, waveforms, trips.

A positive error of a crossing or a commutation means late, a positive error of an angle means ahead. `rms` is about
zero, `std` about the mean, `max` of the absolute value. A metric is None if its window holds nothing to measure.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from fluxlock.config.drive import ADVANCE_MAX_DEG
from fluxlock.config.scenario import Expect, Scenario
from fluxlock.results.angles import (
    FLOATING_PHASE,
    AngleTrack,
    commutation_error_deg,
    crossing_error_deg,
    dq_current,
    phase_currents,
    wrap_deg,
)
from fluxlock.results.pwm_phase import PhaseBins, phase_bins, pulse_starts, pwm_phase
from fluxlock.results.rundata import (
    BoolArray,
    FloatArray,
    IntArray,
    LogKind,
    PlantEventKind,
    RunData,
    trip_cause_names,
)

# A commutation's own gate edge follows the change of the sector register within this many clocks; without an
# edge (the switches were off already) the gates would have changed one clock after it.
EDGE_SEARCH_CYCLES = 8
GUARD_CYCLES = 1
# A phase current below this fraction of the window's largest counts as no current: nothing to freewheel.
NO_CURRENT_FRACTION = 0.02
# From a commutation without advance to the crossing of its sector: by then the freewheeling must be over.
CROSSING_DEG = 30.0
# A current is judged by its largest mean over this time.
CURRENT_MEAN_S = 1e-3
# Below it a turn has no meaningful mean.
MIN_SPEED_RAD_S = 1.0

Number = float | int | None


@dataclass(frozen=True)
class Series:
    """Errors over time: one entry a crossing, a commutation or a current sample."""

    cycle: FloatArray
    sector: IntArray
    theta_rad: FloatArray
    direction: FloatArray
    error_deg: FloatArray
    late: BoolArray

    def between(self, low: float, high: float) -> Series:
        """Entries with low <= cycle < high."""
        keep = (self.cycle >= low) & (self.cycle < high)
        return Series(
            self.cycle[keep],
            self.sector[keep],
            self.theta_rad[keep],
            self.direction[keep],
            self.error_deg[keep],
            self.late[keep],
        )

    def intervals_deg(self) -> FloatArray:
        """True angles between successive entries, positive in the direction of rotation."""
        steps: FloatArray = np.degrees(np.diff(self.theta_rad)) * self.direction[1:]
        return steps


def largest_current(data: RunData, vector: bool) -> tuple[float, float]:
    """Largest mean over CURRENT_MEAN_S, A, and its begin, s. Of the conducting pair in six-step, else the amplitude.

    A shorter run has one mean, over all of it.
    """
    records = data.records
    time_s = records["t_cycle"] / data.clock_hz
    pair = 0.5 * sum(np.abs(records[name]) for name in ("ia", "ib", "ic"))
    size: FloatArray = np.abs(dq_current(records)) if vector else np.asarray(pair, dtype=np.float64)
    count = min(max(1, round(CURRENT_MEAN_S / float(np.median(np.diff(time_s))))), size.size)
    mean = np.convolve(size, np.full(count, 1.0 / count), "valid")
    return float(mean.max(initial=0.0)), float(time_s[int(mean.argmax())])


def gate_change_cycles(data: RunData) -> IntArray:
    """Cycle at which the gates changed for each applied commutation of the log.

    That is the first edge, at most EDGE_SEARCH_CYCLES after the sector changed, in the leg that stops or the
    leg that starts to conduct; the third leg's edges belong to the carrier.
    """
    commutations, gates = data.rows(LogKind.COMMUTATION), data.rows(LogKind.GATES)
    cycle, sector = commutations[:, 0], commutations[:, 2]
    result = cycle + GUARD_CYCLES
    if not gates.size:
        return result
    changed = np.bitwise_xor(gates[:, 2], np.concatenate(([0], gates[:-1, 2])))
    incoming = FLOATING_PHASE[np.concatenate((sector[:1], sector[:-1]))]
    mask = (3 << 2 * FLOATING_PHASE[sector]) | (3 << 2 * incoming)
    first = np.searchsorted(gates[:, 0], cycle, side="left")
    found = np.zeros(cycle.size, dtype=np.bool_)
    # The log has at most one row of gates a clock, so that many rows cover the search.
    for offset in range(EDGE_SEARCH_CYCLES + 1):
        row = np.minimum(first + offset, len(gates) - 1)
        lag = gates[row, 0] - cycle
        hit = ~found & (lag >= 0) & (lag <= EDGE_SEARCH_CYCLES) & ((changed[row] & mask) != 0)
        result = np.where(hit, gates[row, 0], result)
        found |= hit
    return result


@dataclass(frozen=True)
class Advance:
    """Commutation advance that the drive is set to: constant, by speed and by current, in all within 30 deg.

    deg; deg_per_rad_s: over electrical speed; deg_per_a: over the current of the conducting pair.
    """

    deg: float = 0.0
    deg_per_rad_s: float = 0.0
    deg_per_a: float = 0.0

    @staticmethod
    def of(scenario: Scenario) -> Advance:
        """The settings of a scenario; console lines that change them later are not followed."""
        drive, motor = scenario.drive, scenario.motor
        return Advance(
            drive.advance_deg,
            drive.advance_deg_at_max_speed / motor.omega_e(motor.max_speed_rpm),
            drive.advance_deg_at_rated_current / scenario.rated_current_a,
        )

    def at(self, omega_rad_s: FloatArray, current_a: FloatArray) -> FloatArray:
        """Degrees at the magnitude of a speed and a current; a braking current counts as none."""
        total = self.deg + self.deg_per_rad_s * np.abs(omega_rad_s) + self.deg_per_a * np.maximum(current_a, 0.0)
        return np.clip(total, -ADVANCE_MAX_DEG, ADVANCE_MAX_DEG)


class Analysis:
    """Derived series of one run, computed once and shared by metrics and plots."""

    def __init__(self, data: RunData, advance: Advance | None = None) -> None:
        self.data = data
        self.advance = advance or Advance()
        self.track = AngleTrack(data.records, data.clock_hz)

    def line_current_a(self, cycle: FloatArray) -> FloatArray:
        """Current of the conducting pair: half the sum of the phases' magnitudes, mean over the turn before.

        Negative where the torque of that turn brakes.
        """
        records = self.data.records
        time = records["t_cycle"].astype(np.float64)
        magnitude = 0.5 * sum(np.abs(records[name]) for name in ("ia", "ib", "ic"))
        torque = records["torque_nm"] * self.track.direction(time)
        omega = np.maximum(np.abs(self.track.omega_rad_s(cycle)), MIN_SPEED_RAD_S)
        begin = cycle - 2 * math.pi / omega * self.data.clock_hz
        turn_of = [
            np.concatenate(([0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(time))))
            for values in (magnitude, torque)
        ]
        current, sign = (np.interp(cycle, time, area) - np.interp(begin, time, area) for area in turn_of)
        mean: FloatArray = np.where(sign < 0, -1.0, 1.0) * current / (cycle - np.maximum(begin, time[0]))
        return mean

    @cached_property
    def crossings(self) -> Series:
        """Every crossing at the time that the chip claims for it."""
        rows = self.data.rows(LogKind.CROSSING)
        cycle, sector = rows[:, 3].astype(np.float64), rows[:, 2] & 7
        theta, direction = self.track.theta_rad(cycle), self.track.direction(cycle)
        error = crossing_error_deg(theta, sector, direction)
        return Series(cycle, sector, theta, direction, error, (rows[:, 2] >> 4 & 1).astype(np.bool_))

    @cached_property
    def commutations(self) -> Series:
        """Every commutation at the clock in which the gates changed."""
        cycle = gate_change_cycles(self.data).astype(np.float64)
        sector = self.data.rows(LogKind.COMMUTATION)[:, 2] & 7
        theta, direction = self.track.theta_rad(cycle), self.track.direction(cycle)
        current = self.line_current_a(cycle) if self.advance.deg_per_a else np.zeros(cycle.size)
        advance_deg = self.advance.at(self.track.omega_rad_s(cycle), current)
        error = commutation_error_deg(theta, sector, direction, advance_deg)
        return Series(cycle, sector, theta, direction, error, np.zeros(cycle.size, dtype=np.bool_))

    @cached_property
    def pulses(self) -> IntArray:
        """Cycles at which the pulses begin."""
        rows = self.data.rows(LogKind.GATES)
        return pulse_starts(rows[:, 0], rows[:, 2])

    def commutation_phases(self, low: float, high: float) -> PhaseBins:
        """Errors of the commutations of a span (cycles), about their mean, by their crossings' place in a carrier.

        A commutation itself begins a carrier with CSC: the crossing before it is what edges disturb.
        """
        found = self.commutations.between(low, high)
        error = found.error_deg - found.error_deg.mean() if found.error_deg.size else found.error_deg
        before = np.searchsorted(self.crossings.cycle, found.cycle, side="left") - 1
        known = before >= 0
        return phase_bins(pwm_phase(self.crossings.cycle[before[known]], self.pulses), error[known])

    @cached_property
    def angles(self) -> Series:
        """Published angle at every current sample of the vector path: that of the frame and what firmware adds.

        Samples before the plant's first record or after its last one are left out: the true angle is not known there.
        """
        rows = self.data.rows(LogKind.ANGLE)
        rows = rows[(rows[:, 0] >= self.track.first_cycle) & (rows[:, 0] <= self.track.last_cycle)]
        cycle, none = rows[:, 0].astype(np.float64), np.zeros(len(rows), dtype=np.int64)
        theta, direction = self.track.theta_rad(cycle), self.track.direction(cycle)
        error = wrap_deg(np.asarray((rows[:, 2] + rows[:, 3]) * (360.0 / 2**32) - np.degrees(theta)))
        return Series(cycle, none, theta, direction, error, none.astype(np.bool_))

    def freewheel_deg(self, low: float, high: float) -> FloatArray:
        """Angle from each commutation of a span to the extinction of the outgoing phase's current.

        Without extinction before the next commutation: the whole sector if the phase carried current, else 0.
        """
        c = self.commutations
        events = self.data.plant_events
        ends = events[events["kind"] == int(PlantEventKind.EXTINCTION)]
        records = self.data.records
        end_cycle, end_phase = ends["t_cycle"].copy(), ends["phase"].copy()
        time = records["t_cycle"].astype(np.float64)
        inside = (time >= low) & (time < high)
        currents = np.stack([records[name] for name in ("ia", "ib", "ic")])
        largest = float(np.abs(currents[:, inside]).max(initial=0.0))
        angles = []
        for k in np.flatnonzero((c.cycle[:-1] >= low) & (c.cycle[1:] < high)):
            phase, start, limit = FLOATING_PHASE[c.sector[k]], c.cycle[k], c.cycle[k + 1]
            a, b = np.searchsorted(end_cycle, (start, limit), side="left")
            own = end_cycle[a:b][end_phase[a:b] == phase]
            carried = abs(float(np.interp(start, time, currents[phase])))
            unfinished = limit if carried > NO_CURRENT_FRACTION * largest else start
            end = float(own[0]) if own.size else unfinished
            turned = self.track.theta_rad(np.array([end])) - c.theta_rad[k]
            angles.append(abs(float(np.degrees(turned)[0])))
        return np.array(angles, dtype=np.float64)

    def window(self, from_s: float, to_s: float) -> dict[str, Any]:
        """Metrics of one window; the keys are those of the scenario's METRICS."""
        clock = self.data.clock_hz
        low = max(from_s * clock, self.track.first_cycle)
        high = min(to_s * clock, self.track.last_cycle)
        crossings, commutations = self.crossings.between(low, high), self.commutations.between(low, high)
        records = self.data.records
        records = records[(records["t_cycle"] >= low) & (records["t_cycle"] <= high)]
        freewheel = self.freewheel_deg(low, high)
        angle = _error_statistics(self.angles.between(low, high).error_deg)
        current = _mean_current(records)
        return {
            "speed_rpm": self._speed(records, low, high),
            "zcp_error_deg": _error_statistics(crossings.error_deg),
            "commutation_error_deg": _error_statistics(commutations.error_deg),
            "sector_interval_deg": _extremes(crossings.intervals_deg()),
            "commutation_interval_deg": _extremes(commutations.intervals_deg()),
            "phase_current_pp_a": _peak_to_peak(records),
            "freewheel_deg": {
                "mean": float(freewheel.mean()) if freewheel.size else None,
                "max": float(freewheel.max()) if freewheel.size else None,
            },
            "demagnetisation_margin_deg": CROSSING_DEG - float(freewheel.max()) if freewheel.size else None,
            "pwm_phase_error_pp_deg": self.commutation_phases(low, high).pp_deg if commutations.cycle.size else None,
            "torque_nm": _torque(records),
            "late_crossings": int(np.count_nonzero(crossings.late)),
            "angle_error_deg": {kind: angle[kind] for kind in ("mean", "rms", "max")},
            "id_a": None if current is None else current.real,
            "iq_a": None if current is None else current.imag,
        }

    def _speed(self, records: np.ndarray, low: float, high: float) -> dict[str, Number]:
        """Mean from the angle turned, extremes from the records; mechanical."""
        if records.size < 2 or high <= low:
            return {"mean": None, "min": None, "max": None}
        to_rpm = 30.0 / math.pi / self.data.pole_pairs
        turned = self.track.theta_rad(np.array([low, high]))
        return {
            "mean": float((turned[1] - turned[0]) * self.data.clock_hz / (high - low)) * to_rpm,
            "min": float(records["omega_e"].min()) * to_rpm,
            "max": float(records["omega_e"].max()) * to_rpm,
        }


def _error_statistics(error_deg: FloatArray) -> dict[str, Number]:
    if not error_deg.size:
        return {"mean": None, "std": None, "rms": None, "max": None}
    return {
        "mean": float(error_deg.mean()),
        "std": float(error_deg.std()),
        "rms": float(np.sqrt(np.mean(error_deg * error_deg))),
        "max": float(np.abs(error_deg).max()),
    }


def _extremes(values: FloatArray) -> dict[str, Number]:
    return {
        "min": float(values.min()) if values.size else None,
        "max": float(values.max()) if values.size else None,
    }


def _peak_to_peak(records: np.ndarray) -> Number:
    """Largest minus smallest current in the window, mean of the phases."""
    if not records.size:
        return None
    return float(np.mean([np.ptp(records[name]) for name in phase_currents(records)]))


def _torque(records: np.ndarray) -> dict[str, Number]:
    """Electromagnetic torque: mean over time and peak-to-peak ripple."""
    if records.size < 2:
        return {"mean": None, "ripple_pp": None}
    time, torque = records["t_cycle"].astype(np.float64), records["torque_nm"]
    return {
        "mean": float(np.trapezoid(torque, time) / (time[-1] - time[0])),
        "ripple_pp": float(np.ptp(torque)),
    }


def _mean_current(records: np.ndarray) -> complex | None:
    """Mean over time of the current in the rotor's frame, d + jq."""
    if records.size < 2:
        return None
    time = records["t_cycle"].astype(np.float64)
    return complex(np.trapezoid(dq_current(records), time) / (time[-1] - time[0]))


def trips(data: RunData) -> list[dict[str, Any]]:
    """All trips with cause and time. Causes of the same clock are joined with `+`."""
    return [
        {
            "cause": "+".join(trip_cause_names(int(row[2]))) or "unknown",
            "time_s": float(row[0] / data.clock_hz),
        }
        for row in data.rows(LogKind.TRIP)
    ]


def lookup(metrics: dict[str, Any], dotted: str) -> Number:
    """Metric of a window by its dotted name."""
    value: Any = metrics
    for part in dotted.split("."):
        value = value[part]
    assert value is None or isinstance(value, (int, float))
    return value


def judge(expect: Expect, metrics: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """One expectation with the measured value; a metric without value fails."""
    value = lookup(metrics[expect.window], expect.metric)
    low = -math.inf if expect.min is None else expect.min
    high = math.inf if expect.max is None else expect.max
    return {
        "window": expect.window,
        "metric": expect.metric,
        "value": value,
        "min": expect.min,
        "max": expect.max,
        "pass": value is not None and low <= value <= high,
    }


def run_metrics(data: RunData, scenario: Scenario) -> tuple[Analysis, dict[str, dict[str, Any]]]:
    """Metrics of all windows of a scenario."""
    analysis = Analysis(data, Advance.of(scenario))
    return analysis, {w.name: analysis.window(w.from_s, w.to_s) for w in scenario.window}
