# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What the six-step figures share: runs that begin at speed, with console commands on the way."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from fluxlock.base.paths import ROOT
from fluxlock.config import Motor, load_motor
from fluxlock.cosim.outcome import Run
from fluxlock.results.rundata import FloatArray
from fluxverify.figures.panels import trip_text
from fluxverify.regression.runner import RunFailed, Runner

FAMILY = "six-step"
MOTOR_1, MOTOR_2 = ROOT / "motors" / "motor-1.toml", ROOT / "motors" / "motor-2.toml"
# The rotor turns already: the drive catches it and is settled by this time.
SETTLED_S = 0.12
# The thesis times a crossing by one sample. The line between two comes nearest to that without its delay.
METHOD = "drive.zcd.method=interpolated"


def motor_1() -> Motor:
    """Motor-I as its file has it."""
    return load_motor(MOTOR_1)


def schedule(speed_rpm: float, *later: tuple[float, str, float | str]) -> str:
    """Override of the events: catch the rotor at speed_rpm, then (time in s, key, value)."""
    events: list[tuple[float, str, float | str]] = [
        (0.003, "speed_rpm", speed_rpm),
        (0.004, "command", "start"),
        *later,
    ]
    return "event=[" + ",".join(f"{{at_s={at_s:.6f},{key}={json.dumps(value)}}}" for at_s, key, value in events) + "]"


def at_speed(speed_rpm: float, *later: tuple[float, str, float | str]) -> tuple[str, str]:
    """Overrides for a run that begins at a speed, and its schedule."""
    return f"initial.speed_rpm={speed_rpm:g}", schedule(speed_rpm, *later)


def drive(runner: Runner, scenario: str, name: str, *overrides: str, accept: Mapping[str, str] | None = None) -> Run:
    """Run a scenario, or read it from before; RunFailed if a console line of the schedule was not carried out.

    Crossings are interpolated between two samples unless the overrides say otherwise. accept: see `Runner.drive`.
    """
    run = runner.drive(scenario, name, METHOD, *overrides, accept=accept)
    for line in run.result["rejected"]:
        raise RunFailed(f'{name}: "{line["line"]}" at {line["time_s"]:g} s: {line["reason"]}')
    return run


def whole(run: Run) -> Run:
    """The run itself; RunFailed if it tripped: then its spans hold nothing to measure."""
    if run.result["trips"]:
        raise RunFailed(f"{(run.folder or Path(run.scenario.name)).name}: {trip_text(run)}")
    return run


def mean_by_sector(run: Run, from_s: float, to_s: float) -> FloatArray:
    """Mean crossing error (deg) of sectors I to VI in a span."""
    part = run.analysis.crossings.between(from_s * run.data.clock_hz, to_s * run.data.clock_hz)
    return np.array([part.error_deg[part.sector == s].mean() for s in range(6)])


def numbers(values: Sequence[float] | FloatArray, decimals: int = 2, separator: str = " / ") -> str:
    """Values of one cell."""
    return separator.join(f"{value:.{decimals}f}" for value in values)
