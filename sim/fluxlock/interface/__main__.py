# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Write the tables of docs/reference/console.md: `python -m fluxlock.interface`."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from fluxlock import generated
from fluxlock.base.writable import guarded
from fluxlock.interface.page import PAGE, page_text


def main(arguments: Sequence[str] | None = None) -> int:
    """Renew the page, or with `--check` only compare it."""
    return generated.command(arguments, "fluxlock.interface", __doc__, lambda: {PAGE: page_text()})


if __name__ == "__main__":
    sys.exit(guarded(main))
