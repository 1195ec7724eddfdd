# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Signals of a block test, clock by clock, as a WaveDrom diagram that is compared with the committed one."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import cocotb
from cocotb.triggers import RisingEdge

from fluxlock.base.paths import ROOT

FOLDER = ROOT / "docs" / "images" / "timing"
WRITE = "FLUXLOCK_WRITE_DIAGRAMS"  # in the environment: write the diagrams instead of comparing
GAP = "|"  # in a wave: clocks that the diagram leaves out
CALM = 4  # clocks in which no line changes; more of them are one gap
Values = Sequence[int | str]


def bits(values: Values) -> dict[str, Any]:
    """A line of one bit."""
    return {"wave": str(values[0]) + "".join("." if a == b else str(b) for a, b in pairwise(values))}


def words(values: Values) -> dict[str, Any]:
    """A line of numbers or names."""
    wave = "=" + "".join("." if a == b else "=" for a, b in pairwise(values))
    return {"wave": wave, "data": [str(values[0]), *(str(b) for a, b in pairwise(values) if a != b)]}


def shown(lines: Sequence[Values]) -> list[int | None]:
    """Clocks that a diagram shows; None: a gap, for calm clocks between two that are beside a change.

    Of a calm at the beginning one clock is left, of one at the end two.
    """
    columns = list(zip(*lines, strict=True))
    changes = [k for k in range(1, len(columns)) if columns[k] != columns[k - 1]]
    spans = list(pairwise([0, *changes, len(columns)]))
    clocks: list[int | None] = []
    for start, end in spans:
        calm = range(start, end)
        if len(calm) <= CALM:
            clocks += calm
        elif start == 0:
            clocks.append(calm[-1])
        elif end == len(columns):
            clocks += calm[:2]
        else:
            clocks += [calm[0], None, calm[-1]]
    return clocks


def reader(handle: Any, mask: int = -1) -> Callable[[], int]:
    """What reads some bits of a signal."""
    return lambda: int(handle.value) & mask


class Recorder:
    """Records lines at every rising edge, before it: column k of the diagram is what holds in clock k.

    lines: name on the diagram -> value; numbers: names of lines that are no single bits.
    """

    def __init__(self, clock: Any, lines: Mapping[str, Callable[[], int | str]], numbers: Sequence[str] = ()) -> None:
        self.lines, self.numbers = dict(lines), numbers
        self.values: dict[str, list[int | str]] = {name: [] for name in lines}
        self.task = cocotb.start_soon(self._run(clock))

    async def _run(self, clock: Any) -> None:
        while True:
            await RisingEdge(clock)
            for name, value in self.lines.items():
                self.values[name].append(value())

    def takes(self, clocks: int, start: str, end: str, after: int = 0, to: int = 1) -> None:
        """Assert the time from the first clock with a line at 1, looked for from `after` on, until another is `to`."""
        first = self.values[start].index(1, after)
        values = self.values[end]
        got = next(k for k in range(max(1, first), len(values)) if values[k] == to != values[k - 1]) - first
        assert got == clocks, f"{start} to {end}: {got} clocks, not {clocks}"

    def diagram(self, title: str) -> dict[str, Any]:
        """Stop, and return the diagram. A long calm becomes a gap; the first row numbers the clocks."""
        self.task.cancel()
        clocks = shown(list(self.values.values()))

        def row(name: str, wave: dict[str, Any]) -> dict[str, Any]:
            left = iter(wave["wave"])
            return {"name": name, **wave, "wave": "".join(GAP if k is None else next(left) for k in clocks)}

        kept = [k for k in clocks if k is not None]
        rows = [row("clock", words([k - kept[0] for k in kept])), row("clk_i", {"wave": "p" + "." * (len(kept) - 1)})]
        for name, values in self.values.items():
            rows.append(row(name, (words if name in self.numbers else bits)([values[k] for k in kept])))
        return {"signal": rows, "head": {"text": title}, "config": {"hscale": 1}}


def compare(name: str, diagram: dict[str, Any], folder: Path = FOLDER) -> None:
    """The committed diagram is that of the trace; with `WRITE` in the environment it becomes so."""
    path = folder / f"{name}.json"
    text = json.dumps(diagram, indent=1) + "\n"
    if os.environ.get(WRITE):
        path.write_text(text, encoding="utf-8")
    known = path.read_text(encoding="utf-8") if path.exists() else ""
    assert text == known, f"{path.relative_to(ROOT)} is not what the trace shows; make diagrams writes it"
