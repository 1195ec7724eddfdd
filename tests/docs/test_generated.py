# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Files that a command generates: written, compared, named when they are out of date."""

from __future__ import annotations

from pathlib import Path

import pytest

from fluxlock.generated import renew


def test_check_names_what_is_out_of_date_and_writes_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A missing and a changed file are named with the command that writes them; without the check they are written.

    Verifies: DOC-03
    """
    texts = {tmp_path / name: f"{name}\n" for name in ("kept", "changed", "below/missing")}
    (tmp_path / "kept").write_text("kept\n")
    (tmp_path / "changed").write_text("old\n")
    assert renew(texts, "some.module", check=True, root=tmp_path) == 1
    assert capsys.readouterr().err.splitlines() == [
        f"error: {name}: out of date, run python -m some.module" for name in ("changed", "below/missing")
    ]
    assert (tmp_path / "changed").read_text() == "old\n" and not (tmp_path / "below").exists()
    assert renew(texts, "some.module", check=False, root=tmp_path) == 0
    assert all(path.read_text() == text for path, text in texts.items())
    assert renew(texts, "some.module", check=True, root=tmp_path) == 0
