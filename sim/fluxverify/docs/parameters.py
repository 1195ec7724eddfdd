# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Parameter table of docs/reference/parameters.md from the schema: `python -m fluxverify.docs.parameters`."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from fluxlock import generated
from fluxlock.base.paths import ROOT
from fluxlock.firmware.schema import load_schema, markdown_table

PAGE = ROOT / "docs" / "reference" / "parameters.md"
MARKER = "<!-- From here on generated: python -m fluxverify.docs.parameters. -->\n"


def page_text(page: Path = PAGE) -> str:
    """The page with its generated part renewed."""
    head, marker, _ = page.read_text(encoding="utf-8").partition(MARKER)
    if not marker:
        raise ValueError(f"{page}: the line that starts the generated part is missing")
    return f"{head}{MARKER}\n{markdown_table(load_schema())}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Renew the page, or with `--check` only compare it."""
    return generated.command(arguments, "fluxverify.docs.parameters", __doc__, lambda: {PAGE: page_text()})


if __name__ == "__main__":
    sys.exit(main())
