# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Types of the words that settings and lists of names permit; a type checker sees strings.

A checked model refuses any other word, and its message lists these.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, TypeAlias

from fluxlock.interface.names import fault_names, words
from fluxlock.interface.settings import choices

if TYPE_CHECKING:
    Commutation: TypeAlias = str
    Pattern: TypeAlias = str
    Mode: TypeAlias = str
    HallMode: TypeAlias = str
    Method: TypeAlias = str
    TripCause: TypeAlias = str
    DriveFault: TypeAlias = str
else:
    Commutation, Pattern, Mode = (Literal[choices(name)] for name in ("commutation", "pattern", "mode"))
    HallMode, Method, TripCause = (Literal[words(name)] for name in ("hall_mode", "method", "trip"))
    DriveFault = Literal[fault_names()]
