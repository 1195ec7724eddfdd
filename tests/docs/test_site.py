# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Navigation and sources of the site, without Sphinx: `make site` is the test of the rest."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from fluxlock.base.paths import ROOT
from fluxverify.docs import navigation, site, site_pages
from fluxverify.docs.navigation import Entry

TREE = navigation.tree(ROOT)
MOST_ENTRIES = 9
TABS = ["Start", "How to", "When it fails", "Understand", "Chip", "Evidence", "Reference", "Develop"]


@pytest.fixture(scope="module")
def sources(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site") / "source"
    site.stage(source=folder)
    return folder


def test_every_page_has_one_place() -> None:
    """Every page of the docs is below one of the eight tabs, once.

    Verifies: DOC-10
    """
    pages = [entry.page.as_posix() for entry in navigation.flat(TREE)]
    there = {path.relative_to(ROOT).as_posix() for path in (ROOT / "docs").rglob("*.md")}
    there = {page for page in there if "requirements.d" not in page}
    assert [entry.title for entry in TREE.below] == TABS
    assert len(pages) == len(set(pages))
    assert there - set(pages) == set()


def children(sources: Path, page: str) -> list[str]:
    """Pages that the table of contents of a page puts below it."""
    text = (sources / f"{page}.md").read_text(encoding="utf-8")
    listed = re.findall(r"^```\{toctree\}\n:hidden:\n\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    targets = [re.sub(r"^.* <(.*)>$", r"\1", line) for part in listed for line in part.splitlines()]
    return [(target if target.startswith("/") else f"/{page}/../{target}") for target in targets]


def test_entries_of_a_tab(sources: Path) -> None:
    """A tab has nine entries at most, and so has every list of modules.

    Verifies: DOC-10
    """
    many = {}
    for entry in TREE.below:
        page = entry.page.relative_to("docs").with_suffix("").as_posix()
        many[entry.title] = len(children(sources, page))
    for folder in (sources / "blocks").glob("rtl-*.md"):
        many[folder.stem] = len(children(sources, f"blocks/{folder.stem}"))
    assert len(many) > len(TABS)
    assert {name: n for name, n in many.items() if n > MOST_ENTRIES} == {}


def test_first_line_says_for_whom(sources: Path) -> None:
    """The first line of every page of the site says for whom it is.

    Verifies: DOC-10
    """
    without = [
        path.relative_to(sources).as_posix()
        for path in sources.rglob("*.md")
        if not navigation.audience(path.read_text(encoding="utf-8"))
    ]
    assert without == []


def test_navigation_follows_the_lists(tmp_path: Path) -> None:
    """A list item or a table row that begins with a link makes an entry, a sentence with a link none; once only.

    Verifies: DOC-10
    """
    pages = {
        "docs/index.md": "# A\n\nSee [b](b.md).\n\n"
        "- [Chip](chip/index.md): x\n- [b](b.md)\n- no [link](c.md)\n- [Last](last/index.md)\n",
        "docs/chip/index.md": "# C\n\n| | |\n|---|---|\n| `x` | [b again](../b.md) | |\n| `y` | [c](../c.md) | |\n",
        "docs/chip/more.md": "# More\n",
        "docs/chip/later.md": "# Later\n",
        "docs/last/index.md": "# L\n\n- [later](../chip/later.md)\n",
        "docs/b.md": "# B\n",
        "docs/c.md": "# C\n",
    }
    for name, text in pages.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text, encoding="utf-8")
    below = (Entry("c", Path("docs/c.md")), Entry("", Path("docs/chip/more.md")))
    last = Entry("Last", Path("docs/last/index.md"), (Entry("later", Path("docs/chip/later.md")),))
    expected = (Entry("Chip", Path("docs/chip/index.md"), below), Entry("b", Path("docs/b.md")), last)
    assert navigation.tree(tmp_path).below == expected


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("[a](../../rtl/pkg/fl_pkg.sv)", "[a](source:rtl/pkg/fl_pkg.sv)"),
        ("[a](../architecture.md#the-chip)", "[a](../architecture.md#the-chip)"),
        ("[a](../../README.md#x)", "[a](../index.md)"),
        ("[a](../../CONTRIBUTING.md)", "[a](../project/contributing.md)"),
        ("[a](https://x.org/y)", "[a](https://x.org/y)"),
        ("```\n[a](../../README.md)\n```", "```\n[a](../../README.md)\n```"),
        ("[a](../verification/requirements.d/)", "[a](source:docs/verification/requirements.d)"),
    ],
)
def test_links_on_the_site(text: str, expected: str) -> None:
    """Links to sources, to pages of the root and to pages lead to what the site has of them.

    Verifies: DOC-11
    """
    assert site.relink(text, Path("docs/blocks/fl_zcd.md")) == expected


def test_pictures_on_the_site() -> None:
    """A picture for dark pages, or for readers without motion, becomes two images with the class of each.

    Verifies: DOC-11
    """
    for media, classes in site.CHOICES.items():
        source = f'<source media="({media}: x)" srcset="images/b.svg">'
        text = f'<picture>\n  {source}\n  <img src="images/a.svg" alt="A motor" width="800">\n</picture>\n'
        expected = f"![A motor](images/a.svg){{.{classes[0]}}}\n![A motor](images/b.svg){{.{classes[1]}}}\n"
        assert site.relink(text, Path("docs/index.md")) == expected


def test_settings_by_name() -> None:
    """Every key of the tables of the input files is on the page of the settings, under its name in words.

    Verifies: DOC-11
    """
    text = (ROOT / site_pages.FILES).read_text(encoding="utf-8")
    found = site_pages.settings(text)
    assert [place[0] for place in found["dead time"]] == ["dead_time_s"]
    keys = {key for places in found.values() for key, _, _ in places}
    rows = set(re.findall(r"^\| `(\w+)` \|(?:[^|]*\|){4}", text, re.MULTILINE))
    assert len(rows) > 100
    assert rows - keys == set()
