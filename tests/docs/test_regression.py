# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The page of the regression against the registered cases, and from which runs its rows are."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import fluxverify.regression.sets  # noqa: F401  (registers the cases)
from fluxverify.docs.parameter_map import parameter_map
from fluxverify.docs.regression import PAGE, page
from fluxverify.regression import origin, run
from fluxverify.regression.case import CASES
from fluxverify.regression.record import read_record


def test_table_holds_every_case() -> None:
    """Rows of each case that `fluxverify regression --list` names, and of no other.

    Verifies: DOC-05
    """
    rows = re.findall(r"^\| ([^ |]+/[^ |]+) \|", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    found = {max((case for case in CASES if f"{row}/".startswith(f"{case}/")), key=len, default=row) for row in rows}
    assert (sorted(set(CASES) - found), sorted(found - set(CASES))) == ([], []), "(missing, unknown)"


def test_order_does_not_depend_on_imports() -> None:
    """The cases, and so the sections of the page, have one order, whichever set was imported before.

    Verifies: DOC-05
    """
    script = "import fluxverify.regression.vector, fluxverify.regression.sets as s; print(*s.CASES)"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.split() == list(CASES)


def row(name: str, revision: str | None = "aaa", seed: int = 1) -> dict[str, Any]:
    """A row as it is stored; without a revision as older files have it."""
    made = {} if revision is None else {"git_revision": revision, "seed": seed, "sources": {"chip": "0123456789ab"}}
    return {"id": name, "conditions": {}, "values": {"x": 1}, "limit": {}, "pass": True, "note": "", **made}


def document(*rows: dict[str, Any]) -> dict[str, Any]:
    return {"schema": run.SCHEMA_VERSION, "quick": False, "seed": 2, "git_revision": "bbb", "rows": list(rows)}


def test_rows_keep_their_revision(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Rows of an earlier run stay with its revision and seed; of no case any more, or of unknown origin: dropped aloud.

    Verifies: SYS-12
    """
    path = tmp_path / "regression.json"
    stored = [
        row("six-step/hall/before"),
        row("six-step/hall/after"),
        row("six-step/patterns"),
        row("six-step/gone/1"),
        row("six-step/lost-lock/1", None),
    ]
    path.write_text(json.dumps(document(*stored)), encoding="utf-8")
    merged = run.merge(document(row("six-step/hall/before", "bbb", 2)), ["six-step/hall"], path)
    assert [(r["id"], r["git_revision"], r["seed"]) for r in merged["rows"]] == [
        ("six-step/hall/before", "bbb", 2),
        ("six-step/patterns", "aaa", 1),
    ]
    assert capsys.readouterr().out.splitlines() == [
        f"dropped from {path}: six-step/gone/1: no case of this name any more",
        f"dropped from {path}: six-step/lost-lock/1: its revision and seed were not recorded",
    ]


def test_rows_are_made_with_their_revision(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every row of a run carries seed and revision; the revision is that of its beginning.

    Verifies: SYS-12
    """
    revisions = iter(("at the beginning", "at the end"))
    monkeypatch.setattr(origin, "git_revision", lambda: next(revisions))

    def side_by_side(work: Any, names: Any, jobs: int, done: Any) -> None:
        for name in names:
            done(name, [row(name)])

    monkeypatch.setattr(run, "side_by_side", side_by_side)
    monkeypatch.setattr(run, "prepare_runs", lambda quick: None)
    made = run.run_cases(["six-step/hall", "six-step/patterns"], seed=7)
    assert [(r["id"], r["git_revision"], r["seed"]) for r in made["rows"]] == [
        ("six-step/hall", "at the beginning", 7),
        ("six-step/patterns", "at the beginning", 7),
    ]
    assert made["git_revision"] == "at the beginning"


def test_page_names_the_revisions() -> None:
    """Once in the head where all rows agree; else at each case, and at its rows where these differ.

    Verifies: DOC-05
    """
    one = page(document(row("six-step/hall/before"), row("six-step/patterns")), {})
    assert (
        one.count("Revision") == 1
        and "\nRevision aaa, seed 1, chip `0123456789ab`, full length.\n\n## six-step/hall\n" in one
    )
    two = page(
        document(row("six-step/hall/before"), row("six-step/hall/after"), row("six-step/patterns", "bbb", 2)), {}
    )
    assert "\nFull length; revision and seed stand at each case.\n" in two and two.count("Revision") == 2
    assert "## six-step/hall\n\nRevision aaa, seed 1, chip `0123456789ab`.\n\n|" in two
    assert "## six-step/patterns\n\nRevision bbb, seed 2, chip `0123456789ab`.\n\n|" in two
    mixed = page(document(row("six-step/hall/before"), row("six-step/hall/after", None)), {})
    assert (
        "\nRevision aaa, seed 1, chip `0123456789ab`: six-step/hall/before.\n\n"
        "Revision unknown, seed unknown, sources not recorded: six-step/hall/after.\n" in mixed
    )


def test_page_shows_bands() -> None:
    """Beside a limit stands the band of the record; not beside an exact limit, and it says so where there is none.

    Verifies: DOC-05, REC-01
    """
    limits = {"x": {"min": None, "max": 3.0}, "y": {"min": None, "max": 3.0}, "z": {"min": 0, "max": 0}}
    shown = row("six-step/patterns") | {"values": {"x": 1.0, "y": 1.0, "z": 0, "w": 2}, "limit": limits}
    record = {"six-step/patterns": {"values": {"x": {"value": 1, "scatter": None, "band": [0.666667, 1.5]}}}}
    line = next(line for line in page(document(shown), record).splitlines() if line.startswith("| six-step/patterns"))
    assert line.split(" | ")[2] == "**x 1** (≤ 3; 0.667 … 1.5), **y 1** (≤ 3; not recorded), **z 0** (0), w 2"


def test_page_keeps_what_was_not_run() -> None:
    """Rows of cases without a result stay with their origin and note, those of a case that ran are its new ones.

    Verifies: DOC-05
    """
    noted = row("six-step/hall/before") | {"note": "a note"}
    before = page(document(noted, row("six-step/hall/after", "bbb", 2), row("six-step/patterns/ON-PWM")), {})
    assert page(document(), {}, before) == before
    after = page(document(row("six-step/patterns/PWM-ON", "ccc", 3)), {}, before)
    assert after.partition("## six-step/patterns")[0] == before.partition("## six-step/patterns")[0]
    patterns = after.partition("## six-step/patterns\n")[2]
    assert patterns.startswith("\nRevision ccc, seed 3, chip `0123456789ab`.\n")
    assert "six-step/patterns/PWM-ON" in patterns and "ON-PWM |" not in patterns
    alone = page(document(row("six-step/patterns/PWM-ON", "ccc", 3)), {})
    assert page(document(), {}, alone) == alone, "an origin that all rows share stands in the head"
    short = page(document(noted) | {"quick": True}, {})
    assert "six-step/hall" not in page(document(row("six-step/patterns/ON-PWM")), {}, short)


def test_page_is_that_of_the_record() -> None:
    """The committed page shows the bands of the committed record.

    Verifies: DOC-05, REC-01
    """
    text = PAGE.read_text(encoding="utf-8")
    assert page(document(), read_record(), text) == text, "run python -m fluxverify.docs.regression"


def test_parameter_map_has_a_line_a_change() -> None:
    """Error and closed form over the speeds in their order; the summary of the case and single points are left out.

    Verifies: DOC-05
    """
    values = {"angle_error_deg.max": 9.0, "speed_rpm.end": 1.0}
    for speed, error, closed in ((90000, 3.0, 2.5), (20000, 1.0, 0.5)):
        values |= {f"angle_error_deg.{speed}": error, f"closed_form_deg.{speed}": closed}
    course = row("vector/parameter-errors/L-30%") | {
        "conditions": {"machine_against_file": "L -30 %"},
        "values": values,
    }
    short = {"angle_error_deg.20000": 1.0, "closed_form_deg.20000": 1.0}
    single = row("vector/parameter-errors/R+50%") | {"conditions": {"machine_against_file": "R +50 %"}, "values": short}
    worst = row("vector/parameter-errors/worst") | {"conditions": {"machine_against_file": "L -30 %"}}
    assert parameter_map([single, worst, row("vector/catch")]) is None
    figure = parameter_map([course, single, worst])
    assert figure is not None
    lines = [[list(map(tuple, line.get_xydata()))] for line in figure.axes[0].get_lines()]
    assert lines == [[[(20.0, 1.0), (90.0, 3.0)]], [[(20.0, 0.5), (90.0, 2.5)]]]
