# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Detectors of hard sentences, on sentences that were rewritten, and the budget that only falls."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from fluxlock.base.paths import ROOT
from fluxlock.base.writable import EXIT_READER_GONE
from fluxverify import words
from fluxverify.lint import CHECKS

BEFORE = [
    ("A chip is built once and kept.", ["passive"]),
    ("What it finds is an amplitude, the angle is firmware's; the rest is filtered later.", ["semicolon", "passive"]),
    ("Not printed in the thesis, taken from a figure of the machine.", ["no_verb"]),
    ("The chip takes four samples a turn.", ["a_for_per"]),
    ("Angles come once a carrier (first sample after the crossing).", ["parentheses", "a_for_per"]),
    ("In the safe state all gates are held off.", ["passive"]),
    ("Slow firmware reduces control bandwidth; it never moves a gate edge.", ["semicolon"]),
    ("Low optimisation for this file.", ["no_verb"]),
]
AFTER = [
    "Each chip variant compiles once and the build keeps it.",
    "The hardware delivers an amplitude. The firmware computes the angle.",
    "The thesis does not give this value. We assume it.",
    "The chip takes four samples per turn.",
    "Angles come once per carrier [first](a.md).",
    "The guard holds all gates off.",
    "The gates are held off by the guard.",
    "Slow firmware reduces control bandwidth. It never moves a gate edge.",
    "Run time is negligible here, so the optimisation is low.",
    "If several causes appear at once, the order of this table decides which one the drive reports.",
    "Noise alone can produce shorter runs of equal values.",
    "Each product keeps its upper 32 bits.",
    "Scale the master's timeouts by the same factor.",
    "The console knows these settings (`set`), and needs a line.",
]


@pytest.mark.parametrize(("sentence", "kinds"), BEFORE)
def test_faults_are_found(sentence: str, kinds: list[str]) -> None:
    """A sentence as we wrote it has its faults and no other.

    Verifies: DOC-13
    """
    assert words.faults_of(sentence) == kinds


@pytest.mark.parametrize("sentence", AFTER)
def test_good_sentences_pass(sentence: str) -> None:
    """The same thing said well has none.

    Verifies: DOC-13
    """
    page = words.faults_in(sentence)
    assert [kind for kind, found in page.items() if found] == []


def test_pages_are_read_as_readers_do() -> None:
    """Code, headings and links do not count, cells of tables do but for the verb; lines are those of the paragraph.

    Verifies: DOC-13
    """
    text = (
        "# Samples a turn\n\n```\nx; y\n```\nA [link](a;b.md) goes\nhere. It is kept.\n\n"
        "| 2 samples a turn; more | none at all here. |\n"
    )
    found = words.faults_in(text)
    assert {kind: [number for number, _ in rows] for kind, rows in found.items() if rows} == {
        "semicolon": [9],
        "passive": [6],
        "a_for_per": [9],
    }


def test_budget_only_falls(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """A sum that rises fails, names page, line and sentence, and is not written; one that falls is.

    Verifies: DOC-13
    """
    (tmp_path / "docs").mkdir()
    (tmp_path / "README.md").write_text("The gate is held.\n")
    budget = tmp_path / "docs" / "words-budget.json"
    monkeypatch.setattr(words, "BUDGET", budget)
    measure = words.measure
    measured = measure(tmp_path)
    monkeypatch.setattr(words, "measure", lambda: measured)
    monkeypatch.setattr(words, "read_budget", lambda: json.loads(budget.read_text()))
    budget.write_text('{"README.md": {"passive": 3}}')
    assert words.main(["--lower"]) == 0
    assert json.loads(budget.read_text()) == {"README.md": {"passive": 1}}
    (tmp_path / "docs" / "new.md").write_text("\nThe leg is kept off.\n")
    measured = measure(tmp_path)
    capsys.readouterr()
    assert words.main(["--lower"]) == 1
    assert "docs/new.md:2: passive: The leg is kept off." in capsys.readouterr().out
    assert json.loads(budget.read_text()) == {"README.md": {"passive": 1}}
    assert "words" in CHECKS


def test_generated_pages_do_not_count() -> None:
    """A page that a command writes from data is left out, one that people write is not.

    Verifies: DOC-13
    """
    names = {page.relative_to(words.ROOT).as_posix() for page in words.pages()}
    assert "docs/verification/matrix.md" not in names and "docs/reference/files.md" not in names
    assert {"README.md", "CONTRIBUTING.md", "docs/fails/index.md", "docs/architecture.md"} <= names


def test_reader_that_goes() -> None:
    """A list whose reader ends first: nothing on the error output, and the exit code of a closed pipe.

    Verifies: FRONT-61
    """
    command = f"{sys.executable} -m fluxverify.words --list semicolon | true"
    done = subprocess.run(
        ["bash", "-o", "pipefail", "-c", command], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (EXIT_READER_GONE, "")
