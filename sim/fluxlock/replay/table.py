# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A log as a CSV table: a head with names and units, a row a moment."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fluxlock.config import ConfigError, Problem

Floats = NDArray[np.float64]

SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6}
TURNS = {"r/min": 1.0, "rpm": 1.0, "1/s": 60.0, "rad/s": 30.0 / math.pi}
AMPERES = {"A": 1.0, "mA": 1e-3}
VOLTS = {"V": 1.0, "mV": 1e-3}
# Column: its names in a head, and the factors of its units.
COLUMNS: dict[str, tuple[tuple[str, ...], Mapping[str, float]]] = {
    "time": (("t", "time", "t_s"), SECONDS),
    "target": (("target", "demand", "target_rpm"), TURNS),
    "speed": (("speed", "measured_rpm", "speed_rpm"), TURNS),
    "vdc": (("vdc",), VOLTS),
    "idc": (("idc",), AMPERES),
    **{f"i{phase}": ((f"i{phase}",), AMPERES) for phase in "abc"},
    **{f"v{phase}": ((f"v{phase}",), VOLTS) for phase in "abc"},
}
NEEDED = ("time", "target", "speed", "vdc", "ia", "ib", "ic")
SUFFIXES = {"t_s": "s", "target_rpm": "rpm", "measured_rpm": "rpm", "speed_rpm": "rpm"}
LEAST_ROWS = 50
MOST_ROWS = 5_000_000


@dataclass(frozen=True)
class Table:
    """Columns in s, r/min, V and A, all of one length; `time` begins at 0 and rises."""

    columns: dict[str, Floats]

    def __getitem__(self, name: str) -> Floats:
        return self.columns[name]

    @property
    def has_voltages(self) -> bool:
        """Whether the terminals' voltages are there."""
        return all(f"v{phase}" in self.columns for phase in "abc")


def read_table(path: Path) -> Table:
    """Read a log; ConfigError with the line and what to do."""

    def wrong(place: str, text: str) -> ConfigError:
        return ConfigError([Problem(str(path), place, text)])

    try:
        with path.open(newline="", encoding="utf-8") as file:
            rows = list(csv.reader(line for line in file if not line.startswith("#")))
    except OSError as error:
        raise wrong("", f"cannot be read: {error.strerror}; name a CSV file") from None
    except (UnicodeDecodeError, csv.Error):
        raise wrong("", "is no CSV text; name a CSV file") from None
    if not rows:
        raise wrong("", "is empty; the first line names the columns with their units")
    places = head(path, rows[0])
    body = [row for row in rows[1:] if row]
    if not LEAST_ROWS <= len(body) <= MOST_ROWS:
        raise wrong("", f"has {len(body)} rows; a log has {LEAST_ROWS} to {MOST_ROWS}")
    columns: dict[str, Floats] = {name: np.zeros(len(body)) for name in places}
    for k, row in enumerate(body):
        for name, (place, factor) in places.items():
            try:
                value = float(row[place])
            except (IndexError, ValueError):
                found = row[place] if place < len(row) else ""
                raise wrong(f"row {k + 1}", f"{rows[0][place].strip()} is {found!r}, must be a number") from None
            if not math.isfinite(value):
                raise wrong(f"row {k + 1}", f"{rows[0][place].strip()} is {value}, must be finite")
            columns[name][k] = factor * value
    time = columns["time"]
    if not np.all(np.diff(time) > 0.0):
        k = int(np.flatnonzero(np.diff(time) <= 0.0)[0])
        raise wrong(f"row {k + 2}", "its time is not after that of the row before")
    time -= time[0]
    return Table(columns)


def head(path: Path, names: list[str]) -> dict[str, tuple[int, float]]:
    """Place and factor of each known column; others are left out. ConfigError."""
    found: dict[str, tuple[int, float]] = {}
    problems: list[Problem] = []
    known = {alias: column for column, (aliases, _) in COLUMNS.items() for alias in aliases}
    for place, text in enumerate(names):
        name, _, rest = text.strip().partition("[")
        name, unit = name.strip(), rest.rstrip("] ").strip()
        if name not in known:
            continue
        column = known[name]
        if column in found:
            continue  # the first one counts, in the order of the file
        unit = unit or SUFFIXES.get(name, "")
        units = COLUMNS[column][1]
        if unit not in units:
            text = f"unit is {unit or 'missing'}: write {name} [{next(iter(units))}], permitted: {', '.join(units)}"
            problems.append(Problem(str(path), f"column {name}", text))
            continue
        found[column] = (place, units[unit])
    missing = [name for name in NEEDED if name not in found and not problems]
    problems += [
        Problem(str(path), f"column {name}", f"is missing: {' or '.join(COLUMNS[name][0])}") for name in missing
    ]
    if problems:
        raise ConfigError(problems)
    return found
