# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The block diagram of the README, light and dark: `python -m fluxverify.docs.diagram`."""

from __future__ import annotations

import sys
from dataclasses import dataclass

from fluxlock.base.paths import ROOT
from fluxlock.base.writable import guarded

IMAGES = ROOT / "docs" / "images"
WIDTH, HEIGHT = 800, 366


@dataclass(frozen=True)
class Theme:
    """Colours of one picture."""

    ink: str
    dim: str
    box: str
    line: str
    frame: str
    firmware: str


THEMES = {
    "light": Theme("#1f2328", "#59636e", "#ffffff", "#59636e", "#eef2f6", "#ddf4ff"),
    "dark": Theme("#e6edf3", "#9da7b3", "#0d1117", "#8b949e", "#1b222c", "#0c2d4a"),
}


@dataclass(frozen=True)
class Box:
    """A block: left, top, width, height, and its lines of text, the first in bold."""

    x: int
    y: int
    w: int
    h: int
    lines: tuple[str, ...]
    firmware: bool = False


CONVERTERS = Box(12, 92, 96, 64, ("converters", "one sample", "per 1 µs"))
BOXES = (
    CONVERTERS,
    Box(150, 92, 84, 64, ("sense", "time, state", "of samples")),
    Box(258, 48, 92, 52, ("zcd", "zero crossings")),
    Box(374, 48, 112, 52, ("commutation", "timer, carrier")),
    Box(510, 48, 84, 52, ("sequencer", "six steps")),
    Box(258, 116, 92, 52, ("foc", "regulators")),
    Box(374, 116, 112, 52, ("injection", "demodulators")),
    Box(510, 116, 84, 52, ("modulator", "3, 5 phases")),
    Box(258, 184, 336, 34, ("trip logic: over-current to gates off in 2 clocks",)),
    Box(618, 48, 56, 170, ("guard", "dead", "time")),
    Box(
        150, 262, 524, 52,
        ("RISC-V core, firmware in C", "start, speed, EMF observer, faults, console, CANopen"), True,
    ),
    Box(712, 48, 76, 72, ("inverter",)),
    Box(712, 146, 76, 72, ("motor", "load")),
)  # fmt: skip
# Paths of arrows, and where a text stands beside one.
ARROWS = (
    "M108 124H150",
    "M234 112H246V74H258",
    "M234 124H246V142H258",
    "M234 136H246V201H258",
    "M350 74H374",
    "M486 74H510",
    "M594 74H618",
    "M350 142H374",
    "M486 142H510",
    "M594 142H618",
    "M594 201H618",
    "M674 84H712",
    "M750 120V146",
    "M750 218V344H60V156",
    "M192 156V262",
    "M304 262V218",
    "M552 262V218",
)
NOTES = (
    (150, 38, "start", "FPGA: a gate edge never waits for the firmware"),
    (750, 38, "middle", "in simulation"),
    (200, 244, "start", "snapshots"),
    (428, 244, "middle", "settings, all at one update"),
    (405, 359, "middle", "terminal voltages, phase currents, DC link; the true rotor angle judges every run"),
)


def _text(x: float, y: float, text: str, colour: str, anchor: str = "middle", bold: bool = False) -> str:
    weight = ' font-weight="bold"' if bold else ""
    return f'<text x="{x:g}" y="{y:g}" fill="{colour}" text-anchor="{anchor}"{weight}>{text}</text>'


def svg(theme: Theme) -> str:
    """The picture."""
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" height="{HEIGHT}" '
        'font-family="DejaVu Sans, Verdana, Arial, sans-serif" font-size="12" fill="none" role="img">',
        "<title>Block diagram: converters, sense, six-step and vector path, trips, gate guard, firmware, motor</title>",
        f'<defs><marker id="head" viewBox="0 0 8 8" refX="8" refY="4" markerWidth="6" markerHeight="6" orient="auto">'
        f'<path d="M0 0L8 4L0 8z" fill="{theme.line}"/></marker></defs>',
        f'<rect x="136" y="16" width="552" height="312" rx="8" fill="{theme.frame}"/>',
    ]
    parts += [f'<path d="{path}" stroke="{theme.line}" stroke-width="1.5" marker-end="url(#head)"/>' for path in ARROWS]
    for box in BOXES:
        fill = theme.firmware if box.firmware else theme.box
        place = f'x="{box.x}" y="{box.y}" width="{box.w}" height="{box.h}" rx="5"'
        parts.append(f'<rect {place} fill="{fill}" stroke="{theme.line}"/>')
        first = box.y + box.h / 2 + 4.5 - 8 * (len(box.lines) - 1)
        for k, line in enumerate(box.lines):
            colour = theme.ink if k == 0 else theme.dim
            parts.append(_text(box.x + box.w / 2, first + 16 * k, line, colour, bold=k == 0 and len(box.lines) > 1))
    parts += [_text(x, y, text, theme.dim, anchor) for x, y, anchor, text in NOTES]
    return "\n".join([*parts, "</svg>", ""])


def main() -> None:
    """Write both pictures."""
    for name, theme in THEMES.items():
        (IMAGES / f"blocks-{name}.svg").write_text(svg(theme), encoding="utf-8")


if __name__ == "__main__":
    sys.exit(guarded(main))
