# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Who is asked before a step of a first start and told what comes of it: a terminal here, a page in fluxlock.live."""

from __future__ import annotations

from contextlib import AbstractContextManager
from typing import Protocol

import typer
from rich.console import Console as Terminal

from fluxlock.base.stage import Progress
from fluxlock.commission.command import showing
from fluxlock.first_start.turn import Record


class ByHandError(RuntimeError):
    """The user has ended it amid a step."""


class Guide(Protocol):
    """What the steps need of a user. Each method may raise ByHandError."""

    def begin(self, number: int, step: str, limits: str) -> None:
        """A step, counted from 1, and what it does to the machine at most."""

    def ask(self, question: str) -> bool:
        """Whether the answer is yes."""

    def end(self, step: str, passed: bool, text: str) -> None:
        """What came of a step."""

    def progress(self) -> AbstractContextManager[Progress]:
        """Shows how far the measurement is."""

    def look(self, state: str, record: Record) -> None:
        """A look at a drive that turns; the last values of the record are those of this look."""


class TerminalGuide:
    """Questions at the terminal. asks: False: yes to all of them. of: steps in all."""

    def __init__(self, of: int, asks: bool) -> None:
        self._of, self._asks = of, asks

    def begin(self, number: int, step: str, limits: str) -> None:
        """See `Guide`."""
        Terminal(stderr=True).print(f"{number}/{self._of} {step}: {limits}", highlight=False, soft_wrap=True)

    def ask(self, question: str) -> bool:
        """See `Guide`. Raises ByHandError at the end of the input."""
        try:
            return not self._asks or typer.confirm(question, default=True, err=True)
        except typer.Abort:
            raise ByHandError from None

    def end(self, step: str, passed: bool, text: str) -> None:
        """See `Guide`; a failure is the verdict's."""
        if passed:
            print(f"{step}: {text}", flush=True)

    def progress(self) -> AbstractContextManager[Progress]:
        """See `Guide`."""
        return showing()

    def look(self, state: str, record: Record) -> None:
        """Nothing."""
