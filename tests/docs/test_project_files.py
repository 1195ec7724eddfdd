# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Project files in the root agree with each other."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import fluxlock
from fluxlock.base.paths import ROOT

NAMES = ("CHANGELOG.md", "CONTRIBUTING.md", "SECURITY.md", "CODE_OF_CONDUCT.md", "CITATION.cff", "LICENSE")


def test_one_version() -> None:
    """Package, citation and the newest entry of the changelog name one version.

    Verifies: DOC-08
    """
    with (ROOT / "pyproject.toml").open("rb") as file:
        version = tomllib.load(file)["project"]["version"]
    cited = re.search(r"^version: (\S+)$", (ROOT / "CITATION.cff").read_text(encoding="utf-8"), re.MULTILINE)
    newest = re.search(r"^## (\S+)", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert cited and newest
    assert cited[1] == newest[1] == version


def test_project_files() -> None:
    """The files that a site for repositories looks for are there, and the package's annotations count.

    Verifies: DOC-08
    """
    assert [name for name in NAMES if not (ROOT / name).is_file()] == []
    assert (Path(fluxlock.__file__).parent / "py.typed").is_file()
