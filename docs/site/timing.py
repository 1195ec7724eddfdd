# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Timing diagrams as SVG from the traces that block tests recorded: `python docs/site/timing.py`, `make diagrams`.

As an extension of Sphinx it refuses a site with a diagram that is not drawn from its trace.
"""

from __future__ import annotations

from pathlib import Path

import wavedrom
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError

FOLDER = Path(__file__).resolve().parents[1] / "images" / "timing"


def drawn(trace: Path) -> str:
    """A trace as SVG, on white: on a dark page without a style of its own black lines would not be seen."""
    drawing = wavedrom.render(trace.read_text(encoding="utf-8"))
    drawing["style"] = "background: #fff"
    return str(drawing.tostring()) + "\n"


def stale() -> list[str]:
    """Traces whose picture is missing or of another trace."""
    found = []
    for trace in sorted(FOLDER.glob("*.json")):
        picture = trace.with_suffix(".svg")
        if not picture.exists() or picture.read_text(encoding="utf-8") != drawn(trace):
            found.append(trace.name)
    return found


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the extension."""
    if names := stale():
        raise ExtensionError(f"{', '.join(names)}: not drawn from its trace; make diagrams")
    return {"parallel_read_safe": True, "parallel_write_safe": True}


if __name__ == "__main__":
    for trace in sorted(FOLDER.glob("*.json")):
        trace.with_suffix(".svg").write_text(drawn(trace), encoding="utf-8")
