# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Command `fluxlock prove`."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from fluxlock.base.paths import RESULTS
from fluxlock.base.progress import counting_bars
from fluxlock.command_line import SchedulerOption
from fluxlock.config import ConfigError, Problem, load_inverter, load_motor
from fluxlock.help import complete_toml
from fluxlock.interface.kinds import Method
from fluxlock.results.verdict import say
from fluxlock.theory.six_step.output import prepare_folder
from fluxlock.workers import on_scheduler

EXIT_FAILED = 1
FILES = ("prove.png", "prove.json")


def prove(
    motor: Annotated[Path, typer.Argument(help="Motor file (TOML).", autocompletion=complete_toml("motors"))],
    inverter: Annotated[Path, typer.Argument(help="Inverter file (TOML).", autocompletion=complete_toml("inverters"))],
    method: Annotated[Method, typer.Option(help="What drives the machine.")] = "vector",
    carrier_hz: Annotated[
        float | None, typer.Option(min=1e3, max=200e3, help="Carrier frequency, Hz; default by rule.")
    ] = None,
    step_deg: Annotated[int, typer.Option(min=1, max=120, help="Step of the rest angles, electrical degrees.")] = 10,
    out: Annotated[Path | None, typer.Option(help="Folder, default build/<name of the motor>-prove.")] = None,
    jobs: Annotated[int, typer.Option(min=1, help="Lives side by side.")] = os.cpu_count() or 1,
    scheduler: SchedulerOption = None,
) -> None:
    """Show what the drive holds on your machine, and by how much the file may be wrong: prove.png, prove.json.

    On the averaged twin, in about a minute. Starts from rest angles light and loaded; speeds, load steps, a sag of the
    supply and a reversal; each of R, L, flux and J off by 10 and 20 %. Exit code 1 if something does not hold with the
    file's own values.
    """
    from fluxlock.prove.cases import cases, find_high, least_rpm, run_cases
    from fluxlock.prove.life import Machine, fitting_carrier_hz
    from fluxlock.prove.page import Proof, draw, write_json

    loaded, stage = load_motor(motor), load_inverter(inverter)
    if loaded.phases != 3:
        raise ConfigError([Problem(str(motor), "phases", "the twin has three phases; `fluxlock run` has five")])
    folder = out if out is not None else RESULTS / f"{motor.stem}-prove"
    prepare_folder(folder, *FILES)
    machine = Machine(loaded, stage, method, carrier_hz or fitting_carrier_hz(loaded, stage.supply_v, method))
    machine = replace(machine, least_rpm=least_rpm(machine))
    todo = cases(step_deg)
    with counting_bars(Console(stderr=True)) as bars, on_scheduler(scheduler):
        task = bars.add_task("lives", total=len(todo) + 1)
        machine, nominal = find_high(machine)
        bars.advance(task)
        rows = run_cases(machine, todo, jobs, lambda: bars.advance(task))
    proof = Proof(machine, nominal, rows)
    verdict = proof.verdict()
    say(verdict)
    write_json(proof, folder / FILES[1])
    draw(proof, folder / FILES[0])
    print(f"written: {folder}/{', '.join(FILES)}")
    if not verdict.passed:
        raise typer.Exit(EXIT_FAILED)
