# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""One figure from a run of the chip to its image."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from fluxverify.figures.blac.controllers import draw_steps
from fluxverify.figures.blac.observer import SAMPLES, draw_sensorless
from fluxverify.figures.command import run_figures
from fluxverify.figures.five_phase.yu import separation
from fluxverify.regression.runner import Runner


def test_figure_from_a_run(tmp_path: Path) -> None:
    """Figure 2.10, short: a pulse holds as many samples as fit into it.

    Verifies: FIG-02, FIG-03
    """
    assert run_figures("six-step", ["2.10"], tmp_path, quick=True, seed=1, jobs=1)
    (part,) = json.loads((tmp_path / "six-step" / "figures.json").read_text())["figures"]
    assert (tmp_path / "six-step" / part["image"]).stat().st_size > 5_000
    (row,) = part["table"]
    found = re.fullmatch(r"(\d+) … (\d+), mean ([\d.]+); T_on/T_s = ([\d.]+), carrier ([\d.]+) µs", row["here"])
    assert found, row
    least, most, _, ratio, carrier_us = (float(value) for value in found.groups())
    assert least >= int(ratio) - 1 and most <= int(ratio) + 1 and carrier_us >= 25.0


def test_figure_of_steps_from_the_chip() -> None:
    """Figure 7.9 at T_d = T_s/2: the chip's points are where the exact model's lines are, within 3 % of the step.

    Verifies: FIG-07
    """
    drawing = draw_steps("7.9", 0.1, Runner("figures/blac/7.9", quick=True, seed=1, plots=False), (0.5,))
    assert "no run of the chip" not in drawing.condition
    for axes in drawing.page.axes[1], drawing.page.axes[5]:
        lines = [np.asarray(line.get_ydata()) for line in axes.lines if len(line.get_xdata()) > 2]
        exact, chip = lines[:3], lines[3:]
        assert len(chip) == 3
        for points, curve in zip(chip, exact, strict=True):
            assert points == pytest.approx(curve, abs=0.03)


def test_figure_of_the_observer_from_the_chip() -> None:
    """Figure 7.14 at 750 Hz: the chip's points lie on the closed form within 0.5 degrees for all three delays.

    Verifies: FIG-07
    """
    runner = Runner("figures/blac/7.14", quick=True, seed=1, plots=False)
    drawing = draw_sensorless("7.14", 0.5, runner, (0.05,), SAMPLES)
    assert "no run of the chip" not in drawing.condition
    levels = [line for line in drawing.page.axes[0].lines if line.get_linestyle() == ":"]
    points = [line for line in drawing.page.axes[0].lines if line.get_marker() == "o"]
    assert len(levels) == len(points) == 3
    for level, line in zip(levels, points, strict=True):
        assert float(np.mean(line.get_ydata())) == pytest.approx(float(level.get_ydata()[0]), abs=0.5)


def test_figure_of_the_separator_from_the_chip() -> None:
    """Figure 9 of Yu: the step leaves the HF amplitude alone, and the fundamental is the same without injection.

    Verifies: FIG-08
    """
    drawing = separation(Runner("figures/five-phase/yu.9", quick=True, seed=1, plots=False))
    left, right = drawing.page.axes
    assert all(float(np.abs(np.asarray(line.get_ydata())).max()) < 10.0 for line in left.lines)
    found, without = (np.asarray(line.get_ydata()) for line in right.lines)
    assert abs(found[0]) < 0.05 and found[-1] == pytest.approx(5.0, abs=0.05)
    count = min(found.size, without.size)
    assert found[:count] == pytest.approx(without[:count], abs=0.15)
