# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The `fluxverify` command: what the tree is checked with beyond its tests. Exit codes: `fluxlock.command_line`."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from fluxlock.base.paths import needs_checkout
from fluxlock.command_line import EXIT_FAILED, SchedulerOption, SeedOption, no_scheduler, read_seed, run_command_line
from fluxlock.config import ConfigError, Problem
from fluxlock.help import example
from fluxlock.workers import on_scheduler

app = typer.Typer(
    help="Long sets, faults, figures and defects by which Fluxlock is verified; `make` calls the shorter checks.",
    epilog=example("fluxverify regression --list", "fluxverify figures six-step 2.11"),
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)


@app.command(epilog=example("fluxverify regression six-step --quick"))
def regression(
    cases: Annotated[list[str] | None, typer.Argument(help="Cases, or beginnings of their names; all without.")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="A short version of each, same limits.")] = False,
    list_: Annotated[bool, typer.Option("--list", help="Only list the cases.")] = False,
    jobs: Annotated[int, typer.Option(min=1, help="Cases run side by side.")] = os.cpu_count() or 1,
    scheduler: SchedulerOption = None,
    seed: SeedOption = None,
    record: Annotated[
        bool, typer.Option("--record", help="Run with many seeds; record means, scatters, bands.")
    ] = False,
    seeds: Annotated[int, typer.Option(min=5, help="With --record: seeds 1 to this.")] = 5,
    accept: Annotated[
        list[str] | None,
        typer.Option("--accept", metavar="ROW", help="Run nothing: record the last run's row, or rows that begin so."),
    ] = None,
    why: Annotated[str, typer.Option("--why", help="With --accept: the reason, which the record keeps.")] = "",
) -> None:
    """Run the long sets with their limits: build/regression.json.

    The command keeps finished runs and does not repeat them.
    A row fails when it misses a limit or leaves the bands of docs/verification/record.json.
    """
    needs_checkout("fluxverify regression")
    from fluxverify.regression.command import accept_rows, list_cases, record_regression, run_regression

    if (accept or record) and (quick or list_ or seed is not None or (accept and (record or cases))):
        text = "stand alone: full length, seeds of their own, one of them at a time"
        raise ConfigError([Problem("regression", "--accept, --record", text)])
    if why and not accept:
        raise ConfigError([Problem("regression", "--why", "belongs to --accept")])
    if list_ or accept:
        no_scheduler(scheduler, "--list" if list_ else "--accept")
    if list_:
        list_cases(cases or [])
        return
    if accept:
        accept_rows(accept, why)
        return
    with on_scheduler(scheduler):
        if record:
            right = record_regression(cases or [], seeds, jobs)
        else:
            right = run_regression(cases or [], quick, 1 if seed is None else seed, jobs)
    if not right:
        raise typer.Exit(EXIT_FAILED)


@app.command(epilog=example("fluxverify campaign six-step --quick"))
def campaign(
    drives: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="DRIVE",
            help="six-step, start, vector, five-phase, hall, encoder, can, board, board-vector, boot; all without.",
        ),
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="One moment a drive, a sixth of the faults.")] = False,
    every: Annotated[int, typer.Option(min=1, help="Only one run of so many.")] = 1,
    show: Annotated[bool, typer.Option("--show", help="Run nothing: the runs that have finished.")] = False,
    jobs: Annotated[int, typer.Option(min=1, help="Runs side by side.")] = os.cpu_count() or 1,
    scheduler: SchedulerOption = None,
    seed: Annotated[
        int | None, typer.Option(parser=read_seed, metavar="NUMBER", help="Seed of noise and upsets.")
    ] = None,
) -> None:
    """Put faults into plant, sensors and chip, judge how each run ends.

    The results go to build/campaign.json.
    Runs finished before with equal inputs are not repeated.
    `python -m fluxverify.campaign.page` makes the page of the documentation from it.
    """
    needs_checkout("fluxverify campaign")
    from fluxverify.campaign.command import run as run_campaign

    if show:
        no_scheduler(scheduler, "--show")
    with on_scheduler(scheduler):
        if not run_campaign(drives or [], quick, every, 1 if seed is None else seed, 0 if show else jobs):
            raise typer.Exit(EXIT_FAILED)


