# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The newest stretch of all traces, and what a screen shows of it: least and largest value per pixel."""

from __future__ import annotations

from bisect import bisect_left
from collections import deque
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fluxlock.config.motor import RPM_PER_RAD_S
from fluxlock.firmware.binding import names
from fluxlock.native.play import Taken
from fluxlock.results.rundata import IntArray, LogKind

Floats = NDArray[np.floating[Any]]

# Names, units and what each is. "true": of the machine, which no board knows.
TRACES = {
    "speed_rpm": ("r/min", "true speed"),
    "measured_rpm": ("r/min", "the drive's speed"),
    "reference_rpm": ("r/min", "the drive's ramp"),
    "target_rpm": ("r/min", "target"),
    "ia": ("A", "true current of phase A"),
    "ib": ("A", "true current of phase B"),
    "ic": ("A", "true current of phase C"),
    "idc": ("A", "current of the DC link"),
    "id": ("A", "true current along the rotor's flux"),
    "iq": ("A", "true current across the rotor's flux"),
    "motor_a": ("A", "current of the machine by the drive's account"),
    "vdc": ("V", "voltage of the DC link"),
    "va": ("V", "terminal A"),
    "vb": ("V", "terminal B"),
    "vc": ("V", "terminal C"),
    "torque_nm": ("N*m", "true torque of the machine"),
    "theta_deg": ("deg", "true electrical angle"),
    "angle_error_deg": ("deg", "the drive's angle from the true one; six-step: the field from its best place"),
    "estimate_deg": ("deg", "the drive's electrical angle; six-step: the field's, where the rotor would be best"),
    "state": ("number", "state of the drive"),
    "limit": ("number", "limit that is active"),
    "current_d": ("A", "true current of phase D, of five"),
    "current_e": ("A", "true current of phase E, of five"),
    "core_load": ("%", "time in which the soft core had something to do"),
    "bus_load": ("%", "time in which frames were on the CAN bus"),
    "margin_deg": ("deg", "from the end of freewheeling to the true crossing; below 0: it hid the crossing"),
    **{
        f"gate_{leg}{side[0]}": ("level", f"gate of leg {leg.upper()}, {side} switch")
        for leg in "abcde"
        for side in ("high", "low")
    },
    **{
        f"compare_{leg}": ("level", f"terminal {leg.upper()} above the mean of all, as an analogue comparator sees it")
        for leg in "abc"
    },
}
NAMES = tuple(TRACES)
GATES = tuple(name for name in NAMES if name.startswith("gate_"))
COMPARATORS = tuple(name for name in NAMES if name.startswith("compare_"))
SIX_STEP_ONLY = (*COMPARATORS, "margin_deg")
CHIP_ONLY = (*GATES, *SIX_STEP_ONLY, "current_d", "current_e", "core_load", "bus_load")  # of these sources
TOLD = ("measured_rpm", "reference_rpm", "target_rpm", "state", "limit")
PLANE_POINTS = 400
CAPACITY = 2**19  # rows; at least half of them are kept
MARKS_KEPT, MARKS_SHOWN = 2**16, 200


# Instants that a page marks and triggers on; the place in this order is their number.
MARKS = ("commutation", "crossing", "crossing late", "trip", "state change", "fault", "crossing masked")
Marks = list[tuple[float, int]]  # time, s, and number in MARKS


