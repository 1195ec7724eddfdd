# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The command `fluxlock export`."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import typer
from rich.console import Console

from fluxlock.base.paths import ROOT
from fluxlock.base.progress import ProgressBar
from fluxlock.base.writable import check_folder
from fluxlock.clock import CLOCK_HZ
from fluxlock.command_line import SetOption
from fluxlock.config import ConfigError, Problem, load_scenario
from fluxlock.help import complete_toml

SCENARIO = ROOT / "scenarios" / "spinning.toml"
EXIT_FAILED = 1


def _boards(board: str | None) -> list[str]:
    from fluxlock.export.flows import BOARDS

    if board is not None and board not in BOARDS:
        raise ConfigError([Problem("--board", board, f"is no board; there are: {', '.join(BOARDS)}")])
    return [board] if board is not None else list(BOARDS)


def _check_empty(folder: Path) -> None:
    if folder.exists() and not folder.is_dir():
        raise ConfigError([Problem("DIR", str(folder), "is a file; name a folder")])
    if folder.is_dir() and any(folder.iterdir()):
        raise ConfigError([Problem("DIR", str(folder), "is not empty; name a new folder")])


@contextmanager
def _whole(folder: Path) -> Iterator[Path]:
    """A folder within it to fill, whose content moves up at the end; what breaks off leaves nothing behind."""
    try:
        check_folder(folder)
    except OSError as error:
        reason = f"cannot be written: {error.strerror}; name another folder"
        raise ConfigError([Problem("DIR", str(folder), reason)]) from None
    with TemporaryDirectory(prefix=".part-", dir=folder) as part:
        yield Path(part)
        for path in Path(part).iterdir():
            path.rename(folder / path.name)


def export(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder to write, new or empty.")],
    board: Annotated[str | None, typer.Option(help="One board alone: ulx3s, arty. Default all.")] = None,
    scenario: Annotated[
        Path,
        typer.Option(
            help="Its firmware and parameters are the RAM's contents, its run is recorded.",
            show_default="scenarios/spinning.toml",
            autocompletion=complete_toml("scenarios"),
        ),
    ] = SCENARIO,
    set_: SetOption = None,
    clocks: Annotated[
        int,
        typer.Option(
            min=1000, max=100_000_000, help="Longest recorded run, clocks of 20 ns; never beyond the scenario's end."
        ),
    ] = 1_000_000,
) -> None:
    """Write the RTL as a folder for a project of your own: no checkout, no Python.

    Sources with their lists, the core as one file, memory images, constraints, scripts of the tools, licences, and a
    test bench that replays a recorded run. The first run builds the chip's simulator, about two minutes.
    """
    from fluxlock.cosim.launch import SimulatorError
    from fluxlock.cosim.parameters import check_parameters
    from fluxlock.export import folder as folders
    from fluxlock.flash.command import check_board

    boards = _boards(board)
    _check_empty(folder)
    loaded = load_scenario(scenario, set_ or ())
    if board is not None:
        check_board(loaded)
    check_parameters(loaded)
    end_s = min(clocks / CLOCK_HZ, loaded.duration_s)
    try:
        with _whole(folder) as part, ProgressBar(Console(stderr=True), end_s) as progress:
            recording = folders.export(part, loaded, clocks, boards, progress)
    except (SimulatorError, RuntimeError) as error:
        print(f"failed: {error}", file=sys.stderr)
        raise typer.Exit(EXIT_FAILED) from None
    print(f"written: {folder}; recorded: {recording.clocks} clocks, {len(recording.gates)} changes of the gates")
