# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Times of the tests: `python -m fluxverify.docs.tests [--before FILE]`, after `make test`.

`make test` leaves `build/test-times.json`, an object a test (`tests/times.py` says what it holds). From it are made
`docs/verification/tests.md` (processor time by folder, the slowest tests, the skipped ones with their reasons) and
`tests/times.json`, by which workers begin with the longest files. before: such a file of an older revision, measured on
the same machine; its times stand beside the present ones.
"""

from __future__ import annotations

import argparse
import json
from collections import defaultdict
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from fluxlock.base.paths import BUILD, ROOT

TIMES = BUILD / "test-times.json"
PAGE = ROOT / "docs" / "verification" / "tests.md"
ORDER = ROOT / "tests" / "times.json"
SLOWEST = 40
LONG_S = 5.0  # a file that takes less need not be begun early
NONE = "–"

HEAD = """# Times of the tests

For developers who wait for the tests. Written by `python -m fluxverify.docs.tests` from what `make test` left in
`build/test-times.json`: processor time in s, of each test and of the tools that it starts. Other work can
add a third to it. A chip or library that a test builds for others counts as its own.

What the tests took before they became quicker, on one machine beside the tree of November 27th 2026:
`git show 98f9020f:docs/verification/tests.md`.
"""


def read_times(path: Path) -> list[dict[str, Any]]:
    """Rows of a times file."""
    rows: list[dict[str, Any]] = json.loads(path.read_text(encoding="utf-8"))
    return rows


def by_place(rows: Iterable[dict[str, Any]], depth: int) -> dict[str, float]:
    """Processor time, s, of files or of folders: so many parts of the path."""
    sums: dict[str, float] = defaultdict(float)
    for row in rows:
        sums["/".join(row["id"].partition("::")[0].split("/")[:depth])] += row["cpu_s"]
    return dict(sums)


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "".join(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in line)} |\n" for line in lines)


def _seconds(value: float | None) -> str:
    return NONE if value is None else f"{value:.1f}"


def page(rows: list[dict[str, Any]], before: list[dict[str, Any]]) -> str:
    """The page."""
    older, newer = ({row["id"]: row["cpu_s"] for row in some} for some in (before, rows))
    beside = bool(before)

    def row_of(name: str, old: float | None, new: float | None) -> list[str]:
        return [name, *([_seconds(old)] if beside else []), _seconds(new)]

    head = [*(["before"] if beside else []), "now" if beside else "s"]
    folders, were = by_place(rows, 2), by_place(before, 2)
    counts: dict[str, int] = defaultdict(int)
    for row in rows:
        counts["/".join(row["id"].partition("::")[0].split("/")[:2])] += 1
    parts = [HEAD, "\n## By folder\n\n"]
    lines = [[*row_of(name, were.get(name), folders.get(name)), str(counts[name])] for name in sorted(folders | were)]
    total = row_of("all", sum(were.values()), sum(folders.values()))
    parts.append(_table(["folder", *head, "tests"], [*lines, [*total, str(len(rows))]]))
    for title, order in (
        (f"The {SLOWEST} slowest", newer),
        *(((f"The {SLOWEST} slowest before", older),) if beside else ()),
    ):
        slowest = sorted(order, key=lambda name: -order[name])[:SLOWEST]
        parts.append(f"\n## {title}\n\n")
        parts.append(_table(["test", *head], [row_of(f"`{x}`", older.get(x), newer.get(x)) for x in slowest]))
    skipped = [[f"`{row['id']}`", row["reason"]] for row in rows if row["outcome"] == "skipped"]
    parts.append(f"\n## Skipped: {len(skipped)}\n\n" + (_table(["test", "reason"], skipped) if skipped else ""))
    return "".join(parts).rstrip("\n") + "\n"


def main() -> None:
    """Command line of this module."""
    parser = argparse.ArgumentParser(description="Page of the tests' times.")
    parser.add_argument("--before", type=Path, help="times of an older revision")
    options = parser.parse_args()
    rows = read_times(TIMES)
    PAGE.write_text(page(rows, read_times(options.before) if options.before else []), encoding="utf-8")
    files = sorted(by_place(rows, 99).items(), key=lambda item: -item[1])
    kept = {name: round(seconds) for name, seconds in files if seconds >= LONG_S}
    ORDER.write_text(json.dumps(kept, indent=0) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
