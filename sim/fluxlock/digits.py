# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Numbers as the pages and pictures print them."""

from __future__ import annotations

from collections.abc import Collection

NO_BREAK = "\u00a0"


def apart(value: float, limits: Collection[float]) -> str:
    """A value with four digits, all of a whole number, or as many more as show on which side of each limit it is."""

    def sides(number: float) -> list[int]:
        return [(number > limit) - (number < limit) for limit in limits]

    whole = len(f"{abs(value):.0f}")
    texts = (f"{value:.{digits}g}" for digits in range(max(4, whole if whole < 10 else 0), 17))
    return next((text for text in texts if sides(float(text)) == sides(value)), repr(value))


def thousands(value: float, gap: str = " ") -> str:
    """12345.6 as 12 346; gap: what stands between the groups, `NO_BREAK` in running text."""
    return f"{value:,.0f}".replace(",", gap)
