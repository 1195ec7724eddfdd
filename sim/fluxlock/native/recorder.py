# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What a native drive did of late, as run data: the same verdict as over a run of the chip.

A row per step (1 ms) of angle and speed of the averaged motor and of the firmware's telemetry; no gates, no currents.
"""

from __future__ import annotations

from collections import deque

import numpy as np

from fluxlock.headers import CData
from fluxlock.native.averaged_motor import OMEGA, THETA
from fluxlock.native.drive import NativeDrive
from fluxlock.results.rundata import PLANT_EVENT_DTYPE, RECORD_DTYPE, LogKind, Rejection, RunData

# A program that runs for days is judged by its last time, s, and by the lock it lost ever.
KEPT_S = 20.0
STEP_S = 1e-3


class Recorder:
    """Takes a row per `note`; the newest `KEPT_S` are kept."""

    def __init__(self, drive: NativeDrive) -> None:
        self._drive = drive
        self._rows: deque[tuple[float, float, float, CData]] = deque(maxlen=round(KEPT_S / STEP_S))
        self._noted_us = -1
        self.rejected: list[Rejection] = []

    def note(self) -> None:
        """The drive as it is now, once per step."""
        if self._drive.now_us == self._noted_us:
            return
        self._noted_us = self._drive.now_us
        chip = self._drive.chip
        self._rows.append((chip.now, float(chip.model.s[THETA]), float(chip.model.s[OMEGA]), chip.fw.telemetry()))

    def answered(self, line: str, replies: list[str]) -> None:
        """A line and its reply; one that ends in an error, or in nothing, is rejected."""
        end = replies[-1] if replies else "no reply"
        if line and end != "ok":
            self.rejected.append(Rejection(self._drive.chip.now, line, end.removeprefix("error: ")))

    def data(self) -> RunData:
        """The rows as run data; time 0 is that of the drive."""
        clock = self._drive.chip.clock
        pairs = self._drive.chip.scenario.motor.pole_pairs
        time = np.array([row[0] for row in self._rows])
        records = np.zeros(time.size, RECORD_DTYPE)
        records["t_cycle"] = time * clock
        records["theta_e"] = [row[1] for row in self._rows]
        records["omega_e"] = [row[2] * pairs for row in self._rows]
        log = np.zeros((time.size, 4), np.int64)
        log[:, 0], log[:, 1] = np.round(time * clock), int(LogKind.UPDATE)
        for k, (*_, t) in enumerate(self._rows):
            drive = t.state & 0xFF | (t.limit & 0xF) << 16 | (t.lost_locks & 0xFFF) << 20
            log[k, 2] = t.speed_rpm_q8 << 32 | drive
            log[k, 3] = t.target_rpm << 32 | t.reference_rpm_q8 & 0xFFFFFFFF
        return RunData(
            log=log,
            records=records,
            plant_events=np.zeros(0, PLANT_EVENT_DTYPE),
            zoom=np.zeros(0, RECORD_DTYPE),
            clock_hz=clock,
            pole_pairs=pairs,
            cycles=round(self._drive.chip.now * clock),
            wall_s=0.0,
            seed=0,
            uart=self._drive.chip.fw.command("status"),
            rejected=self.rejected,
        )
