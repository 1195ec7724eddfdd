"""Table and chart of the regression for the docs: `python -m fluxlock.docs.regression` after `make regression`."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from fluxlock.analysis.six_step.plots import save
from fluxlock.docs.parameter_map import parameter_map
from fluxlock.paths import BUILD, ROOT
from fluxlock.regression.case import limit_text
from fluxlock.regression.origin import common_origin, origin_text
from fluxlock.regression.record import Record, band_text, read_record

PAGE = ROOT / "docs" / "verification" / "regression.md"
PARAMETER_MAP = ROOT / "docs" / "images" / "vector-parameters-chip.png"
RESULT = BUILD / "regression.json"

HEAD = """# Regression

Written by `python -m fluxlock.docs.regression` from `build/regression.json`, which `make regression` writes.
`make regression CASES=six-step/starts` runs the cases whose names begin so, `QUICK=1` a short version of each; runs
finished before with the same chip, firmware, scenario and plant are not repeated. Values in **bold** have a limit. In
brackets beside it stand the limit and the band about the last accepted value, of [`record.json`](record.json).
"""


def _value(name: str, row: dict[str, Any], record: Record) -> str:
    value, limit = row["values"][name], row["limit"].get(name)
    shown = "-" if value is None else f"{value:.4g}" if isinstance(value, float) else str(value)
    if limit is None:
        return f"{name} {shown}"
    told = limit_text(limit["min"], limit["max"])
    if limit["min"] != limit["max"]:
        entry = record.get(row["id"], {"values": {}})["values"].get(name)
        told += f"; {band_text(entry['band']) if entry else 'not recorded'}"
    return f"**{name} {shown}** ({told})"


def _origins(rows: list[dict[str, Any]]) -> list[str]:
    """Revision and seed of a case, of its rows where they differ."""
    if common := common_origin(rows):
        return [f"{common}.\n"]
    texts = dict.fromkeys(map(origin_text, rows))
    return [f"{text}: {', '.join(row['id'] for row in rows if origin_text(row) == text)}.\n" for text in texts]


def page(document: dict[str, Any], record: Record) -> str:
    """The page: a table a case, a line a row."""
    lines = [HEAD]
    kind = "short versions" if document["quick"] else "full length"
    common = common_origin(document["rows"])
    lines.append(f"{common}, {kind}.\n" if common else f"{kind.capitalize()}; revision and seed stand at each case.\n")
    groups: dict[str, list[dict[str, Any]]] = {}
    for row in document["rows"]:
        groups.setdefault("/".join(row["id"].split("/")[:2]), []).append(row)
    for name, rows in groups.items():
        lines += [
            f"## {name}\n",
            *([] if common else _origins(rows)),
            "| row | conditions | values (limit) | |",
            "|---|---|---|---|",
        ]
        for row in rows:
            conditions = ", ".join(f"{key} {value}" for key, value in row["conditions"].items())
            values = ", ".join(_value(key, row, record) for key in row["values"])
            lines.append(f"| {row['id']} | {conditions} | {values} | {'pass' if row['pass'] else '**miss**'} |")
        lines.append("")
        lines += [f"{row['id']}: {row['note']}\n" for row in rows if row["note"]]
    return "\n".join(lines).rstrip() + "\n"


def main(result: Path = RESULT) -> int:
    """Write the page, and the chart if its rows are there; exit code 1 without results."""
    if not result.exists():
        print(f"error: {result} is missing; run make regression", file=sys.stderr)
        return 1
    document = json.loads(result.read_text(encoding="utf-8"))
    PAGE.write_text(page(document, read_record()), encoding="utf-8")
    print(f"written: {PAGE}")
    if chart := parameter_map(document["rows"]):
        save(chart, PARAMETER_MAP)
        print(f"written: {PARAMETER_MAP}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
