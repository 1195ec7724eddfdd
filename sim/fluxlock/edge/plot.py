# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Plots: commutation errors over the carrier, and what the dividers' filter does to them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from fluxlock.edge.advice import Budget, Choice
from fluxlock.results.pwm_phase import BINS, PhaseBins
from fluxlock.theory.six_step.plots import save


def draw_phases(bins: PhaseBins, path: Path, title: str) -> None:
    """Write a PNG: mean and rms of the errors in each part of the carrier, and how many they are."""
    figure = Figure(figsize=(9, 6), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    middle = (np.arange(BINS) + 0.5) / BINS
    upper.axhline(0.0, color="0.6", linewidth=0.8)
    upper.plot(middle, bins.mean_deg, "o-", markersize=4, label="mean")
    upper.plot(middle, bins.rms_deg, "s--", markersize=3, label="rms")
    upper.set_ylabel("commutation error about its mean / deg")
    upper.legend()
    upper.set_title(title)
    lower.bar(middle, bins.count, width=0.9 / BINS, color="0.6")
    lower.set_ylabel("commutations")
    lower.set_xlabel("place of the crossing in the carrier, from the beginning of a pulse")
    lower.set_xlim(0.0, 1.0)
    save(figure, path)


TERMS = (("noise", "noise_deg"), ("edges", "edges_deg"), ("lag", "lag_deg"), ("all three", "total_deg"))


def _worst(choice: Choice) -> Budget:
    return max(choice.budgets, key=lambda b: b.total_deg)


def advice_figure(title: str, now: Choice, best: Choice, runs: Sequence[Choice], over: Mapping[str, Choice]) -> Figure:
    """Error over the pole at the worst speed of each, and over the speed of the present and the advised pole.

    over: choices with many speeds, by name.
    """
    figure = Figure(figsize=(11, 5), layout="constrained")
    left, right = figure.subplots(1, 2)
    poles_us = [c.pole_s * 1e6 for c in runs]
    for label, key in TERMS:
        values = [getattr(_worst(c), key) for c in runs]
        left.loglog(poles_us, values, label=label, linewidth=2 if key == "total_deg" else 1)
    left.axvline(best.pole_s * 1e6, color="C2", linestyle=":", label="advised")
    if now.pole_s:
        left.axvline(now.pole_s * 1e6, color="0.5", linestyle="--", label="now")
    left.set_xlabel("pole of the dividers / us")
    left.set_ylabel("commutation error at the worst speed, rms / deg el.")
    total = [c.worst_deg for c in runs]
    left.set_ylim(max(min(total) / 300, 1e-5), 3 * max(total))
    for name, choice in over.items():
        speeds = [b.speed_rpm for b in choice.budgets]
        right.plot(speeds, [b.total_deg for b in choice.budgets], label=f"{name}, {choice.pole_s * 1e9:.0f} ns")
        right.plot(speeds, [b.dividers_deg for b in choice.budgets], ":", color="0.6", linewidth=1)
    right.plot([], [], ":", color="0.6", label="dividers, until learnt")
    right.set_xlabel("r/min")
    right.set_ylabel("commutation error, rms / deg el.")
    right.set_ylim(bottom=0.0)
    for axes in (left, right):
        axes.grid(True, alpha=0.3)
        axes.legend(fontsize=8)
    figure.suptitle(title)
    return figure
