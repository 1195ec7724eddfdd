"""A sample of the fault campaign on the chip."""

from __future__ import annotations

import fcntl
import random
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from fluxlock.campaign import run
from fluxlock.campaign.grid import DRIVES, PLANT_FAULTS, actions_of, upsets
from fluxlock.campaign.judge import STOPPED, WRONG
from fluxlock.campaign.run import grid, run_drive
from fluxlock.config import ConfigError

SEED = 1


def test_sample() -> None:
    """Six-step operation: every run of the quick grid ends right.

    Verifies: CAMP-01
    """
    print(f"seed {SEED}")
    rows = run_drive(DRIVES[0], SEED, quick=True, jobs=1)
    assert len(rows) > 10
    for row in rows:
        print(row)
    assert not [(row["disturbance"], row["reasons"]) for row in rows if row["outcome"] == WRONG]


def test_upsets_before_boot() -> None:
    """A bit of the parameter block that has flipped: boot names it and starts nothing.

    Verifies: CAMP-04
    """
    print(f"seed {SEED}")
    (drive,) = (d for d in DRIVES if d.moments[0].boot)
    rows = run_drive(drive, SEED, quick=True, jobs=1)
    assert rows
    for row in rows:
        print(row)
        assert row["outcome"] == STOPPED
        assert row["fault"].startswith("parameter_")


def test_the_grid_is_large_enough() -> None:
    """500 runs or more, every fault in six-step operation and with vector control.

    Verifies: CAMP-05
    """
    runs = {drive.name: grid(drive, SEED, quick=False) for drive in DRIVES}
    assert sum(map(len, runs.values())) >= 500
    for name in ("six-step", "vector"):
        assert {fault.name for fault in PLANT_FAULTS} <= {run.fault.name for run in runs[name]}


def test_a_register_by_name() -> None:
    """An upset that names its register becomes the share by which the simulator finds it.

    Verifies: CAMP-05
    """
    (fault,) = upsets(random.Random(SEED), 0, 0, 1)
    name = str(fault.changes[0][2]["name"])
    registers = [f"fl_soc__DOT__{x}" for x in ("a_q", "b_q", name, "c_q", "d_q", "e_q", "f_q")]
    (action,) = actions_of(fault, 7, registers)
    assert (action.cycle, action.kind) == (7, "register")
    assert registers[int(action.arguments["share"] * len(registers))].endswith(name)
    assert 0 <= action.arguments["bit_share"] < 1


def test_the_seed_decides() -> None:
    """Runs follow from the seed; another one gives other upsets.

    Verifies: CAMP-03
    """
    for drive in DRIVES:
        assert grid(drive, 5, quick=False) == grid(drive, 5, quick=False)
        assert grid(drive, 5, quick=False) != grid(drive, 6, quick=False)
        names = [one.folder for one in grid(drive, 5, quick=False)]
        assert len(set(names)) == len(names)


def test_runs_repeat(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same runs end the same, in another folder and without what has been kept of the first: faults and an upset.

    Verifies: CAMP-03
    """
    print(f"seed {SEED}")
    drive = replace(DRIVES[0], moments=DRIVES[0].moments[:1])
    short = ("vdc stuck at 0", "upper switch A stuck", "register upset 0")
    monkeypatch.setattr(run, "grid", lambda *asked: [one for one in grid(*asked) if one.fault.name in short])
    rows = []
    for folder in (tmp_path / "first", tmp_path / "second"):
        monkeypatch.setattr(run, "FOLDER", folder)
        rows.append(run_drive(drive, SEED, quick=False, jobs=1))
    print(rows[0])
    assert rows[0] == rows[1]
    assert [row["disturbance"] for row in rows[0]] == list(short) and rows[0][-1]["upsets"]


def test_one_at_a_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A second campaign of a drive is refused: it would clear the folders in which the first one's runs write.

    Verifies: CAMP-01
    """
    monkeypatch.setattr(run, "FOLDER", tmp_path)
    (tmp_path / "boot").mkdir()
    with (tmp_path / "boot" / ".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        with pytest.raises(ConfigError, match="another campaign is using it"):
            run.run_drive(DRIVES[-1], SEED, quick=True, jobs=1)


def test_progress_of_what_is_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A campaign whose runs have all ended before shows all of them as ended, without a chip.

    Verifies: CAMP-01
    """

    class Kept:
        def find(self, one: run.Run) -> dict[str, Any]:
            return {"fault": one.fault.name}

    monkeypatch.setattr(run, "FOLDER", tmp_path)
    monkeypatch.setattr(run, "open_book", lambda *_: Kept())
    seen: list[tuple[int, int]] = []
    rows = run.run_drive(DRIVES[-1], SEED, quick=True, jobs=1, done=lambda ended, count: seen.append((ended, count)))
    assert seen == [(len(rows), len(rows))] and rows
