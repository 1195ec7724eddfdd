# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What a row of a figure has to say, how a page keeps sections, and what changed between two pages."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from fluxverify.docs import figure_page
from fluxverify.docs import figures as docs_page
from fluxverify.figures import Drawing, Entry, command
from fluxverify.figures.command import check_speeds, draw, of_family
from fluxverify.figures.figure import FAMILIES, RowFault, near, rises
from fluxverify.figures.five_phase.support import Course, took_place
from fluxverify.figures.five_phase.tian_dynamic import SPEED, outcome
from fluxverify.figures.panels import page
from fluxverify.regression.runner import RunFailed, Runner


@pytest.mark.parametrize(
    ("printed", "agrees", "why"),
    [("5", False, ""), ("5", None, ""), ("", True, ""), ("", False, "a reason")],
)
def test_a_row_without_its_reason_is_refused(printed: str, agrees: bool | None, why: str) -> None:
    """What differs or cannot be compared needs a reason; where nothing was printed nothing agrees.

    Verifies: FIG-09
    """
    with pytest.raises(RowFault, match="row 'current'"):
        Entry("current", printed, "7", "drive", agrees, why)


def test_a_row_says_enough() -> None:
    """A row that agrees, one with a reason, and one without print are rows; numbers agree within what can be read.

    Verifies: FIG-09
    """
    rows = (
        Entry("a", "5", "5", "drive", True),
        Entry("b", "5", "7", "imposed", False, "cause not known"),
        Entry("c", "", "7", "no run", None),
    )
    texts = [docs_page.reason(row.as_json()) for row in rows]
    assert texts == ["agrees", "cause not known", "not printed"]
    assert near(0.11, 0.115, 0.005) and not near(0.11, 0.1151, 0.005)
    assert rises([1.0, 2.0]) and not rises([1.0, 1.0])


def test_a_figure_with_such_a_row_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The figure fails by the row's name, without a traceback, and has no image.

    Verifies: FIG-09
    """

    def body(runner: Runner) -> Drawing:
        """A row without its reason."""
        drawn, _ = page("x", 1, 1, (3, 2))
        return Drawing("At rest.", drawn, (Entry("current", "5", "7", "no run", False),))

    kind = type(of_family("six-step")[0])
    monkeypatch.setattr(command, "FIGURES", {"six-step/1.1": kind("six-step", "1.1", body)})
    part = draw("six-step", tmp_path, "1.1", False, 1)
    assert part["failure"].startswith("row 'current': '7' differs") and "Traceback" not in part["failure"]
    assert not list(tmp_path.iterdir())


def test_rows_say_who_set_the_speed() -> None:
    """A row that says the drive held the speed fails where the plant imposed it; theory beside a run is allowed.

    Verifies: FIG-09
    """
    drawn, _ = page("x", 1, 1, (3, 2))
    drawing = Drawing("x", drawn, (Entry("a", "", "1", "imposed", None), Entry("b", "", "1", "no run", None)))
    check_speeds(drawing, {"imposed"})
    for runs in ({"drive"}, {"imposed", "drive"}, set()):
        with pytest.raises(RowFault, match="the rows say imposed"):
            check_speeds(drawing, cast(Any, runs))


def _document(folder: Path, rows: list[dict[str, Any]], schema: int = command.SCHEMA_VERSION) -> None:
    (folder / "blac").mkdir(parents=True, exist_ok=True)
    figure = {"figure": "7.5", "title": "T", "condition": "C", "image": "fig-7-5.png", "table": rows, "failure": ""}
    document = {
        "schema": schema,
        "family": "blac",
        "quick": False,
        "figures": [{**figure, "git_revision": "b", "seed": 1}],
    }
    (folder / "blac" / "figures.json").write_text(json.dumps(document))
    (folder / "blac" / "fig-7-5.png").write_bytes(b"x")


ROW = {"quantity": "q|", "printed": "1", "here": "2", "speed": "imposed", "agrees": False, "why": "because"}


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ({**ROW, "why": ""}, "blac 7.5, q|: 2 instead of 1, without a reason"),
        ({**ROW, "speed": ""}, "blac 7.5, q|: does not say who sets the speed"),
    ],
)
def test_a_page_with_such_a_row_is_not_written(
    row: dict[str, Any], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Generation fails by name and leaves the page as it was.

    Verifies: FIG-09
    """
    _document(tmp_path / "figures", [row])
    (tmp_path / "figures-blac.md").write_text("before")
    assert docs_page.write_pages(tmp_path / "figures", tmp_path, tmp_path / "images") == 1
    assert message in capsys.readouterr().err
    assert (tmp_path / "figures-blac.md").read_text() == "before"


