# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Navigation of the site: the lists of links on the index pages.

A list item or a table row of an index page that begins with a link to a page puts this page below the index page, under
the words of the link. Pages beside an index page that no list names follow at its end. So a reader of the bare files
and a reader of the site see the same order.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

DOCS = Path("docs")
ROOT_PAGE = DOCS / "index.md"
ENTRY = re.compile(r"^(?:[-*] |\|[^|]*\| *|\| *)\[([^\]]+)\]\(([^)#\s]+\.md)\)", re.MULTILINE)
AUDIENCE = re.compile(r"\A# .*\n+(For [^\n]+(?:\n[^\n]+)*)")


@dataclass(frozen=True)
class Entry:
    """A page of the navigation: words of the link, file from the checkout's root, pages below it."""

    title: str
    page: Path
    below: tuple[Entry, ...] = ()


def normal(path: Path) -> Path:
    """A path from the checkout's root without `..`."""
    parts: list[str] = []
    for part in path.parts:
        if part == "..":
            parts.pop()
        else:
            parts.append(part)
    return Path(*parts)


def tree(root: Path, page: Path = ROOT_PAGE, title: str = "Fluxlock") -> Entry:
    """The navigation below a page."""
    lists = [path.relative_to(root) for path in (root / DOCS).rglob("index.md")]
    listed = {target for path in lists if _is_list(path) for _, target in _links(root, path)}
    return _entry(root, page, title, {page}, listed)


def _is_list(page: Path) -> bool:
    return page.name == "index.md" and page.parent != DOCS / "verification"


def _links(root: Path, page: Path) -> list[tuple[str, Path]]:
    text = (root / page).read_text(encoding="utf-8")
    return [(words, normal(page.parent / target)) for words, target in ENTRY.findall(text)]


def _entry(root: Path, page: Path, title: str, seen: set[Path], listed: set[Path]) -> Entry:
    """The entry of a page; seen: pages that have their place, listed: pages that some list names."""
    if not _is_list(page):
        return Entry(title, page)
    links = [(words, target) for words, target in _links(root, page) if target not in seen]
    if page != ROOT_PAGE:
        beside = sorted(path.relative_to(root) for path in (root / page).parent.glob("*.md"))
        links += [("", path) for path in beside if path not in listed | seen]
    seen.update(target for _, target in links)
    return Entry(title, page, tuple(_entry(root, target, words, seen, listed) for words, target in links))


def flat(entry: Entry) -> list[Entry]:
    """An entry and all below it."""
    return [entry, *(found for child in entry.below for found in flat(child))]


def audience(text: str) -> str:
    """The sentence of a page that says for whom it is; empty: none."""
    found = AUDIENCE.match(text)
    return re.split(r"[.:](?:\s|$)", found[1].replace("\n", " "))[0] + "." if found else ""
