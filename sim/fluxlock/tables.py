"""Tables in the RTL that are computed, not typed: `python -m fluxlock.tables` writes them."""

from __future__ import annotations

import math
from pathlib import Path

from fluxlock.paths import RTL

SEGMENTS = 128  # of the argument 0..1
LAST = 125  # the last node; the arc sine's slope grows without bound beyond
ASIN_FILE = RTL / "zcd" / "fl_asin_pkg.sv"


def asin_q16() -> list[int]:
    """Nodes of asin(i / SEGMENTS) in intervals of 60 degrees, Q16."""
    return [round(math.asin(i / SEGMENTS) / (math.pi / 3) * 65536) for i in range(LAST + 1)]


def asin_package() -> str:
    """Text of the package that holds the arc sine."""
    nodes = asin_q16()
    rows = [", ".join(f"17'd{n}" for n in nodes[i : i + 9]) for i in range(0, len(nodes), 9)]
    body = ",\n".join(f"    {row}" for row in rows)
    return f"""// Arc sine in intervals of 60 degrees: node i is round(asin(i / {SEGMENTS}) / (pi / 3) * 2^16).
// Written by `python -m fluxlock.tables`; a test checks it.
package fl_asin_pkg;

  localparam logic [6:0] AsinLast = 7'd{LAST};
  localparam logic [16:0] AsinQ16[{LAST + 1}] = '{{
{body}
  }};

endpackage
"""


def main() -> None:
    """Write every table."""
    path: Path = ASIN_FILE
    path.write_text(asin_package())


if __name__ == "__main__":
    main()