def test_document_of_another_version(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A result from before rows said who sets the speed is refused in one line.

    Verifies: FIG-09
    """
    _document(tmp_path / "figures", [ROW], schema=1)
    assert docs_page.write_pages(tmp_path / "figures", tmp_path, tmp_path / "images") == 1
    assert "of another version" in capsys.readouterr().err


BEFORE = """# Head

Revision a, seed 1, chip `c`, plant `p`, full length.

## Figure 7.4: Poles

Condition.

| | thesis | here | why |
|---|---|---|---|
| zero | 0 | 0.1 |   |

## Figure 7.5: Old

| | thesis | here | why |
|---|---|---|---|
| q\\| | 1 | 9 |   |
| gone | 1 | 3 |   |
"""


def test_a_page_keeps_what_was_not_drawn(tmp_path: Path) -> None:
    """Sections of other figures stay, with the revision that the head had; the head names none then.

    Verifies: FIG-03
    """
    _document(tmp_path / "figures", [ROW])
    target = tmp_path / "figures-blac.md"
    target.write_text(BEFORE)
    assert docs_page.write_pages(tmp_path / "figures", tmp_path, tmp_path / "images") == 0
    text = target.read_text()
    assert "Full length; revision and seed stand at each figure." in text
    assert (
        "## Figure 7.4: Poles\n\nRevision a, seed 1, chip `c`, plant `p`.\n\nCondition.\n" in text
        and "| zero | 0 | 0.1 |" in text
    )
    assert (
        "## Figure 7.5: T\n\nRevision b, seed 1, sources not recorded.\n" in text
        and "| q\\| | 1 | 2 | imposed | because |" in text
    )
    assert "Old" not in text and text.index("Figure 7.4") < text.index("Figure 7.5")
    # Once more: what is kept does not grow.
    assert docs_page.write_pages(tmp_path / "figures", tmp_path, tmp_path / "images") == 0
    assert target.read_text() == text


def test_changes_between_pages(tmp_path: Path) -> None:
    """Values that differ, are new or gone, whatever the columns; the nearest cause counts.

    Verifies: FIG-10
    """
    _document(tmp_path / "figures", [ROW, {**ROW, "quantity": "new"}])
    target = tmp_path / "figures-blac.md"
    target.write_text(BEFORE)
    docs_page.write_pages(tmp_path / "figures", tmp_path, tmp_path / "images")
    found = list(figure_page.changes(BEFORE, target.read_text()))
    assert [(c.figure, c.quantity, c.before, c.now) for c in found] == [
        ("7.5", "q|", "9", "2"),
        ("7.5", "new", None, "2"),
        ("7.5", "gone", "3", None),
    ]
    causes = {"cause": "all", "7.5": {"cause": "figure", "q|": "row"}}
    assert [figure_page.cause(causes, change) for change in found] == ["row", "figure", "figure"]
    assert figure_page.cause({"7.5": {"q|": "row"}}, found[1]) is None
    assert figure_page.cause({"cause": "all"}, found[1]) == "all"


def test_comparison_names_what_has_no_cause(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The command prints a line a change; one without a cause is an error; an unknown revision is one line.

    Verifies: FIG-10
    """
    for family in FAMILIES:
        shutil.copyfile(docs_page.PAGES / docs_page.page_name(family), tmp_path / docs_page.page_name(family))
    old = (tmp_path / "figures-blac.md").read_text()
    monkeypatch.setattr(docs_page, "_page_of", lambda revision, path: None if revision == "x" else path.read_text())
    causes = tmp_path / "causes.toml"
    assert docs_page.compare("r", tmp_path, causes) == 0
    monkeypatch.setattr(
        docs_page, "_page_of", lambda revision, path: BEFORE if path.name == "figures-blac.md" else path.read_text()
    )
    capsys.readouterr()
    assert docs_page.compare("r", tmp_path, causes) == 1
    caught = capsys.readouterr()
    assert "| blac 7.5 | gone | 3 | – | not given |" in caught.out and "error: blac 7.5, gone: changed" in caught.err
    causes.write_text('[blac]\ncause = "another chip"\n')
    assert docs_page.compare("r", tmp_path, causes) == 0
    assert "| blac 7.5 | gone | 3 | – | another chip |" in capsys.readouterr().out and old


@pytest.mark.parametrize("revision", ["no-such-revision", "--output=x"])
def test_unknown_revision(revision: str, capsys: pytest.CaptureFixture[str]) -> None:
    """A revision that does not exist is refused in one line, exit code 2.

    Verifies: FIG-10
    """
    assert docs_page.main([f"--against={revision}"]) == 2
    assert f"{revision} has no figures-six-step.md" in capsys.readouterr().err


def _course(rpm: list[float], error_deg: float = 1.0) -> Course:
    """Speeds as corners from -0.6 s to 0.7 s around the step."""
    time_s = np.arange(-0.6, 0.7, 1e-3)
    speed = np.interp(time_s, np.linspace(-0.6, 0.7, len(rpm)), rpm)
    flat = np.zeros(time_s.size)
    return Course(time_s, flat, flat, flat, flat + error_deg, speed, speed, "no trip")


def test_an_event_has_to_take_place() -> None:
    """A reversal that never happens fails, and so does one from or to a speed that is not settled; a whole one passes.

    Verifies: FIG-11
    """
    whole = [60.0] * 8 + [-60.0] * 6
    assert outcome(_course(whole), SPEED, "best") == ""
    for rpm, words in (
        ([60.0] * 14, "the speed stayed"),
        ([60.0] * 8 + [20.0, -10.0, -10.0, -20.0, -20.0, -20.0], "not settled at the end"),
        ([40.0] * 8 + [-60.0] * 6, "not settled before the step"),
    ):
        with pytest.raises(RunFailed, match=words):
            outcome(_course(rpm), SPEED, "best")
    with pytest.raises(RunFailed, match="angle off by 120"):
        outcome(_course(whole, error_deg=120.0), SPEED, "best")


def test_a_stated_failure_has_to_take_place(monkeypatch: pytest.MonkeyPatch) -> None:
    """A method that the title says to fail has to fail; then its words are returned.

    Verifies: FIG-11
    """
    monkeypatch.setattr(
        "fluxverify.figures.five_phase.tian_dynamic.FAILS", {("speed-reversal", "conventional"): "loses the angle"}
    )
    assert outcome(_course([60.0] * 14), SPEED, "conventional") == "loses the angle"
    with pytest.raises(RunFailed, match="said to fail"):
        outcome(_course([60.0] * 8 + [-60.0] * 6), SPEED, "conventional")


def test_a_speed_has_to_be_reached() -> None:
    """A start that ends at 39 of 50 r/min fails with what it reached.

    Verifies: FIG-11
    """
    took_place(_course([0.0, 50.0, 50.0]), "start", 50.0, 0.5, 0.69)
    with pytest.raises(RunFailed, match=r"start: the event did not take place: 39\.\d r/min"):
        took_place(_course([0.0, 39.3, 39.3]), "start", 50.0, 0.5, 0.69)


def test_watched_runner_notes_the_speed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Free and imposed shafts are told apart by the run's own scenario.

    Verifies: FIG-09
    """
    modes = iter(("free", "imposed", "locked"))
    monkeypatch.setattr(
        Runner,
        "drive",
        lambda self, *a, **k: SimpleNamespace(scenario=SimpleNamespace(mechanics=SimpleNamespace(mode=next(modes)))),
    )
    runner = command.WatchedRunner("x")
    runner.drive("s", "a")
    assert runner.speeds == {"drive"}
    runner.drive("s", "b")
    assert runner.speeds == {"drive", "imposed"}
    other = command.WatchedRunner("y")
    assert other.speeds == set()
