# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Oscilloscope record of one edge: `# key = value` lines, then a line of column names, then numbers.

Columns: `time_s`, `time_us` or `time_ns`, and `open_v` or `open_mv`, the open terminal. Keys: `sampling_hz`, which the
times must agree with; `edge`, `on` or `off`: whether a switch turns on or off there; `edge_at_s`, its time; `jump_v`,
by how much the terminal of the leg that switches jumps, with its sign; `pole_s` of what stands before the probe.
"""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

import numpy as np
import numpy.typing as npt

from fluxlock.config import ConfigError, Problem
from fluxlock.config.errors import did_you_mean

FloatArray = npt.NDArray[np.float64]
TIMES = {"time_s": 1.0, "time_us": 1e-6, "time_ns": 1e-9}
VOLTAGES = {"open_v": 1.0, "open_mv": 1e-3}
NUMBERS = ("sampling_hz", "edge_at_s", "jump_v", "pole_s")
KEYS = (*NUMBERS, "edge")
LEAST_SAMPLES = 100
SAMPLING_TOLERANCE = 0.01  # of the period: how uneven the times may be


@dataclass(frozen=True)
class ScopeRecord:
    """Voltage of the open terminal about one edge. time_s: from the edge on; volts: beside it, from 0 on."""

    time_s: FloatArray
    volts: FloatArray
    sampling_hz: float
    turns_off: bool
    jump_v: float
    pole_s: float


def _refuse(path: Path, where: str, text: str) -> NoReturn:
    raise ConfigError([Problem(str(path), where, text)])


def _keys(path: Path, lines: list[str]) -> dict[str, str]:
    """The `# key = value` lines."""
    found: dict[str, str] = {}
    for line in lines:
        key, equals, value = (part.strip() for part in line.lstrip("#").partition("="))
        if not equals:
            continue
        if key not in KEYS:
            _refuse(path, key, f"unknown key{did_you_mean(key, KEYS)}, permitted: {', '.join(KEYS)}")
        found[key] = value
    return found


def _number(path: Path, keys: dict[str, str], key: str, default: float | None = None) -> float:
    """A key's number; a key without default must be there."""
    if key not in keys:
        if default is not None:
            return default
        _refuse(path, key, f'is missing: a line "# {key} = ..." above the columns')
    try:
        value = float(keys[key])
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        _refuse(path, key, f'"{keys[key]}" is no number')
    return value


def _column(path: Path, names: list[str], permitted: dict[str, float]) -> tuple[int, float]:
    """Place and factor of the one column of a kind."""
    places = [k for k, name in enumerate(names) if name in permitted]
    if len(places) != 1:
        count = "no column" if not places else "more than one column"
        _refuse(path, "", f"has {count} {' or '.join(permitted)}; it has: {', '.join(names) or 'none'}")
    return places[0], permitted[names[places[0]]]


def _table(path: Path) -> tuple[dict[str, str], list[str], FloatArray]:
    """Keys, column names and numbers of a file."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except FileNotFoundError:
        _refuse(path, "", "file not found")
    except (OSError, UnicodeDecodeError) as error:
        _refuse(path, "", f"cannot be read ({error})")
    head = [line for line in lines if line.startswith("#")]
    rows = [row for row in csv.reader(line for line in lines if not line.startswith("#")) if row]
    names = [name.strip() for name in rows[0]] if rows else []
    numbers = []
    for count, row in enumerate(rows[1:], 1):
        try:
            values = [float(cell) for cell in row]
        except ValueError:
            values = []
        if len(values) != len(names) or not all(map(math.isfinite, values)):
            _refuse(path, f"row {count}", f"must be {len(names)} numbers, is {','.join(row)[:40]}")
        numbers.append(values)
    return _keys(path, head), names, np.array(numbers, dtype=np.float64).reshape(len(numbers), len(names))


def read_record(path: Path) -> ScopeRecord:
    """Read a record; ConfigError names what is wrong with it."""
    keys, names, table = _table(path)
    (time_at, to_s), (open_at, to_v) = _column(path, names, TIMES), _column(path, names, VOLTAGES)
    if len(table) < LEAST_SAMPLES:
        _refuse(path, "", f"has {len(table)} samples, at least {LEAST_SAMPLES} are needed")
    time_s, volts = table[:, time_at] * to_s, table[:, open_at] * to_v
    sampling_hz, edge_s = _number(path, keys, "sampling_hz"), _number(path, keys, "edge_at_s")
    jump_v, pole_s = _number(path, keys, "jump_v"), _number(path, keys, "pole_s", 0.0)
    if keys.get("edge") not in ("on", "off"):
        _refuse(path, "edge", f'must be "on" or "off", is {keys.get("edge", "missing")}')
    if sampling_hz <= 0 or jump_v == 0 or pole_s < 0:
        key = "sampling_hz" if sampling_hz <= 0 else "jump_v" if jump_v == 0 else "pole_s"
        _refuse(path, key, f"{keys[key]} is not permitted, permitted: {'not 0' if key == 'jump_v' else 'above 0'}")
    steps = np.diff(time_s) * sampling_hz
    if np.abs(steps - 1.0).max() > SAMPLING_TOLERANCE:
        worst = steps[np.abs(steps - 1.0).argmax()] / sampling_hz
        text = (
            f"{sampling_hz:g} Hz does not agree with the times: a step of {worst:.4g} s, expected {1 / sampling_hz:g} s"
        )
        _refuse(path, "sampling_hz", text)
    after = time_s >= edge_s
    if int(after.sum()) < LEAST_SAMPLES:
        _refuse(
            path, "edge_at_s", f"{edge_s:g} s leaves {int(after.sum())} samples behind the edge, needed {LEAST_SAMPLES}"
        )
    return ScopeRecord(time_s[after] - edge_s, volts[after], sampling_hz, keys["edge"] == "off", jump_v, pole_s)
