# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Write the tables of docs/reference/console.md: `python -m fluxlock.interface`."""

from __future__ import annotations

import argparse
import sys

from fluxlock.interface.page import PAGE, page_text
from fluxlock.writable import guarded


def main(arguments: list[str] | None = None) -> int:
    """Renew the page, or with `--check` only compare it; exit code 1 if it is out of date."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="fail if the page is out of date, write nothing")
    options = parser.parse_args(arguments)
    text = page_text()
    if PAGE.read_text(encoding="utf-8") == text:
        return 0
    if options.check:
        print(f"{PAGE}: out of date, run python -m fluxlock.interface", file=sys.stderr)
        return 1
    PAGE.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(guarded(main))
