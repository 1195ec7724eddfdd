# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The campaign's page: what is read, and from which runs it is not written."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from fluxverify.campaign import page
from fluxverify.campaign.grid import DRIVES

ROWS = [
    {"drive": d.name, "moment": "m", "disturbance": "x", "upsets": [], "outcome": "ridden through", "reasons": []}
    for d in DRIVES
]
WHOLE: dict[str, Any] = {"seed": 1, "quick": False, "every": 1, "grid": len(ROWS)}
WHOLE |= {"drives": [d.name for d in DRIVES], "rows": ROWS}
WHOLE["machines"] = [
    {"drive": d.name, "motor": "M", "chip": "c", "firmware": "f", "registers": 1, "register_bits": 2} for d in DRIVES
]


def written(document: object, folder: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[int, str]:
    """Exit code, and the page that stood there before or the new one."""
    target = folder / "campaign.md"
    target.write_text("old")
    file = folder / "campaign.json"
    file.write_text(document if isinstance(document, str) else json.dumps(document))
    monkeypatch.setattr(page, "ROOT", folder)
    monkeypatch.setattr(page, "PAGE", target)
    monkeypatch.setattr(page, "RESULT", file)
    return page.main([str(file)]), target.read_text()


def test_whole_grid(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A campaign of all drives is the page, also in a document that does not name them.

    Verifies: CAMP-05
    """
    for document in (WHOLE, {key: value for key, value in WHOLE.items() if key != "drives"}):
        code, text = written(document, tmp_path, monkeypatch)
        assert code == 0 and f"**{len(ROWS)} of {len(ROWS)} runs ended right, 100.00 %.**" in text


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"quick": True}, "--quick"),
        ({"every": 3}, "--every 3"),
        ({"drives": ["boot"]}, "drives boot only"),
        ({"drives": None, "rows": ROWS[:2]}, "drives six-step, start only"),
        ({"quick": True, "drives": ["boot"]}, "--quick, drives boot only"),
    ],
)
def test_parts_are_refused(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    changes: dict[str, Any],
    told: str,
) -> None:
    """From a part of the grid the page is not written, and the message says which part it was.

    Verifies: CAMP-05
    """
    assert written(WHOLE | changes, tmp_path, monkeypatch) == (2, "old")
    assert f"holds a part of the grid ({told}); campaign.md stays as it is" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("document", "told"),
    [
        ("{", "is no JSON document"),
        ("7", "is no JSON document"),
        ([], "seed: is missing"),
        ({"seed": 1}, "quick: is missing"),
    ],
)
def test_no_document(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], document: object, told: str
) -> None:
    """What is no document of a campaign is named in one line, exit code 2.

    Verifies: CAMP-05
    """
    assert written(document, tmp_path, monkeypatch) == (2, "old")
    assert told in capsys.readouterr().err


def test_no_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A file that is not there, and a folder: one line that says what writes it, exit code 2.

    Verifies: CAMP-05
    """
    for path, told in ((tmp_path / "no.json", "No such file or directory"), (tmp_path, "Is a directory")):
        assert page.main([str(path)]) == 2
        error = capsys.readouterr().err
        assert error == f"error: {path}: cannot be read: {told}; fluxverify campaign writes build/campaign.json\n"
