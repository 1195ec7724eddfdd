# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Plot of commutation errors over the carrier."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from fluxlock.analysis.pwm_phase import BINS, PhaseBins
from fluxlock.analysis.six_step.plots import save


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
