# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The README is short, in order, and shows what other files hold; `make help` knows every target."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path
from xml.etree import ElementTree

import pytest

from fluxlock.base.paths import ROOT
from fluxverify.docs import diagram, readme

TEXT = readme.README.read_text(encoding="utf-8")
MOST_WORDS = 450
SECTIONS = ["Start", "With it you can", "Chips", "Not yet", "Licence"]
MAKEFILE = (ROOT / "Makefile").read_text(encoding="utf-8")


def words(text: str) -> list[str]:
    """Words that a reader sees: without comments, tags and the targets of links."""
    seen = re.sub(r"<!--.*?-->|<[^>]*>|\]\([^)]*\)", " ", text, flags=re.DOTALL)
    return [word for word in seen.split() if re.search(r"\w", word)]


def test_length_and_order() -> None:
    """At most 450 words; first what it is, then the scope, the commands, the roles, the chips, what is missing.

    Verifies: DOC-12
    """
    assert len(words(TEXT)) <= MOST_WORDS
    assert re.findall(r"^## (.*)$", TEXT, re.MULTILINE) == SECTIONS
    first = TEXT.split("\n\n")[1]
    assert first.count(".") == 1 and len(words(first)) <= 20
    roles = TEXT.split("## With it you can")[1].split("## ")[0]
    assert len(re.findall(r"^- \[[^]]+\]\([^)]+\)", roles, re.MULTILINE)) == 5
    scope = TEXT.index("docs/images/scope.svg")
    assert TEXT.index("badge-licence") < scope < TEXT.index("make demo")


def test_words() -> None:
    """What is counted: words of text and of code, not the targets of links."""
    assert words("# A [link](docs/a b.md) | - | `make demo` <!-- no --> <img alt='no no'> 1 000") == [
        "A", "[link", "`make", "demo`", "1", "000",
    ]  # fmt: skip


def test_pictures() -> None:
    """Every picture is in the checkout and has a text for those who do not see it; motion has a still.

    Verifies: DOC-12
    """
    files = re.findall(r'(?:srcset|src)="([^"]+)"', TEXT) + re.findall(r"!\[[^]]+\]\(([^)]+)\)", TEXT)
    assert len(files) == 7
    for file in files:
        assert ElementTree.parse(ROOT / file).getroot().tag.endswith("svg")
    assert all(re.search(r'alt="[^"]{20,}"', tag) for tag in re.findall(r"<img[^>]*>", TEXT))
    still = re.search(r'<source media="\(prefers-reduced-motion: reduce\)" srcset="([^"]+)">', TEXT)
    assert still and "<animate" not in (ROOT / still[1]).read_text(encoding="utf-8")


def test_generated(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Table and badges are those of synthesis, record and project; another size is found.

    Verifies: DOC-12
    """
    assert readme.main(["--check"]) == 0
    page = tmp_path / "synthesis.md"
    page.write_text(readme.PAGE.read_text(encoding="utf-8").replace("| 13593 |", "| 13594 |"), encoding="utf-8")
    monkeypatch.setattr(readme, "PAGE", page)
    assert readme.main(["--check"]) == 1
    assert "| six-step | 13 594 |" in readme.with_table(TEXT)


@pytest.mark.parametrize("name", diagram.THEMES)
def test_diagram(name: str) -> None:
    """The block diagrams are those of their script, and no text is wider than its block.

    Verifies: DOC-12
    """
    theme = diagram.THEMES[name]
    assert (diagram.IMAGES / f"blocks-{name}.svg").read_text(encoding="utf-8") == diagram.svg(theme)
    for box in diagram.BOXES:
        assert max(map(len, box.lines)) * 6.2 <= box.w and 16 * len(box.lines) < box.h


def test_help_of_make() -> None:
    """Every target stands in a group of `make help`, with what it gives and how long it takes.

    Verifies: DOC-12
    """
    shown = subprocess.run(["make", "-s", "help"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    listed = dict(re.findall(r"^  ([a-z-]+) +(.+)$", shown, re.MULTILINE))
    targets = set(re.findall(r"^([a-z-]+):", MAKEFILE, re.MULTILINE)) - {"help", "place"}
    assert set(listed) == targets
    quick = {"clean", "distclean"}
    assert all(re.search(r"; .*(minute|hour|second|\d (s|min|h)\b)", listed[name]) for name in targets - quick)
    assert len(re.findall(r"^\w[^:\n]*$", shown, re.MULTILINE)) == MAKEFILE.count("\n##@ ")
