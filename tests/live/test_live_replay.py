# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A finished run on the page."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fluxlock import simulate
from fluxlock.config import ConfigError
from fluxlock.live import messages
from fluxlock.live.replay import Replay
from fluxlock.live.source import RefusedError
from fluxlock.live.traces import NAMES

SPINDLE = "scenarios/own-spindle.toml"


def test_recording(tmp_path: Path) -> None:
    """A finished run is shown again row by row, with the drive's own account beside it; it takes no action.

    Verifies: LIVE-10
    """
    run = simulate(SPINDLE, twin=True, folder=tmp_path, plots=False, duration_s=0.3, window=[], expect=[])
    replay, found = Replay(tmp_path), []
    while replay.now < run.traces["t_s"][-1]:
        replay.advance(0.0031)
        found.append(replay.take())
    time_s = np.concatenate([part for part, _ in found])
    rows = np.concatenate([part for _, part in found], axis=1)
    assert np.array_equal(time_s, run.traces["t_s"])
    assert np.array_equal(rows[NAMES.index("ia")], run.traces["ia"].astype(np.float32))
    states = run.data.states()
    assert np.array_equal(rows[NAMES.index("measured_rpm")][: states.size], states["speed_rpm"].astype(np.float32))
    assert replay.status()["state"] == "running"
    with pytest.raises(RefusedError, match="recording"):
        replay.act(messages.Drive(kind="drive", do="start"))
    with pytest.raises(RefusedError, match="recording"):
        replay.export("my-play")


def test_no_recording(tmp_path: Path) -> None:
    """A folder without a run, or with a broken one, is refused by its name.

    Verifies: LIVE-09, LIVE-10
    """
    with pytest.raises(ConfigError, match="name the folder of a finished run"):
        Replay(tmp_path)
    (tmp_path / "result.json").write_text("{}", encoding="utf-8")
    (tmp_path / "trace.npz").write_bytes(b"none")
    with pytest.raises(ConfigError, match="is no result of a run"):
        Replay(tmp_path)
