# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Errors of input files: every problem names its file and key."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from dataclasses import dataclass

SET_OPTION = "--set"


@dataclass(frozen=True)
class Problem:
    """One thing wrong with the input. `key` is dotted, empty where the whole file is meant."""

    file: str
    key: str
    message: str

    def __str__(self) -> str:
        return ": ".join(part for part in (self.file, self.key, self.message) if part)


class ConfigError(Exception):
    """All problems found in the input of one command.

    problems: each with its file, its key and a message; the text has a line for each.

    >>> from fluxlock import load_motor
    >>> try:
    ...     load_motor("my-motor.toml")
    ... except ConfigError as error:
    ...     print(error)
    my-motor.toml: file not found
    """

    def __init__(self, problems: Iterable[Problem]) -> None:
        self.problems = list(problems)
        super().__init__("\n".join(str(p) for p in self.problems))

    def __reduce__(self) -> tuple[type[ConfigError], tuple[list[Problem]]]:
        return type(self), (self.problems,)


class ToolsMissing(ConfigError):
    """The machine lacks what a build needs, whatever the input."""


def closest(word: str, candidates: Iterable[str]) -> str | None:
    """The candidate most like `word`, None if none is close."""
    folded = {c.casefold(): c for c in candidates}
    close = difflib.get_close_matches(word.casefold(), list(folded), n=1, cutoff=0.6)
    return folded[close[0]] if close else None


def did_you_mean(word: str, candidates: Iterable[str]) -> str:
    """`, did you mean "x"?` if a candidate is close to `word`, else nothing."""
    found = closest(word, candidates)
    return f', did you mean "{found}"?' if found else ""
