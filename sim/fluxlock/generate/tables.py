# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Tables in the RTL that are computed, not typed: `python -m fluxlock.generate.tables` writes them."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path

from fluxlock.base.paths import RTL

SEGMENTS = 128  # of the argument 0..1
LAST = 125  # the last node; the arc sine's slope grows without bound beyond
ASIN_FILE = RTL / "zcd" / "fl_asin_pkg.sv"

# The head of a package: its licence, not this file's. REUSE-IgnoreStart
TOP = """// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

"""
# REUSE-IgnoreEnd

SINE_LINES = 512  # of a quarter turn
SINE_ONE = 1 << 22
SINE_FILE = RTL / "common" / "fl_sine_pkg.sv"


def asin_q16() -> list[int]:
    """Nodes of asin(i / SEGMENTS) in intervals of 60 degrees, Q16."""
    return [round(math.asin(i / SEGMENTS) / (math.pi / 3) * 65536) for i in range(LAST + 1)]


def asin_package() -> str:
    """Text of the package that holds the arc sine."""
    nodes = asin_q16()
    rises = [after - node for node, after in pairwise(nodes)] + [0]
    words = [f"29'h{node << 12 | rise:08x}" for node, rise in zip(nodes, rises, strict=True)]
    body = ",\n".join(f"    {', '.join(words[i : i + 8])}" for i in range(0, len(words), 8))
    return f"""{TOP}// Arc sine in intervals of 60 degrees, 2^16 = 1: lines from asin(i / {SEGMENTS}) / (pi / 3) to
// the next; the last has no rise.
// Written by `python -m fluxlock.generate.tables`; a test checks it.
package fl_asin_pkg;

  typedef struct packed {{
    logic [16:0] start;
    logic [11:0] rise;
  }} asin_line_t;

  localparam logic [6:0] AsinLast = 7'd{LAST};
  localparam logic [28:0] AsinLines[{LAST + 1}] = '{{
{body}
  }};

endpackage
"""


def sine_lines() -> list[tuple[int, int]]:
    """Start and rise of each straight line of a quarter sine, 2^22 = 1.

    The chord is shifted by half its sagitta, which halves its error; no line exceeds 2^22 - 1, the first starts at 0.
    """
    step = math.pi / 2 / SINE_LINES
    nodes = [SINE_ONE * math.sin(step * i) for i in range(SINE_LINES + 1)]
    lines = []
    for i in range(SINE_LINES):
        start = round(nodes[i] + SINE_ONE * step**2 / 16 * math.sin(step * (i + 0.5)))
        lines.append((start, min(round(nodes[i + 1] - nodes[i]), SINE_ONE - 1 - start)))
    return lines


def sine_package() -> str:
    """Text of the package that holds the quarter sine."""
    words = [f"36'h{start << 14 | rise:09x}" for start, rise in sine_lines()]
    body = ",\n".join(f"    {', '.join(words[i : i + 7])}" for i in range(0, len(words), 7))
    return f"""{TOP}// Quarter sine as {SINE_LINES} straight lines, 2^22 = 1: each chord shifted up by half its sagitta.
// Written by `python -m fluxlock.generate.tables`; a test checks it.
package fl_sine_pkg;

  typedef struct packed {{
    logic [21:0] start;
    logic [13:0] rise;
  }} sine_line_t;

  localparam logic [35:0] SineLines[{SINE_LINES}] = '{{
{body}
  }};

endpackage
"""


def main() -> None:
    """Write every table."""
    files: dict[Path, str] = {ASIN_FILE: asin_package(), SINE_FILE: sine_package()}
    for path, text in files.items():
        path.write_text(text)


if __name__ == "__main__":
    main()
