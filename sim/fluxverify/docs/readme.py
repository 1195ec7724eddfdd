# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What the README shows and other files know: `python -m fluxverify.docs.readme` writes it, `--check` compares.

The table of chips takes size and speed from the page of the synthesis and angle errors from the record of the
regression. The badges take their words from `pyproject.toml`.
"""

from __future__ import annotations

import json
import sys
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from fluxlock import generated
from fluxlock.base.paths import ROOT
from fluxlock.base.writable import guarded
from fluxlock.digits import thousands
from fluxlock.synth.report import PAGE, markdown

README = ROOT / "README.md"
IMAGES = ROOT / "docs" / "images"
RECORD = ROOT / "docs" / "verification" / "record.json"
BEGIN, END = "<!-- chips begin -->", "<!-- chips end -->"
HEAD = ["configuration", "LUT4", "Fmax / MHz", "proved", "simulated error, rms"]
PROVED = "gate guard, trips, carrier"


@dataclass(frozen=True)
class Chip:
    """A row: the configuration of the synthesis, if there is one, and a row of the regression."""

    name: str
    configuration: str | None
    proved: str
    row: str
    value: str
    condition: str


CHIPS = (
    Chip(
        "six-step", "six-step", PROVED,
        "six-step/zcd-methods/motor-1-60000", "averaged.commutation_deg.rms", "of commutations, 60 000 r/min",
    ),
    Chip(
        "six-step, vector", "three-phase", PROVED,
        "vector/sequence/whole", "angle_error_deg.rms", "of the angle, up to 90 000 r/min",
    ),
    Chip(
        "six-step, vector, injection", "three-phase-injection", PROVED,
        "five-phase/ipm-steady/400rpm-10A", "angle_error_deg.rms", "of the angle, 400 r/min",
    ),
    Chip(
        "vector, injection, five phases, CAN", "five-phase", f"{PROVED} (of three legs), CAN",
        "five-phase/tian-best/100rpm-2A", "angle_error_deg.rms", "of the angle, 100 r/min",
    ),
)  # fmt: skip


def synthesized() -> dict[str, dict[str, str]]:
    """Rows of the synthesis page by configuration."""
    text = PAGE.read_text(encoding="utf-8").split("<!-- synth:begin -->")[1].split("<!-- synth:end -->")[0]
    head, _, *rows = ([cell.strip() for cell in line.split("|")[1:-1]] for line in text.strip().splitlines())
    return {row[0]: dict(zip(head, row, strict=True)) for row in rows}


def table() -> str:
    """The table of chips."""
    built, record = synthesized(), json.loads(RECORD.read_text(encoding="utf-8"))["rows"]
    rows = []
    for chip in CHIPS:
        row = built.get(chip.configuration or "", {})
        size = thousands(int(row["LUT4"])) if row else "not built yet"
        error = record[chip.row]["values"][chip.value]["value"]
        rows.append([chip.name, size, row.get("Fmax / MHz", "–"), chip.proved, f"{error:.2f}° {chip.condition}"])
    return markdown(HEAD, rows)


def with_table(text: str) -> str:
    """The README with that table."""
    before, rest = text.split(BEGIN)
    return f"{before}{BEGIN}\n{table()}\n{END}{rest.split(END)[1]}"


def badge(label: str, value: str) -> str:
    """A badge as an SVG: what, on grey, and its value."""
    left, right = (round(6.6 * len(text)) + 14 for text in (label, value))
    words = "".join(
        f'<text x="{x:g}" y="14" textLength="{width - 14}" lengthAdjust="spacingAndGlyphs">{text}</text>'
        for x, width, text in ((left / 2, left, label), (left + right / 2, right, value))
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{left + right}" height="20" role="img">'
        f"<title>{label}: {value}</title>"
        f'<rect width="{left + right}" height="20" rx="3" fill="#555"/>'
        f'<path d="M{left} 0h{right - 3}a3 3 0 0 1 3 3v14a3 3 0 0 1-3 3h-{right - 3}z" fill="#0969da"/>'
        f'<g fill="#fff" text-anchor="middle" font-family="DejaVu Sans, Verdana, sans-serif" font-size="11">{words}</g>'
        "</svg>\n"
    )


def badges() -> dict[Path, str]:
    """The badges by their files."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    words = {
        "licence": "Apache-2.0, RTL with SHL-2.1" if "SHL-2.1" in project["license"] else project["license"],
        "python": project["requires-python"].replace(">=", "") + " or newer",
        "platform": "Linux x86_64",
    }
    return {IMAGES / f"badge-{label}.svg": badge(label, value) for label, value in words.items()}


def main(arguments: Sequence[str] | None = None) -> int:
    """Write table and badges, or with `--check` only compare them."""
    return generated.command(
        arguments,
        "fluxverify.docs.readme",
        __doc__,
        lambda: {README: with_table(README.read_text(encoding="utf-8")), **badges()},
    )


if __name__ == "__main__":
    sys.exit(guarded(main))
