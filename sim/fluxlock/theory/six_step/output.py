# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What the commands share: option checks, progress bars, tables, PNG and JSON files."""

from __future__ import annotations

import errno
import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from fluxlock.base.progress import Bars
from fluxlock.base.writable import check_file, check_folder
from fluxlock.config import ConfigError, Problem

# Called with a description, returns a function to be called with the finished part, 0..1.
Begin = Callable[[str], Callable[[float], None]]


def _unwritable(path: Path, error: OSError) -> ConfigError:
    reason = "a file is in the way" if isinstance(error, FileExistsError) else error.strerror
    return ConfigError([Problem("--out", str(path), f"cannot be written: {reason}; name another folder")])


def prepare_folder(out: Path, *files: str) -> None:
    """Make the output folder and see that its files can be written, before anything takes time or is printed."""
    path = out
    try:
        check_folder(out)
        for path in (out / name for name in files):
            if path.is_dir():
                raise IsADirectoryError(errno.EISDIR, "a folder is in the way")
            check_file(path)
    except OSError as error:
        raise _unwritable(path, error) from None


def plain(value: Any) -> Any:  # noqa: ANN401 - any JSON value
    """Numbers as JSON has them: arrays as lists, complex as pairs, infinite and undefined values as null."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, complex):
        return [plain(value.real), plain(value.imag)]
    if isinstance(value, (np.floating, float)):
        return float(value) if math.isfinite(value) else None
    return value


def write_figure(out: Path, name: str, figure: Any, data: Mapping[str, Any]) -> None:  # noqa: ANN401 - matplotlib
    """Write NAME.png and NAME.json and say so."""
    from fluxlock.theory.six_step.plots import save

    text = json.dumps(plain(data), indent=1, allow_nan=False)
    try:
        save(figure, out / f"{name}.png")
        (out / f"{name}.json").write_text(text + "\n", encoding="utf-8")
    except OSError as error:
        raise _unwritable(out, error) from None
    Console().print(f"written: {out}/{name}.png, {name}.json", highlight=False)


@contextmanager
def progress_bars() -> Iterator[Begin]:
    """Progress bars on the error output."""
    bars = Bars(
        TextColumn("{task.description:<34}"),
        BarColumn(),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )

    def begin(description: str) -> Callable[[float], None]:
        task = bars.add_task(description, total=1.0)
        return lambda part: bars.update(task, completed=part)

    with bars:
        yield begin


def print_table(title: str, headers: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table of right-aligned cells."""
    table = Table(title=title, title_justify="left")
    for header in headers:
        table.add_column(header, justify="right")
    for row in rows:
        table.add_row(*row)
    Console().print(table)


def number(value: float, decimals: int = 1, missing: str = "-") -> str:
    """Cell of a number."""
    return f"{value:.{decimals}f}" if math.isfinite(value) else missing
