# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Numbers of five shipped runs in the pages come from their results."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from fluxverify.docs import measured

TEXT = measured.PAGE.read_text(encoding="utf-8")


def result(speed_rpm: float) -> dict[str, Any]:
    """A result with numbers of its own in each window."""
    deg = {"mean": 0.001, "rms": 0.02, "max": 0.3}
    window = {
        "speed_rpm": {"min": speed_rpm - 1, "max": speed_rpm + 1, "mean": speed_rpm - 0.06},
        "zcp_error_deg": deg,
        "commutation_error_deg": deg,
        "freewheel_deg": deg,
        "phase_current_pp_a": 12.34,
        "late_crossings": 0,
    }
    return {
        "verdict": {"passed": True, "lines": []},
        "metrics": {name: window for name in ("steady", "loaded", "slow")},
        "scenario": {"settings": {"event": [{"speed_rpm": None}, {"speed_rpm": speed_rpm}]}},
        "run": {"isr": {"control": {"min": 1000.0, "mean": 2000.0, "max": 3000.0}}},
    }


def test_page_takes_the_results() -> None:
    """Every row gets its numbers, conditions and commands stay, and a page with its numbers is left as it is."""
    written = measured.page(TEXT, {name: result(12_345.0) for name in measured.RUNS})
    assert "| speed, min … max (r/min) | 12344 … 12346 | 12344 … 12346 | 12344 … 12346 |" in written
    assert written.count("| 12 345 / 12 344.9 | 0.020 |") == 3
    assert "1000 / 2000 / 3000 | `make demo` |" in written
    assert measured.page(written, {name: result(12_345.0) for name in measured.RUNS}) == written
    differing = [line for line in written.splitlines() if line not in TEXT.splitlines()]
    assert len(differing) <= len(measured.ROWS) + 4


def test_row_that_is_gone_is_told() -> None:
    """A row that the page has no longer, or twice, is an error and no silence."""
    results = {name: result(12_345.0) for name in measured.RUNS}
    with pytest.raises(ValueError, match="0 rows of `late crossings`"):
        measured.page(TEXT.replace("late crossings", "later"), results)


def test_run_is_missing_or_has_failed(tmp_path: Path) -> None:
    """What is missing is named with its command; a run that has failed gives no numbers."""
    with pytest.raises(ValueError, match=r"fluxlock run scenarios/slow-down\.toml"):
        measured.read(tmp_path / "slow-down")
    failed = result(1.0) | {"verdict": {"passed": False, "lines": ["the angle was lost"]}}
    (tmp_path / "result.json").write_text(json.dumps(failed), encoding="utf-8")
    with pytest.raises(ValueError, match="the angle was lost"):
        measured.read(tmp_path)
