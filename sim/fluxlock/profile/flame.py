# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A flame graph as SVG: a row per call, as wide as its share of the clocks. Also the folded text for other viewers."""

from __future__ import annotations

from collections.abc import Iterator
from xml.sax.saxutils import escape
from zlib import crc32

WIDTH, ROW, MARGIN, HEAD = 1200, 18, 10, 44  # pixels
CHARACTER = 6.6  # width of one, pixels
THINNEST = 0.3  # narrower boxes are left out
Stacks = dict[tuple[str, ...], int]


def folded(stacks: Stacks) -> str:
    """A line per context: names, outermost first, and clocks, as speedscope, inferno and flamegraph.pl take them."""
    return "".join(f"{';'.join(path)} {clocks}\n" for path, clocks in sorted(stacks.items()))


def flame_graph(stacks: Stacks, title: str) -> str:
    """The SVG; the pointer on a box shows name, clocks and share."""
    total = sum(stacks.values())
    boxes = list(_boxes(stacks, 0, 0.0, (WIDTH - 2 * MARGIN) / max(total, 1)))
    height = HEAD + MARGIN + ROW * (1 + max((depth for depth, *_ in boxes), default=0))
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" font-family="monospace"',
        ' font-size="11">',
        f'<rect width="{WIDTH}" height="{height}" fill="#ffffff"/>',
        f'<text x="{MARGIN}" y="20" font-size="15">{escape(title)}</text>',
        f'<text x="{MARGIN}" y="36" fill="#555555">{total} clocks; wider: more of them; below: called</text>',
    ]
    for depth, left, width, name, clocks in boxes:
        y = HEAD + ROW * depth
        room = int((width - 4) / CHARACTER)
        shown = name if len(name) <= room else name[: room - 1] + "…" if room > 3 else ""
        lines.append(
            f"<g><title>{escape(name)}: {clocks} clocks, {100 * clocks / total:.2f} %</title>"
            f'<rect x="{MARGIN + left:.2f}" y="{y}" width="{width:.2f}" height="{ROW - 1}" fill="{_colour(name)}"/>'
            f'<text x="{MARGIN + left + 3:.2f}" y="{y + 12}">{escape(shown)}</text></g>'
        )
    return "\n".join([*lines, "</svg>", ""])


def _boxes(stacks: Stacks, depth: int, left: float, scale: float) -> Iterator[tuple[int, float, float, str, int]]:
    """Depth, left edge, width, name and clocks of every call, the widest of one caller first."""
    groups: dict[str, Stacks] = {}
    for path, clocks in stacks.items():
        if path:
            groups.setdefault(path[0], {})[path[1:]] = clocks
    for name, inner in sorted(groups.items(), key=lambda item: (-sum(item[1].values()), item[0])):
        clocks = sum(inner.values())
        width = clocks * scale
        if width >= THINNEST:
            yield depth, left, width, name, clocks
            yield from _boxes(inner, depth + 1, left, scale)
        left += width


def _colour(name: str) -> str:
    """Warm, the same for a name everywhere."""
    value = crc32(name.encode())
    return f"#{225 + value % 30:02x}{140 + (value >> 8) % 90:02x}{80 + (value >> 16) % 60:02x}"
