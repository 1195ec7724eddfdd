# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Freewheeling of the open phase against the true crossing of its EMF, six-step, from a chip's log and its plant."""

from __future__ import annotations

import itertools

import numpy as np

from fluxlock.results.angles import FLOATING_PHASE, crossing_error_deg
from fluxlock.results.rundata import FloatArray, IntArray, LogKind, RecordArray

NO_CURRENT_A = 1e-3
CURRENTS = ("ia", "ib", "ic")


class Freewheel:
    """Stretch by stretch of one run; what a stretch begins with is the end of the one before."""

    def __init__(self) -> None:
        self._sector = -1
        self._ended = False  # the current of the phase that this sector opens
        self._ahead = False  # the crossing was still to come at the last record
        self._margin_deg = np.nan

    def follow(self, records: RecordArray, log: IntArray) -> tuple[FloatArray, list[float]]:
        """Margin at each record, deg, and the clocks of the true crossings that freewheeling hid.

        The margin is the angle from the end of freewheeling to the true crossing, below 0 if it ended behind it; it
        stays until the next one.
        """
        rows = log[log[:, 1] == LogKind.COMMUTATION]
        begins = np.searchsorted(records["t_cycle"], rows[:, 0], side="right")
        margin = np.full(records.size, np.nan)
        masked: list[float] = []
        edges = [0, *begins.tolist(), records.size]
        for k, (low, high) in enumerate(itertools.pairwise(edges)):
            if k > 0:
                self._sector, self._ended, self._ahead = int(rows[k - 1, 2]), False, False
            margin[low:high] = self._margin_deg
            if self._sector >= 0 and high > low:
                self._part(records[low:high], margin[low:high], masked)
        return margin, masked

    def _part(self, records: RecordArray, margin: FloatArray, masked: list[float]) -> None:
        """A part with one sector."""
        sector = np.full(records.size, self._sector)
        direction = np.where(records["omega_e"] < 0.0, -1.0, 1.0)
        late = crossing_error_deg(records["theta_e"], sector, direction)
        end = 0 if self._ended else records.size
        if not self._ended:
            gone = np.flatnonzero(np.abs(records[CURRENTS[FLOATING_PHASE[self._sector]]]) <= NO_CURRENT_A)
            if gone.size:
                end = int(gone[0])
                self._ended, self._margin_deg = True, -float(late[end])
                margin[end:] = self._margin_deg
        behind = np.append(self._ahead, late[:-1] < 0.0) & (late >= 0.0) & (late < 90.0)
        masked += [float(records["t_cycle"][at]) for at in np.flatnonzero(behind) if at < end]
        self._ahead = bool(late[-1] < 0.0)
