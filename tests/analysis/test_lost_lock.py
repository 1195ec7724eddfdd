"""How the rows of lost locks name the end of a run."""

from __future__ import annotations

import pytest

from fluxlock.regression.six_step.lost_lock import FULL, endings

UNNOTICED, RELOCKED, STOPPED = (1, 0, 0), (0, 1, 0), (0, 0, 1)


@pytest.mark.parametrize(
    ("name", "locked", "stopped", "noticed", "end", "right"),
    [
        *((f"stuck-{channel}", True, False, False, UNNOTICED, 1) for channel in ("vdc-low", "ia", "ic-zero", "idc")),
        ("stuck-ia", True, False, True, RELOCKED, 1),
        ("stuck-ia", False, False, True, (0, 0, 0), 0),
        ("stuck-va-5ms", True, False, True, RELOCKED, 1),
        ("dip-step", False, True, True, STOPPED, 1),
        ("dip-trip", True, False, True, RELOCKED, 0),
        ("dip-trip", False, True, True, STOPPED, 1),
    ],
)
def test_endings(name: str, locked: bool, stopped: bool, noticed: bool, end: tuple[int, int, int], right: int) -> None:
    """A drive that runs on without having noticed has not locked again; what is right stays as it was.

    Verifies: SYS-12
    """
    values = endings(FULL[name], locked, stopped, noticed)
    assert tuple(values.values()) == (*end, right)
