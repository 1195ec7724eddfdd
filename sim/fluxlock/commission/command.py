# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""`fluxlock identify`: options, progress, table, files."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

from fluxlock.base.paths import RESULTS
from fluxlock.base.progress import Bars
from fluxlock.base.stage import Progress, ProgressInfo
from fluxlock.commission.board import measure_on_board
from fluxlock.commission.report import (
    Gain,
    Quantity,
    beside_the_file,
    figure,
    gains,
    motor_file,
    quantities,
    verdict,
    write_motor,
)
from fluxlock.commission.simulate import Measured, known_of, measure, plate_of
from fluxlock.config import ConfigError, Problem, Scenario
from fluxlock.results.verdict import say
from fluxlock.theory.six_step.plots import save


def _table(found: list[Quantity], reference: str) -> Table:
    table = Table(title="measured through the chip", title_justify="left")
    for header in ("quantity", "measured", reference, "error" if reference == "plant" else "off it", "unit"):
        table.add_column(header, justify="left" if header in ("quantity", "unit") else "right")
    for q in found:
        error = q.error_percent
        table.add_row(
            q.name,
            f"{q.measured * q.factor:.4g}",
            "-" if q.true is None else f"{q.true * q.factor:.4g}",
            "-" if error is None else f"{error:+.2f} %",
            q.unit,
        )
    return table


def _gain_table(found: list[Gain]) -> Table:
    table = Table(title="gains by bandwidth", title_justify="left")
    for header in ("gain", "value", "unit"):
        table.add_column(header, justify="right" if header == "value" else "left")
    for g in found:
        table.add_row(g.name, f"{g.value:.4g}", g.unit)
    return table


@dataclass(frozen=True)
class Board:
    """A real bench: its serial port, and how long to wait for its reset."""

    port: Path
    wait_s: float


def identify(
    bench: Scenario, out: Path, where: Board | int, current_hz: float, speed_hz: float, as_json: bool = False
) -> bool:
    """Measure, print, write OUT (motor file) and a PNG beside it; the simulator's files go to build/identify/NAME.

    where: a board, or the seed of a simulated bench. False: the measurement cannot be vouched for.
    """
    known_of(bench)  # refuses a bench before anything is written
    folder = RESULTS / "identify" / out.stem
    _check_writable(out, folder)
    measured = _measure(bench, folder, where)
    plate = plate_of(bench.motor)
    found = quantities(measured.values, bench.inverter.on_resistance_ohm, bench.motor)
    derived = gains(measured.values, plate, current_hz, speed_hz)
    if isinstance(where, Board):
        time_text, judged = f"{measured.duration_s:.2f} s", beside_the_file(found)
    else:
        time_text, judged = f"{measured.duration_s:.2f} s of chip time, seed {where}", verdict(found)
    origin = f"Measured by fluxlock identify with the inverter {bench.inverter.name}, {time_text}."
    write_motor(out, motor_file(measured.values, plate, bench.inverter, origin))
    save(figure(measured.values, f"{plate.name} on {bench.inverter.name}"), out.with_suffix(".png"))
    if as_json:
        print(json.dumps({"verdict": judged.as_json(), **_document(measured, found, derived, where)}, indent=2))
        say(judged, quiet=True)
        return judged.passed
    say(judged)
    console = Console()
    console.print(_table(found, "file" if isinstance(where, Board) else "plant"))
    console.print(_gain_table(derived))
    if not isinstance(where, Board):
        console.print(f"{measured.duration_s:.3f} s of chip time in {measured.wall_s:.0f} s", highlight=False)
    console.print(f"written: {out}, {out.with_suffix('.png').name}", highlight=False, soft_wrap=True)
    return judged.passed


def _check_writable(out: Path, folder: Path) -> None:
    """Find out now, not after the run, what cannot be written."""
    reason = "a folder is in the way" if out.is_dir() else ""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        out.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=out.parent):
            pass
    except OSError as error:
        reason = "a file is in the way" if isinstance(error, FileExistsError) else str(error.strerror)
    if reason:
        raise ConfigError([Problem("--out", str(out), f"cannot be written: {reason}; name another file")])


@contextmanager
def showing() -> Iterator[Progress]:
    """A bar of a measurement."""
    columns = (
        TextColumn("{task.description:<13}"),
        BarColumn(),
        TextColumn("{task.fields[t_s]:.3f} s {task.fields[speed]:>8.0f} r/min"),
        TimeElapsedColumn(),
    )
    with Bars(*columns) as bar:
        task = bar.add_task("build", total=1.0, t_s=0.0, speed=0.0)

        def show(info: ProgressInfo) -> None:
            part = info.t_s / info.duration_s if info.duration_s else 0.0
            bar.update(task, description=info.phase, completed=part, t_s=info.t_s, speed=info.speed_rpm)

        yield show


def _measure(bench: Scenario, folder: Path, where: Board | int) -> Measured:
    with showing() as show:
        if isinstance(where, Board):
            return measure_on_board(bench, where.port, where.wait_s, show)
        return measure(bench, folder, where, show)


def _document(measured: Measured, found: list[Quantity], derived: list[Gain], where: Board | int) -> dict[str, Any]:
    return {
        "port": str(where.port) if isinstance(where, Board) else None,
        "seed": None if isinstance(where, Board) else where,
        "duration_s": measured.duration_s,
        "measured": {k: v for k, v in measured.values.items() if k not in ("run", "lines")},
        "plant": {q.name: q.true for q in found},
        "error_percent": {q.name: q.error_percent for q in found},
        "gains": {g.name: {"value": g.value, "unit": g.unit} for g in derived},
    }
