"""One figure from a run of the chip to its image."""

from __future__ import annotations

import json
import re
from pathlib import Path

from fluxlock.figures.command import run_figures


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
