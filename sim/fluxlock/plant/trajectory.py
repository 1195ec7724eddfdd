# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What the plant has recorded: waveforms, zoomed waveforms, diode events; and its true angle at any time."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from . import layout as L

FloatArray = npt.NDArray[np.float64]
RecordArray = npt.NDArray[np.void]


# Units: clock cycles (fractional for events), electrical rad (unwrapped), rad/s, A into the machine, V
# against the negative rail, A drawn from the link, N*m. gates: bit 2X = upper, bit 2X+1 = lower switch of leg
# X, in force before the instant (in the second of two rows of one instant: after it).
def wave_dtype(phases: int) -> np.dtype[Any]:
    """Columns of a waveform row of a machine with so many phases."""
    letters = "abcde"[:phases]
    names = ["t_cycle", "theta_e", "omega_e", *(f"i{x}" for x in letters), *(f"v{x}" for x in letters)]
    return np.dtype([*((name, "f8") for name in (*names, "vdc", "idc", "torque_nm")), ("gates", "i8")])


WAVE_DTYPE = wave_dtype(3)
# kind: 1 = the freewheeling current of an off leg ended, 2 = a diode of a floating leg turned on.
EVENT_DTYPE = np.dtype([("t_cycle", "f8"), ("kind", "i8"), ("phase", "i8"), ("theta_e", "f8")])


class Buffer:
    """One record buffer of the state vector, and the rows already taken out of it."""

    def __init__(self, state: FloatArray, at: int, count: int, columns: int, dtype: np.dtype[Any]) -> None:
        self._state = state
        self._at = int(state[at])
        self._count = count
        self._columns = columns
        self._dtype = dtype
        self._taken: list[RecordArray] = []

    def drain(self) -> RecordArray:
        """Take the new rows out of the state vector and return them."""
        rows = int(self._state[self._count])
        table = self._state[self._at : self._at + rows * self._columns].reshape(rows, self._columns)
        new: RecordArray = np.empty(rows, self._dtype)
        for k, name in enumerate(self._dtype.names or ()):
            new[name] = table[:, k]
        self._state[self._count] = 0.0
        if rows:
            self._taken.append(new)
        return new

    def all(self) -> RecordArray:
        """All rows so far."""
        self.drain()
        if not self._taken:
            return np.empty(0, self._dtype)
        if len(self._taken) > 1:
            self._taken = [np.concatenate(self._taken)]
        return self._taken[0]

    def forget(self) -> None:
        """Drop the rows so far."""
        self._taken.clear()


def angle_between(records: RecordArray, t_cycles: npt.ArrayLike, clock_period_s: float) -> FloatArray:
    """True electrical angle (rad, unwrapped) at times within the records: cubic Hermite interpolation."""
    t = np.asarray(t_cycles, float)
    known, first = np.unique(records["t_cycle"], return_index=True)
    if known.size < 2 or (t.size and not (known[0] <= t.min() and t.max() <= known[-1])):
        span = f"{known[0]:.0f} to {known[-1]:.0f}" if known.size else "none"
        raise ValueError(f"t_cycles: must lie within the recorded cycles ({span})")
    theta, omega = records["theta_e"][first], records["omega_e"][first]
    k = np.clip(np.searchsorted(known, t, side="right") - 1, 0, known.size - 2)
    width = known[k + 1] - known[k]
    x = (t - known[k]) / width
    seconds = width * clock_period_s
    rise = theta[k + 1] - theta[k]
    left = omega[k] * seconds - rise
    right = rise - omega[k + 1] * seconds
    return np.asarray(theta[k] + x * (rise + (1.0 - x) * ((1.0 - x) * left + x * right)))


def wave_buffer(state: FloatArray, phases: int) -> Buffer:
    """Waveform records on the coarse grid."""
    return Buffer(state, L.WAVE_AT, L.WAVE_COUNT, L.WAVE_COLUMNS + 2 * phases, wave_dtype(phases))


def zoom_buffer(state: FloatArray, phases: int) -> Buffer:
    """Waveform records of the zoom windows."""
    return Buffer(state, L.ZOOM_AT, L.ZOOM_COUNT, L.WAVE_COLUMNS + 2 * phases, wave_dtype(phases))


def event_buffer(state: FloatArray) -> Buffer:
    """Diode events."""
    return Buffer(state, L.EVENT_AT, L.EVENT_COUNT, L.EVENT_COLUMNS, EVENT_DTYPE)
