# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A host of the commissioning program that falls silent."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from typing import Any

PATIENCE_TICKS, SILENCE_LINES = 40, 60  # each of them takes the console more than 100 us


@dataclass
class FallsSilent:
    """Drives a voltage, then says nothing that the program knows; then goes on, first without `o`."""

    scale: str
    stage: str = "silence"
    share: float = 0.0

    def conversation(self) -> Generator[str, list[str], Any]:
        """The last lines of the replies before, and after the silence."""
        drive = "v 300 0 r 40 40"
        before = yield f"o t {PATIENCE_TICKS}"
        driven = yield f"{self.scale} {drive}"
        for _ in range(SILENCE_LINES):
            assert (yield "x")[-1] == "error: unknown command"
        forsaken = yield drive
        still = yield drive
        off = yield "o"
        again = yield drive
        return [reply[-1] for reply in (before, driven, forsaken, still, off, again)]
