# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Parameter table of docs/reference/parameters.md from the schema: `python -m fluxlock.docs.parameters`."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from fluxlock.firmware.schema import load_schema, markdown_table
from fluxlock.paths import ROOT

PAGE = ROOT / "docs" / "reference" / "parameters.md"
MARKER = "<!-- From here on generated: python -m fluxlock.docs.parameters. -->\n"


def page_text(page: Path = PAGE) -> str:
    """The page with its generated part renewed."""
    head, marker, _ = page.read_text(encoding="utf-8").partition(MARKER)
    if not marker:
        raise ValueError(f"{page}: the line that starts the generated part is missing")
    return f"{head}{MARKER}\n{markdown_table(load_schema())}"


def main(arguments: list[str] | None = None) -> int:
    """Renew the page, or with `--check` only compare it; exit code 1 if it is out of date."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="fail if the page is out of date, write nothing")
    options = parser.parse_args(arguments)
    text = page_text()
    if PAGE.read_text(encoding="utf-8") == text:
        return 0
    if options.check:
        print(f"{PAGE}: out of date, run python -m fluxlock.docs.parameters", file=sys.stderr)
        return 1
    PAGE.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
