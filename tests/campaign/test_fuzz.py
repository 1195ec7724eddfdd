"""Random register accesses on the running chip: gates stay safe, the bus answers."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fluxlock.campaign import fuzz as fuzzer
from fluxlock.campaign.fuzz import COPIES, DRIVES, FuzzRun, fuzz, fuzz_drives, scenario_of
from fluxlock.config import ConfigError, load_scenario
from fluxlock.paths import REGISTER_BLOCKS

SEED = 1
RIGHT = FuzzRun(7, 100, 3, 200, 0.9, 0, 0.4e-6, True)


@pytest.mark.parametrize("drive", DRIVES)
def test_random_accesses(drive: str) -> None:
    """Words, halves and bytes at random places and times, while six-step or vector control drives the machine.

    Verifies: SAFE-16
    """
    dead_time_s = load_scenario(scenario_of(drive)).inverter.dead_time_s
    runs = fuzz(drive, SEED)
    for run in runs:
        print(f"seed {SEED}: {run}")
    assert sum(run.accesses for run in runs) > 20 * COPIES
    assert sum(run.gate_changes for run in runs) > 50 * COPIES, "the gates were off"
    windows = 0
    for run in runs:
        assert not run.problems(dead_time_s), run
        windows |= run.windows
    assert windows == (1 << len(REGISTER_BLOCKS)) - 1, "a register block was never accessed"
    sparing = [run.driven for run in runs if run.sparing]
    assert len(sparing) == COPIES // 2 and sum(sparing) > 0.7 * len(sparing), "the gates were off for long"


def test_problems() -> None:
    """Both gates of a leg, a short dead time and a core that stands still are found, each by name.

    Verifies: SAFE-16
    """
    assert RIGHT.sparing and not replace(RIGHT, seed=6).sparing
    assert RIGHT.problems(0.4e-6) == replace(RIGHT, least_dead_time_s=None).problems(0.4e-6) == []
    wrong = replace(RIGHT, shoot_throughs=1, least_dead_time_s=0.38e-6, alive=False)
    assert wrong.problems(0.4e-6) == ["both gates of a leg on", "dead time 380 ns", "the core stands still"]


def test_driven() -> None:
    """Time with a gate on, from the change before the span to its end.

    Verifies: SAFE-16
    """
    rows = np.array([[10, 1, 1, 0], [110, 1, 0, 0], [150, 1, 2, 0]])
    assert fuzzer._driven(rows, 100, 100) == pytest.approx(0.6)
    assert fuzzer._driven(rows[:1], 100, 100) == 1.0
    assert fuzzer._driven(rows[:2], 120, 100) == 0.0


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
    assert asked[:2] == [("six-step", 5, 2, 0.001, 3)] * 2 and asked[2][0] == "vector"
    told = capsys.readouterr()
    assert told.out.splitlines()[0] == "six-step, seed 5: 2 runs, 200 accesses, a gate on for 70% of the time"
    assert told.err == "wrong: vector, seed 5, run 8: the core stands still\n"
    with pytest.raises(ConfigError, match="drives: six-step, vector"):
        fuzz_drives(["boot"], 5, 2, 0.001, 3)
    assert all(Path(scenario_of(drive)).exists() for drive in DRIVES)