@app.command(epilog=example("fluxverify fuzz six-step --runs 2"))
def fuzz(
    drives: Annotated[
        list[str] | None, typer.Argument(metavar="DRIVE", help="six-step, vector, five-phase; all without.")
    ] = None,
    runs: Annotated[int, typer.Option(min=1, help="Runs a drive, each with a seed of its own.")] = 10,
    ms: Annotated[float, typer.Option(min=1.0, max=100.0, help="Length of a run, ms.")] = 10.0,
    jobs: Annotated[int, typer.Option(min=1, help="Runs side by side.")] = os.cpu_count() or 1,
    scheduler: SchedulerOption = None,
    seed: Annotated[
        int | None, typer.Option(parser=read_seed, metavar="NUMBER", help="Seed of noise and runs.")
    ] = None,
) -> None:
    """Write random registers while the machine runs: the gates must stay safe.

    Every access must be answered too.
    """
    needs_checkout("fluxverify fuzz")
    from fluxverify.campaign.fuzz import fuzz_drives

    with on_scheduler(scheduler):
        if not fuzz_drives(drives or [], 1 if seed is None else seed, runs, 1e-3 * ms, jobs):
            raise typer.Exit(EXIT_FAILED)


@app.command(epilog=example("fluxverify figures six-step 2.11"))
def figures(
    family: Annotated[
        str,
        typer.Argument(
            help="Whose: six-step (Yang 2020, chapters 2 to 6), blac (chapter 7), five-phase (Tian 2019, Yu 2022)."
        ),
    ],
    numbers: Annotated[
        list[str] | None,
        typer.Argument(metavar="FIGURE", help="Numbers (2.11, tian.4), chapters (2) or papers (yu); all without."),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder; PNG and figures.json go to FOLDER/FAMILY.")] = Path(
        "build/figures"
    ),
    quick: Annotated[
        bool,
        typer.Option(
            "--quick",
            help="Short runs, fewer points; what needs the chip's long runs is left out and the caption says so.",
        ),
    ] = False,
    list_: Annotated[bool, typer.Option("--list", help="Only list the figures.")] = False,
    jobs: Annotated[int, typer.Option(min=1, help="Figures drawn side by side.")] = os.cpu_count() or 1,
    scheduler: SchedulerOption = None,
    seed: SeedOption = None,
) -> None:
    """Draw a thesis's and two papers' figures from our own runs.

    Each has a table: printed, measured.
    Runs finished before with the same chip, firmware, scenario and plant are read, also those of the regression.
    `python -m fluxverify.docs.figures` makes the page of the documentation from what stands in build/figures.
    """
    needs_checkout("fluxverify figures")
    from fluxverify.figures.command import list_figures, run_figures

    if list_:
        no_scheduler(scheduler, "--list")
        list_figures(family, numbers or [])
        return
    with on_scheduler(scheduler):
        if not run_figures(family, numbers or [], out, quick, 1 if seed is None else seed, jobs):
            raise typer.Exit(EXIT_FAILED)


@app.command(epilog=example("fluxverify mutate fl_zcd --count 10"))
def mutate(
    blocks: Annotated[list[str] | None, typer.Argument(metavar="BLOCK", help="RTL blocks; all without.")] = None,
    count: Annotated[int, typer.Option(min=1, help="Mutants a block.")] = 300,
    seed: Annotated[
        int | None, typer.Option(parser=read_seed, metavar="NUMBER", help="Seed of choice and tests.")
    ] = None,
    jobs: Annotated[int, typer.Option(min=1, help="Mutants run side by side.")] = os.cpu_count() or 1,
    scheduler: SchedulerOption = None,
) -> None:
    """Put defects into RTL blocks, count how many the block tests find.

    The results go to build/mutate/BLOCK.json.
    A run that was stopped goes on from there if block, tests and seed are the same.

    `python -m fluxverify.docs.mutation` makes the page of the documentation from these files.
    """
    needs_checkout("fluxverify mutate")
    from fluxverify.mutation.command import mutate as run_mutate

    with on_scheduler(scheduler):
        if not run_mutate(blocks or [], count, 1 if seed is None else seed, jobs):
            raise typer.Exit(EXIT_FAILED)


def main() -> None:
    """Entry point."""
    run_command_line(app, "fluxverify")


if __name__ == "__main__":
    main()
