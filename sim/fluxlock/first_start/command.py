# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Command `fluxlock first-start`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from fluxlock.base.paths import RESULTS
from fluxlock.command_line import EXIT_FAILED, SetOption
from fluxlock.config import ConfigError, Problem
from fluxlock.help import complete_toml
from fluxlock.results.verdict import say


def first_start(
    scenario: Annotated[
        Path,
        typer.Argument(
            help="Scenario file (TOML): machine, inverter and drive.", autocompletion=complete_toml("scenarios")
        ),
    ],
    port: Annotated[
        Path | None,
        typer.Option(
            help="Serial port of a board, for example /dev/ttyUSB0; without it a simulated bench, to practise."
        ),
    ] = None,
    current_share: Annotated[
        float, typer.Option(min=0.1, max=1.0, help="Limit of the current in the turns, over the rated one.")
    ] = 0.6,
    out: Annotated[
        Path | None, typer.Option(help="Folder of motor file, report and plots, default build/<scenario>-first-start.")
    ] = None,
    set_: SetOption = None,
    wait_s: Annotated[
        float, typer.Option(min=0.1, help="How long to wait for the loader before each program, s.")
    ] = 60.0,
    yes: Annotated[bool, typer.Option("--yes", help="Ask nothing: each step follows the one before it.")] = False,
) -> None:
    """Start a machine for the first time: wiring, measurement, first turn, step of the speed.

    Before each step the command says what it does to the machine at most, and asks. A step that fails ends it, with
    the gates off and one line that says why. On a board each step has its program, which the command writes into the
    flash once you reset the board. The last one stays: the scenario's drive, with the measured machine.
    """
    from fluxlock.cosim.cautions import checked
    from fluxlock.first_start.bench import bench_of, check_bench
    from fluxlock.first_start.guide import TerminalGuide
    from fluxlock.first_start.steps import STEPS, FirstStart

    loaded = checked(scenario, set_ or (), True)
    folder = out if out is not None else RESULTS / f"{scenario.stem}-first-start"
    check_bench(loaded, port)
    run = FirstStart(loaded, folder, current_share, TerminalGuide(len(STEPS), not yes))
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigError([Problem("--out", str(folder), f"cannot be written: {error.strerror}")]) from None
    verdict = run.run(bench_of(port, wait_s, folder))
    say(verdict)
    print(f"written: {folder}", flush=True)
    if not verdict.passed:
        raise typer.Exit(EXIT_FAILED)
