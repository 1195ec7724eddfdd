"""The page of the regression against the registered cases."""

from __future__ import annotations

import re

import fluxlock.regression.sets  # noqa: F401  (registers the cases)
from fluxlock.docs.regression import PAGE
from fluxlock.regression.case import CASES


def test_table_holds_every_case() -> None:
    """Rows of each case that `fluxlock regression --list` names, and of no other.

    Verifies: DOC-05
    """
    rows = re.findall(r"^\| ([^ |]+/[^ |]+) \|", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    found = {max((case for case in CASES if f"{row}/".startswith(f"{case}/")), key=len, default=row) for row in rows}
    assert (sorted(set(CASES) - found), sorted(found - set(CASES))) == ([], []), "(missing, unknown)"
