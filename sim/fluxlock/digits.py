# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Numbers as the pages and pictures print them."""

from __future__ import annotations

NO_BREAK = "\u00a0"


def thousands(value: float, gap: str = " ") -> str:
    """12345.6 as 12 346; gap: what stands between the groups, `NO_BREAK` in running text."""
    return f"{value:,.0f}".replace(",", gap)
