# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The table of `fluxlock motor info`: values with prefixes, what other machines have, the unusual marked."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path

from rich.console import Group
from rich.table import Table
from rich.text import Text

from fluxlock.base.paths import ROOT
from fluxlock.config import Motor, load_motor
from fluxlock.config.info import derived_values, warnings

PREFIXES = {-9: "n", -6: "µ", -3: "m", 0: "", 3: "k"}
# Units that take a prefix; the others, as r/min, are read better without.
PREFIXED = {"Ohm": "Ω", "H": "H", "V*s/rad": "V·s/rad", "N*m": "N·m", "N*m/A": "N·m/A", "s": "s", "V": "V", "A": "A"}
# Units as data sheets state them, and how many make one of the file's.
SHOWN = {"kg*m^2": ("g·cm²", 1e7), "V/(1000 r/min)": ("V per 1000 r/min", 1.0), "r/min/s": ("r/min per s", 1.0)}
MARK = "!"
ROOMY = 70


@dataclass(frozen=True)
class Row:
    """One line of the table: a value per phase, or one for all."""

    key: str
    label: str  # of a value in the file its key: what the user edits
    values: tuple[float, ...]
    unit: str


def scale(largest: float, unit: str) -> tuple[float, str]:
    """Factor and unit in which a person reads a value: 2.2e-05 H as 22 µH."""
    if unit not in PREFIXED:
        name, factor = SHOWN.get(unit, (unit, 1.0))
        return factor, name
    power = 3 * math.floor(math.log10(abs(largest)) / 3 + 1e-9) if largest else 0
    power = min(max(power, min(PREFIXES)), 0 if unit == "s" else max(PREFIXES))
    return 10.0**-power, PREFIXES[power] + PREFIXED[unit]


def number(value: float, digits: int = 4) -> str:
    """A number of so many significant digits, thousands apart."""
    if value == 0.0:
        return "0"
    above = math.floor(math.log10(abs(value)))
    if not -4 <= above < 8:
        return f"{value:.{digits}g}"
    text = f"{round(value, digits - 1 - above):,.{max(0, digits - 1 - above)}f}".replace(",", " ")
    return text.rstrip("0").rstrip(".") if "." in text else text


def rows(motor: Motor) -> tuple[list[Row], list[Row]]:
    """What the file says, and what follows from it."""
    stated = []
    for key, info in type(motor).model_fields.items():
        value, extra = getattr(motor, key), info.json_schema_extra
        if not isinstance(extra, dict) or value is None or (key == "flat_top_deg" and motor.emf != "trapezoidal"):
            continue
        stated.append(Row(key, key, value if isinstance(value, tuple) else (value,), str(extra["unit"])))
    return stated, [Row(d.key, d.label, (d.value,), d.unit) for d in derived_values(motor)]


def examples(folder: Path = ROOT / "motors") -> dict[str, tuple[float, float]]:
    """Smallest and largest of each value among the motor files of the checkout."""
    found: dict[str, list[float]] = {}
    for path in sorted(folder.glob("*.toml")):
        for part in rows(load_motor(path)):
            for row in part:
                found.setdefault(row.key, []).extend(row.values)
    return {key: (min(values), max(values)) for key, values in found.items()}


def cells(row: Row, ranges: dict[str, tuple[float, float]]) -> tuple[str, str, str]:
    """Value, unit and range of a row, all in one unit."""
    factor, unit = scale(max(row.values, key=abs) or max(ranges.get(row.key, (0.0,)), key=abs), row.unit)
    same = len(set(row.values)) == 1
    value = " / ".join(number(factor * v, 6 if row.label == row.key else 4) for v in row.values[: 1 if same else None])
    low, high = (number(factor * end, 3) for end in ranges.get(row.key, (row.values[0], row.values[0])))
    return value, unit, low if low == high else f"{low} … {high}"


def table(motor: Motor, ranges: dict[str, tuple[float, float]], width: int) -> Group:
    """Two tables below the motor's name; a value that a warning names is yellow and marked.

    Fewer than ROOMY columns have no room for the other machines.
    """
    doubtful = {key for line in warnings(motor) for key in re.findall(r"\w+", line.split(":")[0])}
    parts: list[Table | Text] = [Text(motor.name, style="bold")]
    if motor.description:
        parts.append(Text(motor.description))
    parts.append(Text(f"{motor.emf} EMF"))
    for title, part in zip(("in the file", "follows from it"), rows(motor), strict=True):
        grid = Table(box=None, padding=(0, 2, 0, 0), header_style="bold", pad_edge=False)
        grid.add_column(title, overflow="fold")
        grid.add_column("value", justify="right", no_wrap=True)
        grid.add_column("unit", overflow="fold")
        if width >= ROOMY:
            grid.add_column("in motors/", style="dim", no_wrap=True)
        for row in part:
            value, unit, usual = cells(row, ranges)
            odd = row.key in doubtful
            text = f"{value} {MARK}" if odd else value
            beside = [usual] if width >= ROOMY else []
            grid.add_row(row.label, text, unit, *beside, style="yellow" if odd else None)
        parts += [Text(""), grid]
    return Group(*parts)
