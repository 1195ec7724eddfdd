# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Scripts of the gallery: each draws a figure that can be read."""

from __future__ import annotations

import ast
import re
import runpy
from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest

from fluxlock.base.paths import ROOT
from fluxverify.docs import gallery, hierarchy

SCRIPTS = sorted((ROOT / "docs" / "gallery").glob("plot_*.py"))
MOST_LINES = 60
MIN_WORDS = 10  # characters of an image's alternative text


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda p: p.stem)
def test_script_draws(script: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A script of 60 lines at most draws lines with finite points, names both axes, and says for whom it is.

    Verifies: DOC-15
    """
    monkeypatch.setattr(plt, "show", lambda: None)
    mpl.use("agg")
    plt.close("all")
    source = script.read_text(encoding="utf-8")
    assert len(source.splitlines()) <= MOST_LINES
    text = ast.get_docstring(ast.parse(source))
    assert text is not None and text.split("\n\n")[1].startswith("For ")
    runpy.run_path(str(script))
    figures = [plt.figure(number) for number in plt.get_fignums()]
    assert figures
    for figure in figures:
        assert any(axes.get_xlabel() for axes in figure.axes) and any(axes.get_ylabel() for axes in figure.axes)
        for axes in figure.axes:
            points = [np.isfinite(np.asarray(line.get_ydata(), dtype=float)).any() for line in axes.lines]
            assert (points and all(points)) or axes.collections
    plt.close("all")


def test_every_image_has_its_command() -> None:
    """The page of the figures shows every image with the command that makes it, and is up to date.

    Verifies: DOC-15
    """
    assert gallery.main(["--check"]) == 0
    assert gallery.command_of("six-step/fig-2-10.png", "Figure 2.10: x") == "fluxverify figures six-step 2.10"
    assert gallery.command_of("unknown.png", "a picture") is None


@pytest.mark.parametrize("page", [Path("README.md"), *gallery.pages()], ids=Path.as_posix)
def test_images_have_words(page: Path) -> None:
    """Every image of a page has words that stand for it.

    Verifies: DOC-15
    """
    text = (ROOT / page).read_text(encoding="utf-8")
    without = [target for words, target in re.findall(r"!\[([^\]]*)\]\(([^)\s]+)\)", text) if len(words) < MIN_WORDS]
    without += [tag for tag in re.findall(r"<img\s[^>]*>", text) if not re.search(rf'alt="[^"]{{{MIN_WORDS},}}"', tag)]
    assert without == []


def test_block_diagrams() -> None:
    """The block diagrams are of this RTL, and show every module below the chip's that is no mere part.

    Verifies: DOC-14
    """
    assert hierarchy.main(["--check"]) == 0
    known = hierarchy.modules()
    assert known["fl_six_step"].parts == {f"fl_{name}_wb": 1 for name in ("zcd", "comm", "hall", "freewheel", "pwm")}
    drawn = hierarchy.diagrams()["chip-light.svg"]
    assert all(f">{name}<" in drawn for name in ("six_step", "vector", "gate_guard", "cpu", "can"))


def test_block_diagram_of_other_rtl(tmp_path: Path) -> None:
    """Parameters, arrays and comments are no instances; two of a kind are counted.

    Verifies: DOC-14
    """
    source = (
        "module fl_a (\n);\n  // fl_c u_no (\n  fl_b #(.X(f(g(1)))) u_one (\n  );\n  fl_b u_two (\n  );\nendmodule\n"
    )
    (tmp_path / "zcd").mkdir()
    (tmp_path / "zcd" / "fl_a.sv").write_text(source, encoding="utf-8")
    (tmp_path / "zcd" / "fl_b.sv").write_text("module fl_b ();\nendmodule\n", encoding="utf-8")
    known = hierarchy.modules(tmp_path)
    assert known["fl_a"].parts == {"fl_b": 2}
    assert hierarchy.box(known, "fl_a", 1).inner[0][2].label == "b ×2"