def columns(taken: Taken, clock_hz: float, pole_pairs: int, last: Floats) -> tuple[Floats, Floats]:
    """Times and traces, float32 [len(NAMES), rows], of a stretch.

    last: the drive's own values before it, which stay.
    """
    records = taken.records
    updates = taken.log[taken.log[:, 1] == int(LogKind.UPDATE)]
    time_s = np.asarray(records["t_cycle"] / clock_hz)
    rows = np.zeros((len(NAMES), time_s.size), np.float32)
    place = {name: k for k, name in enumerate(NAMES)}
    legs = [name for name in ("a", "b", "c", "d", "e") if f"v{name}" in (records.dtype.names or ())]
    for name in ("idc", "vdc", "va", "vb", "vc", "torque_nm"):
        rows[place[name]] = records[name]
    vector = np.zeros(time_s.size, np.complex128)
    for k, leg in enumerate(legs):
        current = records[f"i{leg}"]
        rows[place[f"i{leg}" if k < 3 else f"current_{leg}"]] = current
        vector += 2 / len(legs) * current * np.exp(2j * np.pi * k / len(legs))
    rows[place["speed_rpm"]] = records["omega_e"] / pole_pairs * RPM_PER_RAD_S
    rows[place["theta_deg"]] = np.degrees(records["theta_e"]) % 360.0
    turned = vector * np.exp(-1j * records["theta_e"])
    rows[place["id"]], rows[place["iq"]] = turned.real, turned.imag
    for name, values in taken.more.items():
        rows[place[name]] = values
    rows[place["estimate_deg"]] = (rows[place["theta_deg"]] + rows[place["angle_error_deg"]]) % 360.0
    rows[place["motor_a"]] = np.nan
    for k, name in enumerate(GATES[: 2 * len(legs)]):
        rows[place[name]] = records["gates"] >> k & 1
    mean = sum(records[f"v{leg}"] for leg in legs) / len(legs)
    for leg, name in zip(legs, COMPARATORS, strict=False):
        rows[place[name]] = records[f"v{leg}"] > mean
    drive, command = updates[:, 2], updates[:, 3]
    told = np.stack(
        [
            (drive >> 32) / 256,
            command.astype(np.int32) / 256,
            command >> 32,
            drive & 0xFF,
            drive >> 16 & 0xF,
        ]
    )
    told = np.concatenate([last[:, None], told], axis=1)
    at = np.searchsorted(updates[:, 0], records["t_cycle"], side="right")
    for k, name in enumerate(TOLD):
        rows[place[name]] = told[k, at]
    last[:] = told[:, -1]
    return time_s, rows


def marks_of(log: IntArray, clock_hz: float, before: int) -> Marks:
    """What the rows of a log tell, in the order of time. before: state of the drive, by its number, until then."""
    found: Marks = []
    fault = names("drive_state_t").index("fault")
    for cycle, kind, a, _ in log.tolist():
        number = -1
        if kind == LogKind.COMMUTATION:
            number = MARKS.index("commutation")
        elif kind == LogKind.CROSSING:
            number = MARKS.index("crossing late" if a >> 4 else "crossing")
        elif kind == LogKind.TRIP:
            number = MARKS.index("trip")
        elif kind == LogKind.UPDATE and a & 0xFF != before:
            before = a & 0xFF
            number = MARKS.index("fault" if before == fault else "state change")
        if number >= 0:
            found.append((cycle / clock_hz, number))
    return found


