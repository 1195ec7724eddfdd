# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""How the rows of lost locks name the end of a run."""

from __future__ import annotations

import pytest

from fluxverify.regression.six_step.lost_lock import FULL, endings

RELOCKED, STOPPED = (1, 0), (0, 1)


@pytest.mark.parametrize(
    ("name", "locked", "stopped", "end", "right"),
    [
        *((f"stuck-{channel}", True, False, RELOCKED, 0) for channel in ("vdc-low", "ia", "ib-high", "ic-zero", "idc")),
        *((f"stuck-{channel}", False, True, STOPPED, 1) for channel in ("vdc-low", "ia", "ib-high", "ic-zero", "idc")),
        ("stuck-ia", False, False, (0, 0), 0),
        ("stuck-va", True, False, RELOCKED, 1),
        ("stuck-va-5ms", True, False, RELOCKED, 1),
        ("dip-step", False, True, STOPPED, 1),
        ("dip-trip", True, False, RELOCKED, 0),
        ("dip-trip", False, True, STOPPED, 1),
    ],
)
def test_endings(name: str, locked: bool, stopped: bool, end: tuple[int, int], right: int) -> None:
    """A channel that the protection needs must be named; where the lock may be regained, that is right too.

    Verifies: SYS-12
    """
    values = endings(FULL[name], locked, stopped)
    assert tuple(values.values()) == (*end, right)
