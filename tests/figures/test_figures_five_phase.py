# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The figures of five-phase injection: registry, what they draw and say, page."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest

from fluxlock.base.paths import ROOT
from fluxverify.figures.command import of_family, select
from fluxverify.figures.figure import Drawing
from fluxverify.figures.five_phase.support import wrapped_deg
from fluxverify.figures.panels import save_small
from fluxverify.regression.runner import Runner

# Issue: Tian's 3, 4, 7 to 13, Yu's 9 to 11, 13 to 17.
ASKED = [f"tian.{k}" for k in (3, 4, 7, 8, 9, 10, 11, 12, 13)] + [f"yu.{k}" for k in (9, 10, 11, 13, 14, 15, 16, 17)]
PAGE = ROOT / "docs" / "verification" / "figures-five-phase.md"
IMAGES = ROOT / "docs" / "images" / "five-phase"


def body(number: str) -> Drawing:
    (entry,) = (f for f in of_family("five-phase") if f.number == number)
    return entry.body(Runner(f"figures/five-phase/{number}", quick=True, seed=1, plots=False))


def test_registry() -> None:
    """All figures of both papers in the order of print, each with a title of one line; a paper selects its own.

    Verifies: FIG-01
    """
    found = of_family("five-phase")
    assert [f.number for f in found] == ASKED
    assert [f.number for f in select("five-phase", ["yu", "tian.4"])] == ["tian.4", *ASKED[9:]]
    assert all(len(f.title) > 10 and not f.title.endswith(".") for f in found)


@pytest.mark.parametrize("number", ["tian.3", "tian.4"])
def test_theory_says_what_it_is(number: str, tmp_path: Path) -> None:
    """A figure without a run of the chip says so; it is drawn small and has a table.

    Verifies: FIG-08
    """
    drawing = body(number)
    assert "No run of the chip" in drawing.condition and len(drawing.table) >= 2
    save_small(drawing.page, tmp_path / "a.png")
    assert 5_000 < (tmp_path / "a.png").stat().st_size < 60_000


def test_plant_models_are_the_machine() -> None:
    """At rest both parts with their gains add up to 1/(R + sL_d): the phases of tian.3 belong to that machine.

    Verifies: FIG-08
    """
    r_ohm, ld_h, lq_h, omega = 1.3, 6.54e-3, 8.32e-3, 100 / 30 * math.pi * 4
    s = 2j * math.pi * 257.5
    # Of the machine's equations: 1 / ((R + s L_d)(R + s L_q) + w^2 L_d L_q), s = j w_h.
    pole = (r_ohm + s * ld_h) * (r_ohm + s * lq_h) + omega**2 * ld_h * lq_h
    phases = [math.degrees(np.angle(value / pole)) for value in (1.0, s)]
    stated = [float(line.measured.split(",")[0]) for line in body("tian.3").table[:2]]
    assert stated == pytest.approx(phases, abs=0.06)


def test_angles_have_a_gap_where_they_wrap() -> None:
    """An angle through a turn, forward and back: no line across the panel.

    Verifies: FIG-08
    """
    for direction in (1.0, -1.0):
        found = wrapped_deg(np.radians(direction * np.arange(0.0, 720.0, 10.0)))
        steps = np.diff(found)
        assert np.isnan(found).sum() in (1, 2) and np.nanmax(np.abs(steps)) < 11.0


def test_documentation() -> None:
    """The page has every figure with its image, or names it as one that is not on the page.

    Verifies: FIG-04
    """
    text = PAGE.read_text()
    line = re.search(r"^Not on this page, the command draws them: (.*)\.$", text, re.MULTILINE)
    missing = line[1].split(", ") if line else []
    shown = [entry for entry in of_family("five-phase") if entry.number not in missing]
    assert set(missing) <= set(ASKED) and "tian.9" not in missing and "yu.10" not in missing
    for entry in shown:
        assert f"## Figure {entry.number}: {entry.title}\n" in text
        assert f"(../images/five-phase/{entry.stem}.png)" in text
        assert not re.search(rf"## Figure {re.escape(entry.number)}:[^#]*Not drawn", text)
    sizes = [path.stat().st_size for path in IMAGES.glob("fig-*.png")]
    assert len(sizes) == len(shown) and max(sizes) < 60_000
