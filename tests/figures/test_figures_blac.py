# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The figures of vector control: registry, what they draw and say, page."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fluxlock.base.paths import ROOT
from fluxlock.theory.vector.model import coefficients
from fluxverify.figures.blac import support
from fluxverify.figures.command import of_family, select
from fluxverify.figures.figure import Drawing
from fluxverify.figures.panels import save_small
from fluxverify.regression.runner import Runner

ASKED = ["7.4", "7.5", "7.6", "7.7", "7.8", "7.9", "7.13", "7.14", "7.15"]
PAGE = ROOT / "docs" / "verification" / "figures-blac.md"
IMAGES = ROOT / "docs" / "images" / "blac"


def body(number: str) -> Drawing:
    (entry,) = (f for f in of_family("blac") if f.number == number)
    return entry.body(Runner(f"figures/blac/{number}", quick=True, seed=1, plots=False))


def test_registry() -> None:
    """All figures, in the thesis's order, each with a title of one line; the chapter selects them.

    Verifies: FIG-01
    """
    found = of_family("blac")
    assert [f.number for f in found] == ASKED and select("blac", ["7"]) == found
    assert all(len(f.title) > 10 and not f.title.endswith(".") for f in found)


@pytest.mark.parametrize("number", ASKED)
def test_says_what_it_is(number: str, tmp_path: Path) -> None:
    """A figure without a run of the chip says so; it is drawn small and has a table.

    Verifies: FIG-07
    """
    drawing = body(number)
    assert "no run of the chip" in drawing.condition and len(drawing.table) >= 2
    save_small(drawing.page, tmp_path / "a.png")
    assert 5_000 < (tmp_path / "a.png").stat().st_size < 60_000


def test_curves_of_the_steps() -> None:
    """Figure 7.9 draws the recurrence's currents: C at T_d = T_s is that of z^2 - z + gamma, and its q current is zero.

    Verifies: FIG-07
    """
    panels = body("7.9").page.axes
    by_controller = {line.get_label(): line.get_ydata() for line in panels[3].lines if line.get_label() in "ABC"}
    assert sorted(by_controller) == ["A", "B", "C"]
    expected = [0.0, 0.0]
    for _ in range(18):
        expected.append(expected[-1] - 0.35 * expected[-2] + 0.35)
    assert np.asarray(by_controller["C"]) == pytest.approx(np.array(expected), abs=1e-9)
    across = {line.get_label(): line.get_ydata() for line in panels[7].lines}
    assert np.abs(across["C"]).max() < 1e-12 < np.abs(across["A"]).max()


def test_crossing_of_the_zero() -> None:
    """The delay that figure 7.4 states is that at which |Gamma1| = |Gamma2|: half of the voltage's effect each.

    Verifies: FIG-07
    """
    stated = [float(part) for part in body("7.4").table[1].measured.split(", ")]
    machine = support.bench().machine
    decay = machine.r_ohm / machine.l_h / support.FS_HZ
    expected = 1 + np.log((1 + np.exp(-decay)) / 2) / decay
    assert stated == pytest.approx([expected] * 3, abs=1e-3)
    at = coefficients(machine, 9000.0, support.bench().sampling(expected))
    assert abs(at.gamma1) == pytest.approx(abs(at.gamma2), rel=1e-9)


@pytest.mark.parametrize("number", ["7.13", "7.15"])
def test_courses_end_at_the_closed_form(number: str) -> None:
    """Each course of the angle ends where its dotted line is.

    Verifies: FIG-07
    """
    for axes in body(number).page.axes[:2]:
        courses, levels = axes.lines[0::2], axes.lines[1::2]
        ends = [float(line.get_ydata()[-1]) for line in courses]
        assert ends == pytest.approx([float(line.get_ydata()[0]) for line in levels], abs=0.02)
        assert ends[0] > 4 and abs(ends[1]) < 1e-6 and ends[2] < -4


def test_documentation() -> None:
    """The page has every figure with its image.

    Verifies: FIG-04
    """
    text = PAGE.read_text()
    for entry in of_family("blac"):
        assert f"## Figure {entry.number}: {entry.title}\n" in text
        assert f"(../images/blac/{entry.stem}.png)" in text
    sizes = [path.stat().st_size for path in IMAGES.glob("fig-*.png")]
    assert len(sizes) == len(ASKED) and max(sizes) < 60_000
