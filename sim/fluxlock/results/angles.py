# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""True rotor angle at any time, and the ideal instants of six-step operation.

theta is the plant's electrical angle (d axis against phase A); sectors are defined in theta' = theta + 180
deg. With positive speed sector s (0..5 = I..VI) is applied from theta' = 30 + 60 s to 90 + 60 s and its
crossing lies in the middle. With negative speed the EMFs are inverted and the angle falls: sector s is
applied in the window of sector s + 3, entered from above at 270 + 60 s, crossing at 240 + 60 s, and sectors
count down.
"""

from __future__ import annotations

import numpy as np

from fluxlock.results.rundata import ComplexArray, FloatArray, IntArray, RecordArray

# Floating phase of each sector, 0..2 = A..C. It is also the phase that stops conducting when the sector is
# entered.
FLOATING_PHASE = np.array([2, 1, 0, 2, 1, 0], dtype=np.int64)


class AngleTrack:
    """Angle and speed of the rotor from records: cubic Hermite interpolation of (theta, omega)."""

    def __init__(self, records: RecordArray, clock_hz: float) -> None:
        time, first = np.unique(np.asarray(records["t_cycle"], dtype=np.float64), return_index=True)
        if time.size < 2:
            raise ValueError("an angle track needs at least two records")
        self._t = time
        self._theta = np.asarray(records["theta_e"], dtype=np.float64)[first]
        self._slope = np.asarray(records["omega_e"], dtype=np.float64)[first] / clock_hz
        self._clock_hz = clock_hz

    @property
    def first_cycle(self) -> float:
        """Start of the track."""
        return float(self._t[0])

    @property
    def last_cycle(self) -> float:
        """End of the track."""
        return float(self._t[-1])

    def _locate(self, cycles: FloatArray) -> tuple[IntArray, FloatArray, FloatArray]:
        k = np.clip(np.searchsorted(self._t, cycles, side="right") - 1, 0, self._t.size - 2)
        step = self._t[k + 1] - self._t[k]
        return k.astype(np.int64), step, (cycles - self._t[k]) / step

    def theta_rad(self, cycles: FloatArray | IntArray) -> FloatArray:
        """Unwrapped electrical angle at times in cycles; outside the records NaN."""
        at = np.asarray(cycles, dtype=np.float64)
        k, step, u = self._locate(at)
        value: FloatArray = (
            (1 + 2 * u) * (1 - u) ** 2 * self._theta[k]
            + u * (1 - u) ** 2 * step * self._slope[k]
            + u * u * (3 - 2 * u) * self._theta[k + 1]
            + u * u * (u - 1) * step * self._slope[k + 1]
        )
        return np.where((at < self._t[0]) | (at > self._t[-1]), np.nan, value)

    def omega_rad_s(self, cycles: FloatArray | IntArray) -> FloatArray:
        """Electrical speed at times in cycles, linear between records; outside the records the nearest."""
        at = np.asarray(cycles, dtype=np.float64)
        return np.interp(at, self._t, self._slope) * self._clock_hz

    def direction(self, cycles: FloatArray | IntArray) -> FloatArray:
        """+1 or -1: sign of the speed."""
        return np.where(self.omega_rad_s(cycles) < 0, -1.0, 1.0)


def wrap_deg(angle: FloatArray) -> FloatArray:
    """Angle in -180 .. 180 degrees."""
    return (angle + 180.0) % 360.0 - 180.0


def phase_currents(records: RecordArray) -> list[str]:
    """Columns of the phases' currents, of three or five phases."""
    columns = records.dtype.names or ()
    return [name for name in ("ia", "ib", "ic", "id", "ie") if name in columns]


def dq_current(records: RecordArray) -> ComplexArray:
    """Currents of the machine in the rotor's frame, d + jq, amplitude-invariant (A); of five phases subspace 1."""
    names = phase_currents(records)
    phases = sum(records[name] * np.exp(2j * np.pi / len(names) * k) for k, name in enumerate(names))
    return np.asarray(2 / len(names) * phases * np.exp(-1j * records["theta_e"]), dtype=np.complex128)


def thesis_angle_deg(theta_rad: FloatArray) -> FloatArray:
    """Angle theta' of the sector tables, in degrees."""
    return np.degrees(theta_rad) + 180.0


def crossing_error_deg(theta_rad: FloatArray, sector: IntArray, direction: FloatArray) -> FloatArray:
    """Lateness of a crossing of `sector` stamped when the rotor stood at theta; positive = late."""
    ideal = 60.0 + 60.0 * sector + np.where(direction < 0, 180.0, 0.0)
    return direction * wrap_deg(thesis_angle_deg(theta_rad) - ideal)


def commutation_error_deg(
    theta_rad: FloatArray, sector: IntArray, direction: FloatArray, advance_deg: FloatArray
) -> FloatArray:
    """Lateness of a commutation into `sector` at theta against the wanted advance; positive = late."""
    ideal = np.where(direction < 0, 270.0, 30.0) + 60.0 * sector - direction * advance_deg
    return direction * wrap_deg(thesis_angle_deg(theta_rad) - ideal)
