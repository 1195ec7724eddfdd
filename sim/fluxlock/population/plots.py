# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""One life as a picture: speed and target, current over its limit, error of the angle."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from fluxlock.clock import CLOCK_HZ
from fluxlock.config.motor import RPM_PER_RAD_S
from fluxlock.population.injection_judge import judge_injection, row_of
from fluxlock.population.injection_life import InjectionLife, play_injection
from fluxlock.population.judge import Judgement, judge, play
from fluxlock.population.life import Life
from fluxlock.population.rest import RestFound, RestLife, judge_rest
from fluxlock.results.angles import dq_current
from fluxlock.results.metrics import Analysis
from fluxlock.results.plots import ANGLE_COLOUR, DPI, PHASE_COLOURS
from fluxlock.results.rundata import RunData
from fluxlock.results.verdict import RUNNING

POINTS = 6000  # of a line: more than the picture has columns
REASONS = 4  # that the title names


def judged(data: RunData, life: Life) -> Judgement | RestFound:
    """As the population does."""
    return judge_rest(data, life) if isinstance(life, RestLife) else judge(data, life)


def draw_life(life: Life, path: Path) -> list[str]:
    """Run a life and write its picture; kinds of what is wrong."""
    data = play(life)
    scenario, analysis, judgement = life.scenario, Analysis(data), judged(data, life)
    figure = Figure(figsize=(11, 9), dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    speed, current, angle = figure.subplots(3, 1, sharex=True)
    part = slice(None, None, max(1, len(data.records) // POINTS))
    records = data.records[part]
    time_s = records["t_cycle"] / data.clock_hz
    speed.plot(time_s, records["omega_e"] / scenario.motor.pole_pairs * RPM_PER_RAD_S, color=PHASE_COLOURS[0], lw=0.8)
    states = data.states()
    reference_rpm = states["reference_rpm"]
    if life.method == "six-step":  # a magnitude: of the way that the rotor turns, or is to
        turns = np.interp(states["t_s"], time_s, records["omega_e"])
        ways = np.where(states["state"] == RUNNING, turns, states["target_rpm"])
        reference_rpm = np.copysign(reference_rpm, ways)
    speed.plot(states["t_s"], reference_rpm, color="#888888", ls="--", lw=0.8, label="reference")
    speed.set_ylabel("speed, r/min")
    speed.legend(loc="upper right")
    dq = dq_current(records) / scenario.current_limit_a
    current.plot(time_s, dq.imag, color=PHASE_COLOURS[1], lw=0.6, label="i_q")
    current.plot(time_s, dq.real, color=PHASE_COLOURS[2], lw=0.6, label="i_d")
    current.set_ylabel("current over the limit")
    current.legend(loc="upper right")
    errors = analysis.angles if life.method == "vector" else analysis.commutations
    step = slice(None, None, max(1, len(errors.cycle) // POINTS))
    angle.plot(errors.cycle[step] / data.clock_hz, errors.error_deg[step], ".", ms=1, color=ANGLE_COLOUR)
    angle.set_ylabel("angle error, deg" if life.method == "vector" else "commutation error, deg")
    angle.set_xlabel("time, s")
    largest = np.percentile(np.abs(errors.error_deg), 99) if errors.error_deg.size else 1.0
    angle.set_ylim(-1.5 * largest - 1.0, 1.5 * largest + 1.0)
    for axes in (speed, current, angle):
        axes.grid(True, alpha=0.3)
        for hold in life.holds:
            axes.axvspan(hold.from_s, hold.to_s, color="#009E73", alpha=0.12)
    d = life.draw
    machine = (
        f"{scenario.motor.description}, R {d.resistance_pu:.3f}, L {d.inductance_pu:.3f}, L_q/L_d {d.saliency:.2f}"
    )
    reasons = [f"{reason.kind}: {reason.text}" for reason in judgement.reasons[:REASONS]] or ["right"]
    lines = [f"{life.method}, machine {d.index}: {machine}, {d.emf}, run-up {1e3 * d.run_up_s:.0f} ms", *reasons]
    figure.suptitle("\n".join(lines), fontsize=9)
    figure.savefig(path)
    return [reason.kind for reason in judgement.reasons]


def draw_injection(life: InjectionLife, path: Path) -> list[str]:
    """Run a start by injection and write its picture; kinds of what is wrong, or of the fault that ended it."""
    run = play_injection(life)
    reasons = row_of(judge_injection(run, life), run)["reasons"]
    figure = Figure(figsize=(11, 9), dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    speed, current, angle = figure.subplots(3, 1, sharex=True)
    rows = run.rows[:: max(1, len(run.rows) // POINTS)]
    time_s, motor = rows["t_cycle"] / CLOCK_HZ, life.machine
    speed.plot(time_s, rows["omega"] / motor.pole_pairs * RPM_PER_RAD_S, color=PHASE_COLOURS[0], lw=0.8, label="rotor")
    speed.plot(time_s, rows["rpm"], color=PHASE_COLOURS[2], lw=0.6, label="reported")
    speed.axhline(life.target_rpm, color="#888888", ls="--", lw=0.8, label="target")
    speed.set_ylabel("speed, r/min")
    for name, colour in (("i_q", PHASE_COLOURS[1]), ("i_d", PHASE_COLOURS[2])):
        current.plot(time_s, rows[name] / life.scenario.current_limit_a, color=colour, lw=0.6, label=name)
    current.set_ylabel("current over the limit")
    angle.plot(time_s, rows["error_deg"], ".", ms=1, color=ANGLE_COLOUR, label="while it runs")
    angle.set_ylabel("angle error, deg")
    angle.set_xlabel("time, s")
    for axes in (speed, current, angle):
        axes.grid(True, alpha=0.3)
        axes.legend(loc="upper right")
        axes.axvline(run.found_s, color="#009E73", alpha=0.4)
    d = life.draw
    begin = "blocked" if d.blocked else f"turning {100 * d.turning:.1f} %" if d.turning else "at rest"
    machine = f"{motor.description}, {d.phases} phases, L_q/L_d {d.saliency:.2f}, {begin}"
    over = ", ".join(f"{name} {value:.2f}" for name, value in asdict(d.over).items())
    texts = [f"{reason['kind']}: {reason['text']}" for reason in reasons[:REASONS]] or ["right"]
    figure.suptitle("\n".join((f"injection, machine {d.index}: {machine}", f"over file: {over}", *texts)), fontsize=9)
    figure.savefig(path)
    return [reason["kind"] for reason in reasons]
