# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Checks of parameters: a wrong one is named with its value and with what is permitted."""

from __future__ import annotations

import math


def require(condition: bool, key: str, value: object, permitted: str) -> None:
    """Raise a ValueError that names key, value and permitted range."""
    if not condition:
        raise ValueError(f"{key} = {value!r}: must be {permitted}")


def finite_at_least(low: float, *values: float) -> bool:
    """Whether all values are finite and not below a limit."""
    return all(math.isfinite(v) and v >= low for v in values)
