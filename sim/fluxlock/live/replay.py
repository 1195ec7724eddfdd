# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A finished run as a source: its trace again, at any pace; nothing in it can be changed."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from fluxlock.config import ConfigError, Problem
from fluxlock.firmware.binding import names
from fluxlock.live import messages
from fluxlock.live.source import SLICE_S, RefusedError
from fluxlock.live.traces import CHIP_ONLY, NAMES, TOLD, Floats, Marks, columns, marks_of
from fluxlock.native.play import Taken
from fluxlock.results.rundata import RunData, load_trace

NOTHING = "this is a recording: nothing in it can be changed; `fluxlock live SCENARIO` has a drive"


def read_run(folder: Path) -> tuple[RunData, dict[str, Any]]:
    """Trace and result of a run's folder; ConfigError if it is none."""
    for name in ("trace.npz", "result.json"):
        if not (folder / name).is_file():
            text = "file not found; name the folder of a finished run, such as build/demo, or a scenario file"
            raise ConfigError([Problem(str(folder / name), "", text)])
    try:
        result = json.loads((folder / "result.json").read_text(encoding="utf-8"))
        return load_trace(folder / "trace.npz"), dict(result)
    except (ValueError, KeyError, OSError) as error:
        raise ConfigError([Problem(str(folder), "", f"is no result of a run: {error}")]) from None


class Replay:
    """The records of a run in the order of their time."""

    def __init__(self, folder: Path) -> None:
        self._data, result = read_run(folder)
        self._name = str(result.get("scenario", {}).get("name", folder.name))
        self.said: list[dict[str, Any]] = []
        self._states = self._data.states()
        self._times = self._data.records["t_cycle"] / self._data.clock_hz
        self._now, self._taken, self._told = 0.0, 0, 0
        self._last: Floats = np.zeros(len(TOLD))
        self._marks: Marks = []

    @property
    def now(self) -> float:
        """Its time, s."""
        return self._now

    def hello(self) -> dict[str, Any]:
        """What a page draws itself from: no knobs."""
        return {
            "name": self._name,
            "source": "recording",
            "settings": [],
            "faults": [],
            "without": ["angle_error_deg", "estimate_deg", "motor_a", *CHIP_ONLY],
        }

    def advance(self, seconds: float, until: str = "end") -> bool:
        """So much of the recording at most; at its end nothing."""
        self._now = min(self._now + min(seconds, SLICE_S), float(self._times[-1]))
        return False

    def act(self, action: messages.Action) -> None:
        """RefusedError."""
        raise RefusedError(NOTHING)

    def export(self, name: str) -> dict[str, str]:
        """RefusedError."""
        raise RefusedError(NOTHING)

    def take(self) -> tuple[Floats, Floats]:
        """Times and traces since the last call."""
        end = int(np.searchsorted(self._times, self.now, side="right"))
        records, self._taken = self._data.records[self._taken : end], end
        if records.size == 0:
            return np.zeros(0), np.zeros((len(NAMES), 0), np.float32)
        low = self._told
        self._told = high = int(np.searchsorted(self._data.log[:, 0], records["t_cycle"][-1], side="right"))
        more = {"angle_error_deg": np.full(records.size, np.nan)}  # a record has no angle of the drive
        log, clock_hz = self._data.log[low:high], self._data.clock_hz
        self._marks += marks_of(log, clock_hz, int(self._last[TOLD.index("state")]))
        return columns(Taken(records, log, more, 0), clock_hz, self._data.pole_pairs, self._last)

    def marks(self) -> Marks:
        """Instants since the last call."""
        found, self._marks = self._marks, []
        return found

    def status(self) -> dict[str, Any]:
        """The drive by its own account at this time."""
        at = int(np.searchsorted(self._states["t_s"], self.now, side="right")) - 1
        told = self._states[max(at, 0)] if self._states.size else None
        return {
            "t_s": self.now,
            "state": names("drive_state_t")[int(told["state"])] if told is not None else "init",
            "phase": "none",
            "fault": "none",
            "limit": names("limit_t")[int(told["limit"])] if told is not None else "none",
            "lost_locks": int(told["lost_locks"]) if told is not None else 0,
            "target_rpm": float(told["target_rpm"]) if told is not None else 0.0,
            "speed_rpm": float(told["speed_rpm"]) if told is not None else 0.0,
            "load_factor": 1.0,
            "supply_v": 0.0,
            "values": {},
        }
