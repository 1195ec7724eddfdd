# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The record of the regression: for each row the last accepted values, and the bands that later runs must stay in.

A limit says what the drive must reach; it may be far from what it does reach. A band says what it did reach, so that a
change which makes a row twice as bad is seen although the limit holds. `docs/verification/record.json` holds per row
the revision and the seeds of the accepted run and why it was accepted, and per value the mean over the seeds, its
scatter (sample standard deviation over five seeds or more; null with fewer) and its band. A value outside of its band,
above or below, fails its row: what is suddenly much better is often no longer measured. Only full-length runs are
judged.

Bands, with v the accepted value and s the scatter:

- a magnitude (its limit has an upper end only, or its name says that it is an error's rms, largest value or deviation):
  v / 1.5 … 1.5 v; with a scatter v ± max(5 s, 1 %), but no further than that.
- any other value: v ± max(5 s, 1 %); without a scatter v ± half of its size. The size of a signed error is at least the
  rms of the same quantity, else a tenth of its limit ± x: a mean that scatters about zero has no size of its own.
- without limit and not named an error: recorded, not judged.

5 s: 99 % of single new values of a normal quantity lie within t(0.995, 4) √(1 + 1/5) = 5.04 s of the mean of five.
"""

from __future__ import annotations

import json
import math
import re
import statistics
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from fluxlock.base.paths import ROOT
from fluxlock.config import ConfigError, Problem

RECORD = ROOT / "docs" / "verification" / "record.json"
SCHEMA_VERSION = 1
LEAST_SEEDS = 5
FACTOR = 1.5
SIGMAS = 5.0
NARROW = 0.01  # relative: a value that is the same with all seeds may move so far
TINY = 1e-9  # rounding of floating point about zero

Number = float | int | None
Limit = tuple[float | None, float | None]
Band = tuple[float, float]
Entry = dict[str, Any]  # of a row: revision, seeds, why, values: name -> {value, scatter, band}
Record = dict[str, Entry]

ERROR = re.compile(r"error|deviation")
MAGNITUDE = re.compile(r"(^|[._])(rms|max|std|largest|standard|deviation)([._]|$)")


def is_magnitude(name: str, value: float, limit: Limit | None) -> bool:
    """Whether the value is the size of something that ought to be small."""
    if value < 0 or (limit is not None and limit[0] is not None):
        return False
    return limit is not None or MAGNITUDE.search(name) is not None


def band(name: str, value: float, scatter: float | None, limit: Limit | None, rms: float | None = None) -> Band | None:
    """The band of an accepted value; None if the value is not judged. rms: of the same quantity, if the row has it."""
    if limit is None and not ERROR.search(name):
        return None
    size = abs(value)
    reach = None if scatter is None else max(SIGMAS * scatter, NARROW * size)
    if is_magnitude(name, value, limit):
        low, high = size / FACTOR, size * FACTOR
        if reach is not None:
            low, high = max(low, size - reach), min(high, size + reach)
    else:
        if reach is None:
            floor = _symmetric(limit) / 10 if rms is None else 0.0
            reach = (FACTOR - 1) * max(size, rms or 0.0, floor)
        low, high = value - reach, value + reach
    return low - TINY, high + TINY


def _symmetric(limit: Limit | None) -> float:
    """The x of a limit ± x, else 0."""
    least, most = limit or (None, None)
    return most if most is not None and least is not None and math.isclose(-least, most, rel_tol=1e-4) else 0.0


def _limits(row: Mapping[str, Any]) -> dict[str, Limit]:
    return {name: (limit["min"], limit["max"]) for name, limit in row["limit"].items()}


def entry_of(
    row: Mapping[str, Any], revision: str | None, seeds: Mapping[int, Mapping[str, Number]], why: str
) -> Entry:
    """The entry of a row as `build/regression.json` has it. seeds: its values with each seed."""
    limits = _limits(row)
    means: dict[str, float | None] = {}
    scatters: dict[str, float | None] = {}
    for name in row["values"]:
        found = [values.get(name) for values in seeds.values()]
        numbers = [float(value) for value in found if value is not None]
        whole = len(numbers) == len(found)
        means[name] = statistics.fmean(numbers) if whole else None
        scatters[name] = statistics.stdev(numbers) if whole and len(numbers) >= LEAST_SEEDS else None
    values = {}
    for name, mean in means.items():
        rms = means.get(re.sub(r"\.mean$", ".rms", name)) if name.endswith(".mean") else None
        edges = None if mean is None else band(name, mean, scatters[name], limits.get(name), rms)
        values[name] = {
            "value": _rounded(mean),
            "scatter": _rounded(scatters[name]),
            "band": None if edges is None else [_rounded(edge) for edge in edges],
        }
    return {"revision": revision, "seeds": sorted(seeds), "why": why, "values": values}


def _rounded(number: float | None) -> Number:
    """Six significant digits; a whole number as such."""
    if number is None:
        return None
    short = float(f"{number:.6g}")
    return int(short) if short.is_integer() and abs(short) < 1e15 else short


def drift(row: Mapping[str, Any], record: Record) -> list[str]:
    """What of a row is not as recorded, a line each; none if all of it is within its bands."""
    entry = record.get(row["id"])
    if entry is None:
        return ["not in the record"]
    known = entry["values"]
    seeds = f"{len(entry['seeds'])} seeds" if len(entry["seeds"]) > 1 else "one seed"
    lines = [f"{name} is recorded but has gone" for name in known if name not in row["values"]]
    for name, value in row["values"].items():
        if name not in known:
            lines.append(f"{name} is not in the record")
            continue
        accepted, edges = known[name]["value"], known[name]["band"]
        if (value is None) != (accepted is None):
            lines.append(f"{name} = {_shown(value)}, recorded {_shown(accepted)}")
        elif value is not None and edges is not None and not edges[0] <= value <= edges[1]:
            lines.append(
                f"{name} = {_shown(value)} is outside of {edges[0]:.4g} … {edges[1]:.4g} about the recorded "
                f"{_shown(accepted)} ({seeds}, revision {str(entry['revision'])[:12]})"
            )
    return lines


def _shown(value: Number) -> str:
    return "no value" if value is None else f"{value:.4g}"


def judged(row: dict[str, Any], record: Record) -> dict[str, Any]:
    """The row with what has drifted; a row that has drifted does not pass."""
    lines = drift(row, record)
    return {**row, "drift": lines, "pass": row["pass"] and not lines}


def vanished(made: Iterable[str], cases: Sequence[str], record: Record, case_of: Callable[[str], str]) -> list[str]:
    """Rows of cases that have run which the record holds and which were not made."""
    found = set(made)
    return [row for row in record if row not in found and case_of(row) in cases]


def read_record(path: Path = RECORD) -> Record:
    """The rows of the record; ConfigError if the file is none."""
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
        if document["schema"] != SCHEMA_VERSION:
            raise ConfigError([Problem(str(path), "schema", f"is not {SCHEMA_VERSION}")])
        rows: Record = document["rows"]
        for row, entry in rows.items():
            for name, value in entry["values"].items():
                edges = value["band"]
                numbers = [value["value"], value["scatter"], *(edges or ())]
                if any(n is not None and not math.isfinite(n) for n in numbers) or len(edges or (0, 0)) != 2:
                    raise ConfigError([Problem(str(path), row, f"{name} is no number with a band")])
            if not entry["seeds"] or not str(entry["why"]).strip():
                raise ConfigError([Problem(str(path), row, "lacks seeds or why")])
    except OSError as error:
        raise ConfigError([Problem(str(path), "", f"cannot be read: {error.strerror}")]) from None
    except (ValueError, TypeError, KeyError, AttributeError):
        raise ConfigError([Problem(str(path), "", "is no record of the regression; git holds the last one")]) from None
    return rows


def write_record(rows: Record, path: Path = RECORD) -> None:
    """Write the record, rows in the order of their names, a line per value."""
    parts = []
    for row in sorted(rows):
        entry = rows[row]
        head = {key: entry[key] for key in ("revision", "seeds", "why")}
        values = ",\n".join(
            f"        {json.dumps(name)}: {json.dumps(value)}" for name, value in entry["values"].items()
        )
        lines = ",\n".join(
            f"      {json.dumps(key)}: {json.dumps(value, ensure_ascii=False)}" for key, value in head.items()
        )
        parts.append(f'    {json.dumps(row)}: {{\n{lines},\n      "values": {{\n{values}\n      }}\n    }}')
    body = ",\n".join(parts)
    path.write_text(f'{{\n  "schema": {SCHEMA_VERSION},\n  "rows": {{\n{body}\n  }}\n}}\n', encoding="utf-8")


def band_text(edges: Sequence[float] | None) -> str:
    """`0.34 … 0.77`; one number where both ends are one within rounding."""
    if edges is None:
        return "no band"
    low, high = (0.0 if abs(edge) <= TINY else edge for edge in edges)
    return f"{low:.3g}" if low == high else f"{low:.3g} … {high:.3g}"


def changes(old: Entry | None, new: Entry) -> str:
    """What an acceptance changes, in words."""
    if old is None:
        return "new row"
    before, after = old["values"], new["values"]
    told = []
    for name in dict.fromkeys([*before, *after]):
        if name not in after or name not in before:
            told.append(f"{name} {'has gone' if name not in after else 'is new'}")
        elif before[name]["value"] != after[name]["value"] and after[name]["band"] is not None:
            told.append(f"{name} {_shown(before[name]['value'])} → {_shown(after[name]['value'])}")
    return ", ".join(told) or "same values"
