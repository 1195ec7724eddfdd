"""Registry of figures: each is a function that runs scenarios or theory and returns a drawing with a table."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from matplotlib.figure import Figure

from fluxlock.regression.runner import Runner

FAMILIES = ("six-step", "blac", "five-phase")
# What prints a family's figures.
PRINTED = {"six-step": "thesis", "blac": "thesis", "five-phase": "paper"}


@dataclass(frozen=True)
class Entry:
    """One line of a figure's table: what was printed, what is measured here, and why they differ (or why not)."""

    quantity: str
    printed: str
    measured: str
    why: str = ""

    def as_json(self) -> dict[str, str]:
        """The entry as it is written."""
        return {"quantity": self.quantity, "printed": self.printed, "here": self.measured, "why": self.why}


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
