# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The drive's angle on a chip, from its log, against the true one."""

from __future__ import annotations

import numpy as np

from fluxlock.clock import CLOCK_HZ
from fluxlock.results.angles import wrap_deg
from fluxlock.results.rundata import FloatArray, IntArray, LogKind, RecordArray

FIELD_DEG = 330.0  # of sector 0, which drives: 60 degrees a sector
REST_CARRIERS = 2.0  # without a switch on, after which nothing drives


class Estimate:
    """Stretch by stretch of one run; what a stretch begins with is the end of the one before.

    method: `six-step` or `vector`. carrier_hz: of the drive.
    """

    def __init__(self, method: str, carrier_hz: float) -> None:
        self._six_step = method == "six-step"
        self._rest_cycles = REST_CARRIERS * CLOCK_HZ / carrier_hz
        self._newest_deg = np.nan  # six-step: of the field; vector: of the error
        self._driven = -np.inf  # last clock with a switch on

    def error_deg(self, records: RecordArray, log: IntArray) -> FloatArray:
        """The drive's angle from the true one at each record, deg, positive ahead; nan while it has none.

        Six-step: the field from its best place, 90 degrees before the rotor; within 30 degrees it is right. Vector: of
        the last current sample.
        """
        cycle, theta = records["t_cycle"], records["theta_e"]
        if not self._six_step:
            rows = log[log[:, 1] == LogKind.ANGLE]
            there = np.degrees(np.interp(rows[:, 0], cycle, theta))
            errors = np.append(self._newest_deg, wrap_deg((rows[:, 2] + rows[:, 3]) * (360.0 / 2**32) - there))
            self._newest_deg = errors[-1]
            return np.asarray(errors[np.searchsorted(rows[:, 0], cycle, side="right")])
        rows = log[log[:, 1] == LogKind.COMMUTATION]
        fields = np.append(self._newest_deg, FIELD_DEG + 60.0 * rows[:, 2])
        field = fields[np.searchsorted(rows[:, 0], cycle, side="right")]
        best = np.degrees(theta) + np.where(records["omega_e"] < 0.0, -90.0, 90.0)
        on = np.maximum.accumulate(np.append(self._driven, np.where(records["gates"] != 0, cycle, -np.inf)))[1:]
        self._newest_deg, self._driven = fields[-1], on[-1]
        return np.where(cycle - on > self._rest_cycles, np.nan, wrap_deg(field - best))
