# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Table and chart of the regression for the docs: `python -m fluxverify.docs.regression` after `make regression`.

Rows of cases without a result in `build/regression.json` stay on the page as they are, with the sources that they were
made from. Bands beside limits are always those of the record.
"""

from __future__ import annotations

import json
import re
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import fluxverify.regression.sets  # noqa: F401  (registers the cases)
from fluxlock.base.paths import BUILD, ROOT
from fluxlock.theory.six_step.plots import save
from fluxverify.docs.parameter_map import parameter_map
from fluxverify.regression.case import CASES, limit_text
from fluxverify.regression.origin import origin_text
from fluxverify.regression.record import Record, band_text, read_record
from fluxverify.regression.run import case_of

PAGE = ROOT / "docs" / "verification" / "regression.md"
PARAMETER_MAP = ROOT / "docs" / "images" / "vector-parameters-chip.png"
RESULT = BUILD / "regression.json"

HEAD = """# Regression

Written by `python -m fluxverify.docs.regression` from `build/regression.json`, which `make regression` writes.
`make regression CASES=six-step/starts` runs the cases whose names begin so, `QUICK=1` a short version of each; runs
finished before with the same chip, firmware, scenario and plant are not repeated. Values in **bold** have a limit. In
brackets beside it stand the limit and the band about the last accepted value, of [`record.json`](record.json). Rows of
cases without a result stay as they are.
"""
SHORT = re.compile(r"^(Short versions;|.*, short versions\.$)", re.MULTILINE)  # on a page of such runs
BOLD = re.compile(r"\*\*(?P<name>\S+) (?P<value>\S+)\*\* \((?P<limit>[^);]*)(?:; [^)]*)?\)")


@dataclass(frozen=True)
class Shown:
    """A row as the page shows it. line: of the table. origin: revision, seed and sources. note: or empty."""

    id: str
    line: str
    origin: str
    note: str


def _band(row: str, name: str, limit: str, record: Record) -> str:
    """What stands in brackets: the limit, and the record's band unless the limit is one number."""
    if not re.search("[≤≥±…]", limit):
        return limit
    entry = record.get(row, {"values": {}})["values"].get(name)
    return f"{limit}; {band_text(entry['band']) if entry else 'not recorded'}"


def _value(name: str, row: dict[str, Any], record: Record) -> str:
    value, limit = row["values"][name], row["limit"].get(name)
    shown = "-" if value is None else f"{value:.4g}" if isinstance(value, float) else str(value)
    if limit is None:
        return f"{name} {shown}"
    return f"**{name} {shown}** ({_band(row['id'], name, limit_text(limit['min'], limit['max']), record)})"


def _shown(row: dict[str, Any], record: Record) -> Shown:
    conditions = ", ".join(f"{key} {value}" for key, value in row["conditions"].items())
    values = ", ".join(_value(key, row, record) for key in row["values"])
    line = f"| {row['id']} | {conditions} | {values} | {'pass' if row['pass'] else '**miss**'} |"
    return Shown(row["id"], line, origin_text(row), row["note"])


def _kept(text: str, record: Record) -> list[Shown]:
    """The rows of a page of full-length runs, with the bands of the record."""
    notes = dict(re.findall(r"^(\S+/\S+): (.+)$", text, re.MULTILINE))
    found: list[Shown] = []
    section = ""  # origin of its rows, but for those with one of their own
    of_row: dict[str, str] = {}
    for line in text.splitlines():
        if line.startswith("## "):
            of_row = {}
        elif match := re.fullmatch(r"(Revision [^:]*?)(?:, full length)?(?:: (.*))?\.", line):
            section = match[1] if match[2] is None else section
            of_row |= dict.fromkeys((match[2] or "").split(", "), match[1])
        elif match := re.match(r"\| (\S+/\S+) \|", line):
            name = match[1]

            def banded(match: re.Match[str], row: str = name) -> str:
                limit = _band(row, match["name"], match["limit"], record)
                return f"**{match['name']} {match['value']}** ({limit})"

            found.append(Shown(name, BOLD.sub(banded, line), of_row.get(name, section), notes.get(name, "")))
    return found


def _origins(rows: list[Shown]) -> list[str]:
    """Revision, seed and sources of a case, of its rows where they differ."""
    texts = dict.fromkeys(row.origin for row in rows)
    if len(texts) == 1:
        return [f"{rows[0].origin}.\n"]
    return [f"{text}: {', '.join(row.id for row in rows if row.origin == text)}.\n" for text in texts]


def page(document: dict[str, Any], record: Record, before: str = "") -> str:
    """The page: a table a case, a line a row.

    before: the page as it is; rows of cases that the document does not hold stay, unless either has short versions.
    """
    rows = [_shown(row, record) for row in document["rows"]]
    if not document["quick"] and not SHORT.search(before):
        made = {case_of(row.id) for row in rows}
        rows += [row for row in _kept(before, record) if case_of(row.id) not in made]
        order = list(CASES)
        rows.sort(key=lambda row: order.index(case_of(row.id)) if case_of(row.id) else len(order))
    kind = "short versions" if document["quick"] else "full length"
    common = rows[0].origin if len({row.origin for row in rows}) == 1 else None
    lines = [HEAD]
    lines.append(f"{common}, {kind}.\n" if common else f"{kind.capitalize()}; revision and seed stand at each case.\n")
    groups: dict[str, list[Shown]] = {}
    for row in rows:
        groups.setdefault("/".join(row.id.split("/")[:2]), []).append(row)
    for name, group in groups.items():
        lines += [
            f"## {name}\n",
            *([] if common else _origins(group)),
            "| row | conditions | values (limit) | |",
            "|---|---|---|---|",
            *(row.line for row in group),
            "",
            *(f"{row.id}: {row.note}\n" for row in group if row.note),
        ]
    return "\n".join(lines).rstrip() + "\n"


def main(result: Path = RESULT) -> int:
    """Write the page, and the chart if its rows are there; without results the bands of the record alone are new."""
    document: dict[str, Any] = {"quick": False, "rows": []}
    if result.exists():
        document = json.loads(result.read_text(encoding="utf-8"))
    before = PAGE.read_text(encoding="utf-8") if PAGE.exists() else ""
    PAGE.write_text(page(document, read_record(), before), encoding="utf-8")
    print(f"written: {PAGE}")
    if chart := parameter_map(document["rows"]):
        save(chart, PARAMETER_MAP)
        print(f"written: {PARAMETER_MAP}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
