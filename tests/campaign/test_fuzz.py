# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Random register accesses on the running chip: gates stay safe, the bus answers."""

from __future__ import annotations

from dataclasses import replace
from functools import reduce
from operator import or_

import numpy as np
import pytest

from fluxlock.base.paths import REGISTER_BLOCKS
from fluxlock.config import ConfigError
from fluxverify.campaign import fuzz as fuzzer
from fluxverify.campaign.fuzz import COPIES, DRIVES, FuzzRun, fuzz, fuzz_drives
from fluxverify.campaign.judge import CURRENT_S

SEED = 1
DEAD_TIME_S = 2e-6  # the longest of the drives
RIGHT = FuzzRun(7, 100, 3, 200, 4, 0.9, 0, DEAD_TIME_S, 50e-6)


@pytest.mark.parametrize("drive", DRIVES)
def test_random_accesses(drive: str) -> None:
    """Words, halves and bytes at random places and times, while the gates go on again and again.

    Verifies: SAFE-16
    """
    dead_time_s = DRIVES[drive].load().inverter.dead_time_s
    runs = fuzz(drive, SEED)
    for run in runs:
        print(f"seed {SEED}: {run}")
    for run in runs:
        assert not run.problems(dead_time_s), run
    assert sum(run.accesses for run in runs) > 300 * COPIES
    assert sum(run.gate_changes for run in runs) > 200 * COPIES
    assert sum(run.rearms for run in runs) > 2 * COPIES, "what turns the gates off was seldom found, or for good"
    assert sum(run.driven for run in runs) > 0.4 * COPIES, "the gates were off for long"
    windows = reduce(or_, (run.windows for run in runs))
    assert windows == (1 << len(REGISTER_BLOCKS)) - 1, "a register block was never accessed"


def test_problems() -> None:
    """Both gates of a leg, a short dead time, a lasting over-current, a core that stands still: each by name.

    Verifies: SAFE-16
    """
    assert RIGHT.problems(DEAD_TIME_S) == replace(RIGHT, least_dead_time_s=None).problems(DEAD_TIME_S) == []
    wrong = replace(RIGHT, shoot_throughs=1, least_dead_time_s=1.98e-6, over_current_s=1.2 * CURRENT_S, alive=False)
    over = "current above the limit for 120 us"
    assert wrong.problems(DEAD_TIME_S) == ["both gates of a leg on", "dead time 1980 ns", over, "the core stands still"]
    assert FuzzRun(7, broke_off="assertion").problems(DEAD_TIME_S) == ["simulation broke off: assertion"]


def test_gated() -> None:
    """Time with a gate on, from the change before the span to its end; gates on again after more than a pulse's pause.

    Verifies: SAFE-16
    """
    rows = np.array([[10, 1, 1, 0], [110, 1, 0, 0], [150, 1, 2, 0]])
    assert fuzzer._gated(rows, 100, 100) == (pytest.approx(0.6), 0)
    assert fuzzer._gated(rows[:1], 100, 100) == (1.0, 0)
    assert fuzzer._gated(rows[:2], 120, 100) == (0.0, 0)
    rows = np.array([[0, 1, 1, 0], [2000, 1, 0, 0], [6000, 1, 1, 0], [7000, 1, 0, 0], [9000, 1, 2, 0]])
    assert fuzzer._gated(rows, 1000, 9000) == (pytest.approx(3 / 9), 1)
    assert fuzzer._gated(rows, 1000, 4000) == (0.25, 0)


def test_alive() -> None:
    """An access within the patience everywhere; one that is never answered shows up.

    Verifies: SAFE-16
    """
    patience = fuzzer.PATIENCE_LOOKS
    assert fuzzer._alive([3]) and fuzzer._alive([0, 0, 1]) and fuzzer._alive([1] * patience + [2])
    assert not fuzzer._alive([0]) and not fuzzer._alive([1] * (patience + 1) + [2])
    assert not fuzzer._alive([9, *[10] * (patience + 1)])


def test_command(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """The command runs the drives asked for with the seed, and tells which run was wrong.

    Verifies: SAFE-16
    """
    asked = []

    def made(*values: object) -> list[FuzzRun]:
        asked.append(values)
        return [RIGHT, replace(RIGHT, seed=8, alive=values[0] == "six-step", driven=0.5)]

    monkeypatch.setattr(fuzzer, "fuzz", made)
    assert fuzz_drives(["six-step"], 5, 2, 0.001, 3)
    assert not fuzz_drives([], 5, 2, 0.001, 3)
    assert asked == [(name, 5, 2, 0.001, 3) for name in ("six-step", *DRIVES)]
    told = capsys.readouterr()
    gated = "a gate on for 70% of the time, on again 8 times"
    assert told.out.splitlines()[0] == f"six-step, seed 5: 2 runs, 200 accesses, {gated}"
    wrong = [f"wrong: {name}, seed 5, run 8: the core stands still" for name in ("vector", "five-phase")]
    assert told.err.splitlines() == wrong
    with pytest.raises(ConfigError, match="drives: six-step, vector, five-phase"):
        fuzz_drives(["boot"], 5, 2, 0.001, 3)
