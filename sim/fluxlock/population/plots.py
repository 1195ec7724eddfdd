# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""One life as a picture: speed and target, current over its limit, error of the angle."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from fluxlock.analysis.angles import dq_current
from fluxlock.analysis.metrics import Analysis
from fluxlock.analysis.plots import ANGLE_COLOUR, DPI, PHASE_COLOURS
from fluxlock.analysis.rundata import RunData
from fluxlock.config.motor import RPM_PER_RAD_S
from fluxlock.population.judge import Judgement
from fluxlock.population.life import Life

POINTS = 6000  # of a line: more than the picture has columns
REASONS = 4  # that the title names


def draw_life(data: RunData, life: Life, judgement: Judgement, path: Path) -> None:
    """Write the picture."""
    scenario, analysis = life.scenario, Analysis(data)
    figure = Figure(figsize=(11, 9), dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    speed, current, angle = figure.subplots(3, 1, sharex=True)
    part = slice(None, None, max(1, len(data.records) // POINTS))
    records = data.records[part]
    time_s = records["t_cycle"] / data.clock_hz
    speed.plot(time_s, records["omega_e"] / scenario.motor.pole_pairs * RPM_PER_RAD_S, color=PHASE_COLOURS[0], lw=0.8)
    states = data.states()
    speed.plot(states["t_s"], states["reference_rpm"], color="#888888", ls="--", lw=0.8, label="reference")
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
