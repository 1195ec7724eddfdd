# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Runs that cases of the regression share."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace

import pytest

from fluxverify.regression import runner, shipped
from fluxverify.regression.sets import CASES


def test_sequence_is_the_shipped_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """`vector/sequence` and `vector/shipped` run vector/start.toml once: key and seed are the same."""
    keys = []

    def made(_folder: Path, key: str, what: str, _run: object) -> Path:
        keys.append(key)
        raise runner.RunFailed(what)

    monkeypatch.setattr(runner, "_made", made)
    monkeypatch.setattr(runner, "image_of", lambda _scenario: Path(__file__))
    monkeypatch.setattr(runner, "chip_of", lambda _scenario: SimpleNamespace(key=""))
    monkeypatch.setattr(shipped, "stated", lambda _family: [Path("vector/start.toml")])
    for name in ("vector/sequence", "vector/shipped"):
        with suppress(runner.RunFailed):
            list(CASES[name].body(runner.Runner(name)))
    assert len(keys) == 2 and keys[0] == keys[1]
