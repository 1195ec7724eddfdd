# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Block diagrams from the RTL's hierarchy: `python -m fluxverify.docs.hierarchy [--check]`.

A module is a box, the modules that it contains are boxes in it, a colour is a folder of `rtl`. Written for a light and
for a dark page to `docs/images/blocks`.
"""

from __future__ import annotations

import re
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.sax.saxutils import escape

from fluxlock import generated
from fluxlock.base.paths import ROOT, RTL

FOLDER = ROOT / "docs" / "images" / "blocks"
DIAGRAMS = {"chip": "fl_soc", "six-step": "fl_six_step", "vector": "fl_vector", "safety": "fl_safety_wb"}
DEPTH = {"chip": 2}  # levels of boxes within the outer one; others: all
THEMES = {
    "light": {"text": "#1f2328", "line": "#57606a", "paper": "#ffffff", "lightness": "88%", "saturation": "55%"},
    "dark": {"text": "#e6edf3", "line": "#8b949e", "paper": "#14181e", "lightness": "24%", "saturation": "35%"},
}
HUES = {
    "sense": 200, "zcd": 140, "foc": 265, "encoder": 225, "injection": 320, "pwm": 45, "safety": 5, "can": 175,
    "soc": 215, "board": 30, "common": 215,
}  # fmt: skip
# Parts too small to explain anything.
SMALL = {"fl_sync", "fl_fifo", "fl_interval", "fl_mac", "fl_sqrt", "fl_ratio", "fl_ram", "fl_injection_mac"}

CHARACTER, LINE, GAP, WIDTH = 7.4, 18.0, 8.0, 860.0  # px
LINE_COMMENT = re.compile(r"//.*")
MODULE = re.compile(r"^module (fl_\w+)\b(.*?)^endmodule", re.DOTALL | re.MULTILINE)
PARENTHESES = re.compile(r"\([^()]*\)")
INSTANCE = re.compile(r"^\s*(fl_\w+)\s+(?:#\s*)?u_\w+\s*;", re.MULTILINE)  # without its parentheses


@dataclass(frozen=True)
class Module:
    """A module: folder of `rtl`, and what it contains, module -> number of instances in the source."""

    folder: str
    parts: dict[str, int]


def modules(rtl: Path = RTL) -> dict[str, Module]:
    """All modules of the RTL by name."""
    bodies = {}
    for path in sorted(rtl.rglob("fl_*.sv")):
        text = LINE_COMMENT.sub("", path.read_text(encoding="utf-8"))
        bodies.update({match[1]: (path.parent.name, match[2]) for match in MODULE.finditer(text)})
    found = {}
    for name, (folder, body) in bodies.items():
        while PARENTHESES.search(body):
            body = PARENTHESES.sub("", body)
        parts = Counter(part for part in INSTANCE.findall(body) if part in bodies)
        found[name] = Module(folder, dict(parts))
    return found


@dataclass(frozen=True)
class Box:
    """A box with its size in px and the boxes in it, each with its place."""

    label: str
    folder: str
    width: float
    height: float
    inner: tuple[tuple[float, float, Box], ...] = ()


def box(known: dict[str, Module], name: str, depth: int, count: int = 1, room: float = WIDTH) -> Box:
    """The box of a module; a wrapper of registers shows what it wraps."""
    module = known[name]
    if name.endswith("_wb") and len(module.parts) == 1:
        (part,) = module.parts
        return box(known, part, depth, count, room)
    label = name.removeprefix("fl_") + (f" ×{count}" if count > 1 else "")
    parts = {part: n for part, n in module.parts.items() if part not in SMALL} if depth else {}
    own = len(label) * CHARACTER + 2 * GAP
    if not parts:
        return Box(label, module.folder, own, LINE + GAP)
    inside = room - 2 * GAP
    children = [box(known, part, depth - 1, n, inside) for part, n in parts.items()]
    children.sort(key=lambda child: -child.height)
    placed, x, y, row, widest = [], GAP, LINE + GAP, 0.0, own
    for child in children:
        if x > GAP and x + child.width > inside + GAP:
            x, y, row = GAP, y + row + GAP, 0.0
        placed.append((x, y, child))
        x, row, widest = x + child.width + GAP, max(row, child.height), max(widest, x + child.width + GAP)
    return Box(label, module.folder, widest, y + row + GAP, tuple(placed))


def _draw(item: Box, x: float, y: float, theme: dict[str, str]) -> Iterator[str]:
    fill = f"hsl({HUES.get(item.folder, 215)} {theme['saturation']} {theme['lightness']})"
    paint = f'fill="{fill if not item.inner else theme["paper"]}" stroke="{theme["line"]}"'
    yield f'<rect x="{x:g}" y="{y:g}" width="{item.width:g}" height="{item.height:g}" rx="4" {paint}/>'
    if item.inner:
        band = f'width="{item.width:g}" height="{LINE + 2:g}" rx="4" fill="{fill}" stroke="{theme["line"]}"'
        yield f'<rect x="{x:g}" y="{y:g}" {band}/>'
    yield f'<text x="{x + GAP:g}" y="{y + LINE - 3:g}" fill="{theme["text"]}">{escape(item.label)}</text>'
    for dx, dy, child in item.inner:
        yield from _draw(child, x + dx, y + dy, theme)


def svg(item: Box, title: str, theme: dict[str, str]) -> str:
    """A diagram."""
    width, height = item.width + 2, item.height + 2
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {height:g}" width="{width:g}" '
    style = f'height="{height:g}" font-family="DejaVu Sans Mono, Menlo, monospace" font-size="12">'
    body = [f"<title>{escape(title)}</title>", *_draw(item, 1, 1, theme)]
    return "\n".join([head + style, *body, "</svg>"]) + "\n"


def diagrams(rtl: Path = RTL) -> dict[str, str]:
    """Text of every file."""
    known = modules(rtl)
    found = {}
    for name, top in DIAGRAMS.items():
        drawn = box(known, top, DEPTH.get(name, len(known)))
        for theme, colours in THEMES.items():
            found[f"{name}-{theme}.svg"] = svg(drawn, f"Modules in {top}", colours)
    return found


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the diagrams, or with `--check` only compare them."""
    return generated.command(
        arguments,
        "fluxverify.docs.hierarchy",
        __doc__,
        lambda: {FOLDER / name: text for name, text in diagrams().items()},
    )


if __name__ == "__main__":
    sys.exit(main())
