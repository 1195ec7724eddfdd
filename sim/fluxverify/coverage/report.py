# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The report: numbers of RTL, C and Python by folder, by file, and what is not reached."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import PurePosixPath
from typing import Any

from fluxlock.sources import sources_text
from fluxverify.coverage.rtl import EXPLAINED

Numbers = Sequence[int]  # points and points reached, twice

HEAD = """# Coverage

Written by `make coverage`. RTL: counters of Verilator in the block tests (`cocotb_tests`), statements and branches
together; toggles are both directions of every bit of every signal. C: the firmware's sources in the libraries for the
host, counters of GCC, in the tests of `tests` without whole chips. Python: branches by coverage.py in the same tests;
what runs inside the simulator is not counted. What each test of a whole chip adds is in none of these numbers.
"""

RTL_COLUMNS = "| statements | reached / % | toggles | reached / % |"
SOFTWARE_COLUMNS = "| branches | taken / % | lines | reached / % |"


def by_folder(files: Mapping[str, Numbers], depth: int) -> dict[str, list[int]]:
    """Sums over the files below each folder of at most `depth` names, and over all."""
    sums: dict[str, list[int]] = {}
    for file, numbers in files.items():
        folder = "/".join(PurePosixPath(file).parts[:-1][:depth])
        for name in (folder, "all"):
            sums[name] = [a + b for a, b in zip(sums.get(name, [0] * 4), numbers, strict=True)]
    return {name: sums[name] for name in (*sorted(sums.keys() - {"all"}), *(["all"] if sums else []))}


def rtl_numbers(files: Mapping[str, Any]) -> dict[str, list[int]]:
    """Numbers of the RTL's files."""
    return {file: [*entry["statements"], *entry["toggles"]] for file, entry in files.items()}


def table(first: str, columns: str, rows: Mapping[str, Numbers]) -> list[str]:
    """Lines of a table; first: title of its first column."""

    def cells(total: int, reached: int) -> str:
        return f"{total} | {100.0 * reached / total:.1f}" if total else "0 | -"

    lines = [f"| {first} {columns}", "|" + "---|" * 5]
    return [*lines, *(f"| {name} | {cells(*n[:2])} | {cells(*n[2:])} |" for name, n in rows.items())]


def page(
    rtl: Mapping[str, Any],
    c: Mapping[str, Numbers],
    python: Mapping[str, Numbers],
    safety: Iterable[str],
    tested: Iterable[str],
    sources: Mapping[str, str] | None,
) -> str:
    """Numbers by folder, and why something in the safety blocks is not reached.

    tested: folders of the block tests that were run. sources: hashes of what they were run on.
    """
    lines = [
        HEAD,
        f"Made from {sources_text(sources)}.",
        "",
        "## RTL",
        "",
        f"Block tests of {', '.join(tested)}.",
        "",
        *table("folder", RTL_COLUMNS, by_folder(rtl_numbers(rtl), 2)),
    ]
    lines += [
        "",
        f"Not reached in {' and '.join(f'`{part}`' for part in EXPLAINED)}:",
        "",
        *(list(safety) or ["Nothing."]),
    ]
    lines += ["", "## C", "", *table("folder", SOFTWARE_COLUMNS, by_folder(c, 2))]
    lines += ["", "## Python", "", *table("package", SOFTWARE_COLUMNS, by_folder(python, 3))]
    return "\n".join(lines) + "\n"


def details(rtl: Mapping[str, Any], c: Mapping[str, Numbers], python: Mapping[str, Numbers]) -> str:
    """Every file, and the statements of the RTL that are not reached."""
    lines = ["", "## Files", "", *table("file", RTL_COLUMNS, rtl_numbers(rtl))]
    lines += ["", *table("file", SOFTWARE_COLUMNS, {**c, **python})]
    lines += ["", "## RTL not reached", ""]
    for file, entry in rtl.items():
        lines += [f"- {file}:{row['line']} ({row['what']}) `{row['code']}`" for row in entry["uncovered"]]
    return "\n".join(lines) + "\n"
