# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Registry of figures: each is a function that runs scenarios or theory and returns a drawing with a table."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal

from matplotlib.figure import Figure

from fluxverify.regression.runner import Runner

FAMILIES = ("six-step", "blac", "five-phase")
# What prints a family's figures.
PRINTED = {"six-step": "thesis", "blac": "thesis", "five-phase": "paper"}


# Who sets the speed in a row's run: the plant turns or holds the shaft as it is told, or the drive turns a free shaft.
Speed = Literal["imposed", "drive", "no run"]
NOT_PRINTED = ""
DRAWN = "Drawn without numbers that can be read"


class RowFault(Exception):
    """A row of a figure that does not say what it has to."""


@dataclass(frozen=True)
class Entry:
    """One line of a figure's table: what was printed, what is measured here, who sets the speed, why they differ.

    agrees: whether both are the same within what print and copy let one read (`near`, or a printed statement that was
    checked); None: nothing was printed, or what was printed cannot be compared. why: needed unless they agree or
    nothing was printed; it may say that the cause is not known. RowFault without what is needed.
    """

    quantity: str
    printed: str
    measured: str
    speed: Speed
    agrees: bool | None
    why: str = ""

    def __post_init__(self) -> None:
        """Refuse a row without its reason."""
        if self.printed == NOT_PRINTED and self.agrees is not None:
            raise RowFault(f"row {self.quantity!r}: nothing was printed, so that nothing agrees or differs")
        if self.printed != NOT_PRINTED and not self.agrees and not self.why:
            found = "differs from what was printed" if self.agrees is False else "is not compared with what was printed"
            raise RowFault(
                f"row {self.quantity!r}: {self.measured!r} {found} ({self.printed!r}), and no reason is given"
            )

    def as_json(self) -> dict[str, Any]:
        """The entry as it is written."""
        return {
            "quantity": self.quantity,
            "printed": self.printed,
            "here": self.measured,
            "speed": self.speed,
            "agrees": None if self.agrees is None else bool(self.agrees),  # numpy's is none of JSON
            "why": self.why,
        }


def near(printed: float, measured: float, reading: float) -> bool:
    """Whether a value is the printed one within what can be read: half of the last digit, or what a drawing gives."""
    return abs(measured - printed) <= reading * (1 + 1e-9)


def rises(values: Sequence[float]) -> bool:
    """Whether each value is larger than the one before."""
    return all(a < b for a, b in pairwise(values))


@dataclass(frozen=True)
class Drawing:
    """A drawn figure. condition: operating point and settings, a sentence; table: a line a printed statement."""

    condition: str
    page: Figure
    table: tuple[Entry, ...]


Body = Callable[[Runner], Drawing]


@dataclass(frozen=True)
class FigureEntry:
    """A registered figure: family, number in it, function; the docstring's first line is the title.

    number: parts with dots between; of several papers the first part is the paper's name.
    """

    family: str
    number: str
    body: Body

    @property
    def title(self) -> str:
        """First line of the docstring."""
        return (self.body.__doc__ or self.number).strip().splitlines()[0].rstrip(".")

    @property
    def stem(self) -> str:
        """Name of its files: `fig-2-11`."""
        return f"fig-{self.number.replace('.', '-')}"

    @property
    def order(self) -> tuple[tuple[int, str], ...]:
        """Chapter or paper, and number, for sorting."""
        return tuple((int(part), "") if part.isdigit() else (0, part) for part in self.number.split("."))

    def as_json(self, drawing: Drawing, image: str) -> dict[str, Any]:
        """The figure as it stands in `figures.json`."""
        return {
            "figure": self.number,
            "title": self.title,
            "condition": drawing.condition,
            "image": image,
            "table": [entry.as_json() for entry in drawing.table],
            "failure": "",
        }


FIGURES: dict[str, FigureEntry] = {}  # by `<family>/<number>`


def figure(family: str, number: str) -> Callable[[Body], Body]:
    """Register a figure under the number that it has in print."""

    def register(body: Body) -> Body:
        name = f"{family}/{number}"
        if family not in FAMILIES or name in FIGURES:
            raise ValueError(f"figure {name}: registered twice, or of no known family")
        FIGURES[name] = FigureEntry(family, number, body)
        return body

    return register
