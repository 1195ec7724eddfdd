# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What a page can show: a twin that runs, or a recording. Both have the same few verbs."""

from __future__ import annotations

from typing import Any, Protocol

from fluxlock.live import messages
from fluxlock.live.traces import Floats, Marks

SLICE_S = 0.005  # simulated without a look at the clock
KEPT_S = 0.5  # simulated between two calls of `take`


class RefusedError(ValueError):
    """An action that the drive or the tools do not take; the text is for the page."""


class Source(Protocol):
    """said: what was done, and what the drive answered."""

    said: list[dict[str, Any]]

    @property
    def now(self) -> float:
        """Its time, s."""

    def hello(self) -> dict[str, Any]:
        """What a page draws itself from."""

    def advance(self, seconds: float, until: str = "end") -> bool:
        """So much of its time at most, a chip no further than to the next `until`: whether that came."""

    def act(self, action: messages.Action) -> None:
        """What a page asks for, now; RefusedError."""

    def take(self) -> tuple[Floats, Floats]:
        """Times and traces since the last call."""

    def marks(self) -> Marks:
        """Instants of what happened in these traces."""

    def status(self) -> dict[str, Any]:
        """The drive as it is."""

    def export(self, name: str) -> dict[str, str]:
        """Texts by file name of a scenario that repeats what was done; RefusedError."""