class Ring:
    """Traces of a source in the order of NAMES."""

    def __init__(self, capacity: int = CAPACITY) -> None:
        self._time = np.zeros(capacity)
        self._rows = np.zeros((len(NAMES), capacity), np.float32)
        self._count = 0
        self._marks: deque[tuple[float, int]] = deque(maxlen=MARKS_KEPT)

    def clear(self) -> None:
        """Forget all."""
        self._count = 0
        self._marks.clear()

    def mark(self, marks: Marks) -> None:
        """Instants that follow those before."""
        self._marks.extend(marks)

    def marks(self, from_s: float, to_s: float) -> Marks:
        """Instants of a span, of more than MARKS_SHOWN none."""
        begin = bisect_left(self._marks, (from_s, -1))
        found = list(islice(self._marks, begin, begin + MARKS_SHOWN + 1))
        shown = [mark for mark in found if mark[0] <= to_s]
        return shown if len(shown) <= MARKS_SHOWN else []

    def last_mark(self, number: int, until_s: float) -> float | None:
        """Time of the last instant of a kind before a time; None: there is none in what is kept."""
        return next((at_s for at_s, kind in reversed(self._marks) if kind == number and at_s <= until_s), None)

    def append(self, time_s: Floats, rows: Floats) -> None:
        """Rows that follow those before."""
        capacity = self._time.size
        time_s, rows = time_s[-capacity // 2 :], rows[:, -capacity // 2 :]
        if self._count + time_s.size > capacity:
            kept = capacity // 2
            self._time[:kept] = self._time[self._count - kept : self._count]
            self._rows[:, :kept] = self._rows[:, self._count - kept : self._count]
            self._count = kept
        end = self._count + time_s.size
        self._time[self._count : end], self._rows[:, self._count : end] = time_s, rows
        self._count = end

    @property
    def newest_s(self) -> float:
        """Time of the last row."""
        return float(self._time[self._count - 1]) if self._count else 0.0

    def cut(self, from_s: float, to_s: float, names: list[str]) -> tuple[Floats, Floats]:
        """Times and traces of a span."""
        low, high = np.searchsorted(self._time[: self._count], (from_s, to_s))
        return self._time[low:high], self._rows[[NAMES.index(name) for name in names], low:high]

    def planes(self, from_s: float, to_s: float) -> dict[str, list[float] | float | None]:
        """Current vector in both frames, PLANE_POINTS at most, A; true angle and the drive's error at the end, deg.

        Of a source without true currents, as a board is, no points.
        """
        time_s, rows = self.cut(from_s, to_s, ["id", "iq", "theta_deg", "angle_error_deg"])
        known = np.isfinite(rows[:3]).all(axis=0)
        time_s, rows = time_s[known], rows[:, known]
        if time_s.size == 0:
            return {"alpha": [], "beta": [], "id": [], "iq": [], "theta_deg": None, "error_deg": None}
        d, q, angle, _ = rows[:, :: max(1, -(-time_s.size // PLANE_POINTS))].astype(float)
        theta, error = (float(value) for value in rows[2:, -1])
        vector = (d + 1j * q) * np.exp(1j * np.radians(angle))  # of any number of phases
        shown: dict[str, list[float] | float | None] = {"alpha": vector.real.tolist(), "beta": vector.imag.tolist()}
        shown |= {"id": d.tolist(), "iq": q.tolist()}
        ends = {
            name: value if np.isfinite(value) else None for name, value in (("theta_deg", theta), ("error_deg", error))
        }
        return shown | ends

    def picture(
        self, from_s: float, to_s: float, names: list[str], width: int, until_s: float | None = None
    ) -> tuple[Floats, Floats]:
        """Times and traces of a span, of more than two rows per pixel the least and the largest value.

        A pixel is a stretch of time. Next to pixels without a row stand the rows themselves, so a line between them is
        where it belongs. until_s: what is later is left out.
        """
        time_s, rows = self.cut(from_s, to_s if until_s is None else until_s, names)
        if time_s.size <= 2 * width:
            return time_s, rows
        begins = np.searchsorted(time_s, np.linspace(from_s, to_s, width, endpoint=False))
        pixels = np.flatnonzero(np.diff(begins, append=time_s.size))
        first = begins[pixels]
        last = np.append(first[1:], time_s.size) - 1
        low, high = np.fmin.reduceat(rows, first, axis=1), np.fmax.reduceat(rows, first, axis=1)
        falls = rows[:, last] < rows[:, first]
        both = np.empty((len(names), 2 * pixels.size), np.float32)
        both[:, 0::2], both[:, 1::2] = np.where(falls, high, low), np.where(falls, low, high)
        shown = np.column_stack([time_s[first], time_s[last]]).ravel()
        alone = np.flatnonzero(np.diff(pixels) > 1)
        edges = np.column_stack([last[alone], first[alone + 1]]).ravel()
        at = np.repeat(2 * (alone + 1), 2)
        return np.insert(shown, at, time_s[edges]), np.insert(both, at, rows[:, edges], axis=1)

    def last_crossing(self, name: str, level: float, rising: bool, size: bool, until_s: float) -> float | None:
        """Time of the last passage of a level before an instant; None: there is none in what is kept."""
        time_s, rows = self.cut(0.0, until_s, [name])
        values = np.abs(rows[0]) if size else rows[0]
        above = values >= level if rising else values <= level
        found = np.flatnonzero(above[1:] & ~above[:-1])
        return float(time_s[found[-1] + 1]) if found.size else None
