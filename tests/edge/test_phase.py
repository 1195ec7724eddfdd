# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""`fluxlock edge phase`: the picture of a run, and what it refuses."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from fluxlock.cli import app
from fluxlock.config import ConfigError
from fluxlock.results.rundata import LogKind, save_trace
from tests.results.synthetic import Drive, make_run


def run_in(folder: Path) -> Path:
    """A run whose carrier goes on at commutations: pulses of 1250 clocks in place of those of the log."""
    data = make_run(Drive(duration_s=0.05))
    log = data.log[data.log[:, 1] != int(LogKind.GATES)]
    gates = [[c, int(LogKind.GATES), g, 0] for k in range(2000) for c, g in ((1250 * k, 9), (1250 * k + 600, 8))]
    data.log = np.concatenate([log, np.array(gates, dtype=np.int64)])
    data.log = data.log[np.argsort(data.log[:, 0], kind="stable")]
    save_trace(folder / "trace.npz", data)
    return folder


def test_picture(tmp_path: Path) -> None:
    """The command writes the picture and says the largest difference.

    Verifies: FRONT-93
    """
    result = CliRunner().invoke(app, ["edge", "phase", str(run_in(tmp_path))])
    assert result.exit_code == 0, result.output
    assert (tmp_path / "pwm-phase.png").stat().st_size > 5000 and "largest less smallest mean:" in result.stdout


def test_refused(tmp_path: Path) -> None:
    """A folder without a trace, a broken one, a span outside of the run: one line each.

    Verifies: FRONT-93, FRONT-02
    """
    runner = CliRunner()
    with pytest.raises(ConfigError, match="has no trace"):
        runner.invoke(app, ["edge", "phase", str(tmp_path)], catch_exceptions=False)
    (tmp_path / "trace.npz").write_bytes(b"none")
    with pytest.raises(ConfigError, match="is no trace of a run"):
        runner.invoke(app, ["edge", "phase", str(tmp_path)], catch_exceptions=False)
    run_in(tmp_path)
    with pytest.raises(ConfigError, match="is no span of the run"):
        runner.invoke(app, ["edge", "phase", str(tmp_path), "--to-s", "1"], catch_exceptions=False)
