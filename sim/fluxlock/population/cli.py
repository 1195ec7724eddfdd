# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The commands `fluxlock population ...`."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from fluxlock.base.paths import needs_checkout
from fluxlock.command_line import SchedulerOption
from fluxlock.config import ConfigError, Problem
from fluxlock.config.scenario import SEED_MAX
from fluxlock.help import example
from fluxlock.population.draw import METHODS, POPULATIONS, Population
from fluxlock.workers import on_scheduler

app = typer.Typer(
    help="Random machines that nobody tuned for: draw them, run their lives on the host, judge them.",
    epilog=example(
        "fluxlock population run --method vector --lives 100", "fluxlock population draw 7 --out build/machine-7"
    ),
    no_args_is_help=True,
)

SeedOption = Annotated[int, typer.Option(min=0, max=SEED_MAX, help="Seed of the population.")]
RestOption = Annotated[
    bool, typer.Option("--rest", help="From rest at any angle, then reversed, in place of caught. Six-step and vector.")
]
MethodOption = Annotated[str, typer.Option(metavar="METHOD", help="six-step, vector or injection.")]


EXIT_FAILED = 1


@app.callback()
def _population() -> None:
    needs_checkout("fluxlock population")


def population_of(text: str) -> Population:
    """Value of `--method`."""
    for name in POPULATIONS:
        if name == text:
            return name
    raise ConfigError([Problem("--method", "", f'"{text}" is no method, permitted: {", ".join(POPULATIONS)}')])


def _resting(text: str, rest: bool) -> Population:
    """The same, with `--rest` or without."""
    found = population_of(text)
    if rest and found not in METHODS:
        raise ConfigError([Problem("--rest", "", f"goes with {' or '.join(METHODS)}; lives of {found} begin at rest")])
    return found


@app.command(
    epilog=example(
        "fluxlock population run --method vector --lives 100",
        "fluxlock population run --method six-step --rest --lives 100",
        "fluxlock population run --wirings 8 --lives 150",
    )
)
def run(
    method: Annotated[
        str | None, typer.Option(metavar="METHOD", help="six-step, vector or injection; all without.")
    ] = None,
    lives: Annotated[int, typer.Option(min=1, help="Machines.")] = 1000,
    first: Annotated[int, typer.Option(min=0, help="Number of the first one.")] = 0,
    seed: SeedOption = 1,
    jobs: Annotated[int, typer.Option(min=1, help="Lives side by side.")] = os.cpu_count() or 1,
    wirings: Annotated[
        int | None,
        typer.Option(
            min=0,
            max=47,
            help="In place of lives the test of the wiring: right, 5 orders of the dividers, so many of the 47 wrong "
            "orders and signs of current sensors on each machine. Vector control.",
        ),
    ] = None,
    rest: RestOption = False,
    scheduler: SchedulerOption = None,
) -> None:
    """Run the lives of machines on the host: right, refused by name, or wrong.

    The results go to build/population. Lives that ran before with equal inputs are not repeated. With --rest late locks
    and rotors that turn back by 60 to 210 degrees are counted, more is wrong. Exit code 1 if a life is wrong, with
    --wirings if a test is: a false alarm, a wiring not named, too long, too much current, a rotor that moves.
    """
    from fluxlock.population.command import run_population
    from fluxlock.population.run import SourcesChanged
    from fluxlock.population.wirings import run_wirings

    if wirings is not None:
        if rest:
            raise ConfigError([Problem("--rest", "", "does not go with --wirings")])
        if method not in (None, "vector"):
            raise ConfigError([Problem("--wirings", "", f"goes with --method vector, not {method}")])
        with on_scheduler(scheduler):
            good = run_wirings(seed, range(first, first + lives), wirings, jobs)
        if not good:
            raise typer.Exit(EXIT_FAILED)
        return
    every = METHODS if rest else POPULATIONS
    methods = every if method is None else (_resting(method, rest),)
    try:
        with on_scheduler(scheduler):
            good = run_population(methods, seed, range(first, first + lives), jobs, rest)
    except SourcesChanged as error:
        raise ConfigError([Problem("population", "", str(error))]) from None
    if not good:
        raise typer.Exit(EXIT_FAILED)


@app.command(epilog=example("fluxlock population draw 7 --method vector --out build/machine-7"))
def draw(
    index: Annotated[int, typer.Argument(min=0, help="Number of the machine.")],
    out: Annotated[Path, typer.Option(help="Folder for scenario.toml, motor.toml and inverter.toml.")],
    method: MethodOption = "vector",
    seed: SeedOption = 1,
    rest: RestOption = False,
) -> None:
    """Write the files of one machine: `fluxlock run` takes them.

    With injection also machine.toml, the machine that differs from its motor file.
    """
    from fluxlock.population.files import write_life
    from fluxlock.population.run import any_life

    life, reasons = any_life(_resting(method, rest), seed, index, rest)
    path = write_life(life, out)
    for reason in reasons:
        print(f"refused: {reason}")
    print(f"written: {path}")


@app.command(epilog=example("fluxlock population plot 7 12 --method vector"))
def plot(
    indices: Annotated[list[int], typer.Argument(min=0, help="Numbers of the machines.")],
    method: MethodOption = "vector",
    out: Annotated[Path, typer.Option(help="Folder for the pictures.")] = Path("build/population/plots"),
    seed: SeedOption = 1,
    rest: RestOption = False,
) -> None:
    """Run lives anew and draw speed, current and angle error of each: PNG."""
    from fluxlock.base.writable import check_file
    from fluxlock.population.injection_life import InjectionLife
    from fluxlock.population.plots import draw_injection, draw_life
    from fluxlock.population.run import any_life

    name = _resting(method, rest)
    for index in indices:
        life, _ = any_life(name, seed, index, rest)
        path = out / f"{name}{'-rest' if rest else ''}-{life.draw.name}.png"
        check_file(path)
        drawn = draw_injection(life, path) if isinstance(life, InjectionLife) else draw_life(life, path)
        kinds = ", ".join(dict.fromkeys(drawn)) or "right"
        print(f"{index}: {kinds}; written: {path}")


@app.command(epilog=example("fluxlock population jumps"))
def jumps(seed: SeedOption = 1) -> None:
    """Let the rotor's angle jump under injected drives: followed, named within 50 ms, or wrong.

    Ten machines of the injection's population, jumps of 60, 120 and 180 degrees at 0, 5 and 20 % of base speed; about
    two minutes. Exit code 1 if a jump is wrong.
    """
    from fluxlock.base.progress import counting_bars
    from fluxlock.population.jumps import OUTCOMES, WRONG, Jump, jump_machines, run_jumps
    from fluxlock.results.verdict import Verdict, say

    with counting_bars() as bars:
        task = bars.add_task("jumps", total=None)

        def done(_: Jump) -> None:
            bars.advance(task)

        found = run_jumps(jump_machines(seed), done)
    wrong = [j for j in found if j.outcome == WRONG]
    counts = ", ".join(f"{sum(j.outcome == name for j in found)} {name}" for name in OUTCOMES)
    say(Verdict(not wrong, [f"{counts} of {len(found)} jumps", *map(str, wrong)]))
    if wrong:
        raise typer.Exit(EXIT_FAILED)
