# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Where a stored result is from: every row and every figure carries revision, seed and source hashes of its own run."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from fluxlock.results.result import git_revision
from fluxlock.sources import hashes_of_revision, source_hashes, sources_text

Entry = dict[str, Any]


def origin(seed: int) -> Entry:
    """What is added to each result of a run that begins now."""
    return {"git_revision": git_revision(), "seed": seed, "sources": source_hashes()}


def origin_text(entry: Entry) -> str:
    """`Revision 1a2b, seed 1, chip …, firmware …, plant …` of a result; hashes it lacks are those of its revision."""
    revision, seed = entry.get("git_revision"), entry.get("seed")
    sources = entry.get("sources") or hashes_of_revision(revision or "")
    return f"Revision {revision or 'unknown'}, seed {'unknown' if seed is None else seed}, {sources_text(sources)}"


def common_origin(entries: Iterable[Entry]) -> str | None:
    """The origin in words if all results have the same one."""
    texts = {origin_text(entry) for entry in entries}
    return texts.pop() if len(texts) == 1 else None


def kept(entries: Sequence[Entry], key: str, known: Callable[[str], bool], what: str, path: Path) -> list[Entry]:
    """Stored results that still stand; each other one is named in a line on standard output, with the reason.

    key: of a result's name. known: whether something, in words `what`, gives results of a name. path: of the file.
    """
    found = []
    for entry in entries:
        name = str(entry.get(key))
        if not known(name):
            print(f"dropped from {path}: {name}: no {what} of this name any more")
        elif "git_revision" not in entry or "seed" not in entry:
            print(f"dropped from {path}: {name}: its revision and seed were not recorded")
        else:
            found.append(entry)
    return found
