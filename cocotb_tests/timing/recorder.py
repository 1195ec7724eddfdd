# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Signals of a block test, clock by clock, as a WaveDrom diagram that is compared with the committed one."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

import cocotb
from cocotb.triggers import RisingEdge

from fluxlock.paths import ROOT

FOLDER = ROOT / "docs" / "images" / "timing"
WRITE = "FLUXLOCK_WRITE_DIAGRAMS"  # in the environment: write the diagrams instead of comparing


def bits(values: list[int]) -> dict[str, Any]:
    """A line of one bit."""
    return {"wave": str(values[0]) + "".join("." if a == b else str(b) for a, b in pairwise(values))}


def words(values: list[int]) -> dict[str, Any]:
    """A line of numbers."""
    wave = "=" + "".join("." if a == b else "=" for a, b in pairwise(values))
    return {"wave": wave, "data": [str(values[0]), *(str(b) for a, b in pairwise(values) if a != b)]}


class Recorder:
    """Records lines at every rising edge, before it: column k of the diagram is what holds in clock k.

    lines: name on the diagram -> value; numbers: names of lines that are no single bits.
    """

    def __init__(self, clock: Any, lines: Mapping[str, Callable[[], int]], numbers: tuple[str, ...] = ()) -> None:
        self.lines, self.numbers = dict(lines), numbers
        self.values: dict[str, list[int]] = {name: [] for name in lines}
        self.task = cocotb.start_soon(self._run(clock))

    async def _run(self, clock: Any) -> None:
        while True:
            await RisingEdge(clock)
            for name, value in self.lines.items():
                self.values[name].append(value())

    def diagram(self, title: str) -> dict[str, Any]:
        """Stop, and return the diagram."""
        self.task.cancel()
        count = len(next(iter(self.values.values())))
        rows = [{"name": "clk_i", "wave": "p" + "." * (count - 1)}]
        for name, values in self.values.items():
            rows.append({"name": name, **(words if name in self.numbers else bits)(values)})
        return {"signal": rows, "head": {"text": title, "tick": 0}, "config": {"hscale": 1}}


def compare(name: str, diagram: dict[str, Any], folder: Path = FOLDER) -> None:
    """The committed diagram is that of the trace; with `WRITE` in the environment it becomes so."""
    path = folder / f"{name}.json"
    text = json.dumps(diagram, indent=1) + "\n"
    if os.environ.get(WRITE):
        path.write_text(text, encoding="utf-8")
    known = path.read_text(encoding="utf-8") if path.exists() else ""
    assert text == known, f"{path.relative_to(ROOT)} is not what the trace shows; make diagrams writes it"
