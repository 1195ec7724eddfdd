# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A page of figures as text: its sections, its tables, and what two pages differ by."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise

HEADING = re.compile(r"^## Figure (\S+): ", re.MULTILINE)
ORIGIN = re.compile(r"^(Revision \S+, seed .*?)(?:, (?:full length|short runs))?\.$", re.MULTILINE)
CELL = re.compile(r"(?<!\\)\|")
HERE = "here"  # heading of the column with our values


def sections(text: str) -> dict[str, str]:
    """Sections of a page by the figure's number, each with its own revision; the head is left out.

    A revision that stands in the head holds for all of them: it is written into each one, below its heading.
    """
    starts = [match.start() for match in HEADING.finditer(text)]
    head = text[: starts[0]] if starts else text
    common = ORIGIN.search(head)
    found = {}
    for begin, end in pairwise([*starts, len(text)]):
        section = text[begin:end].strip()
        if common and not ORIGIN.search(section):
            heading, _, rest = section.partition("\n")
            section = f"{heading}\n\n{common[1]}.\n{rest}"
        match = HEADING.match(section)
        assert match is not None
        found[match[1]] = section + "\n"
    return found


def values(section: str) -> dict[str, str]:
    """Our value by quantity, of the table of a section."""
    table = [_cells(line) for line in section.splitlines() if line.startswith("|")]
    if len(table) < 2 or HERE not in table[0]:
        return {}
    column = table[0].index(HERE)
    return {cells[0]: cells[column] for cells in table[2:] if len(cells) > column}


def _cells(line: str) -> list[str]:
    return [cell.strip().replace("\\|", "|") for cell in CELL.split(line.strip())[1:-1]]


@dataclass(frozen=True)
class Change:
    """A value of a figure that differs between two pages; None: not there."""

    figure: str
    quantity: str
    before: str | None
    now: str | None


def changes(before: str, now: str) -> Iterator[Change]:
    """All values in which two pages differ, in the order of the new page, then what is gone."""
    old, new = ({number: values(text) for number, text in sections(page).items()} for page in (before, now))
    for number in [*new, *(number for number in old if number not in new)]:
        was, has = old.get(number, {}), new.get(number, {})
        for quantity in [*has, *(quantity for quantity in was if quantity not in has)]:
            if was.get(quantity) != has.get(quantity):
                yield Change(number, quantity, was.get(quantity), has.get(quantity))


Causes = Mapping[str, object]


def cause(causes: Causes, change: Change) -> str | None:
    """Why a value changed: what is said of its quantity, else of its figure, else of all of the family; None: nothing.

    causes: of a family, `cause` and a table of each figure, in which `cause` holds for quantities not named.
    """
    own = causes.get(change.figure)
    found = [own.get(change.quantity), own.get("cause")] if isinstance(own, Mapping) else []
    return next((text for text in (*found, causes.get("cause")) if isinstance(text, str)), None)
