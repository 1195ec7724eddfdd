"""A sample of the fault campaign on the chip."""

from __future__ import annotations

from fluxlock.campaign.grid import DRIVES
from fluxlock.campaign.judge import WRONG
from fluxlock.campaign.run import grid, run_drive

SEED = 1


def test_sample() -> None:
    """Six-step operation: every run of the quick grid ends right.

    Verifies: CAMP-01
    """
    print(f"seed {SEED}")
    rows = run_drive(DRIVES[0], SEED, quick=True, jobs=1)
    assert len(rows) > 15
    for row in rows:
        print(row)
    assert not [(row["disturbance"], row["reasons"]) for row in rows if row["outcome"] == WRONG]


def test_the_seed_decides() -> None:
    """Runs follow from the seed; another one gives other upsets.

    Verifies: CAMP-03
    """
    for drive in DRIVES:
        assert grid(drive, 5, quick=False) == grid(drive, 5, quick=False)
        assert grid(drive, 5, quick=False) != grid(drive, 6, quick=False)
        names = [run.folder for run in grid(drive, 5, quick=False)]
        assert len(set(names)) == len(names)
