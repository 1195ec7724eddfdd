# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Cases of the regression: each is a function that runs scenarios and yields rows of values with limits."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fluxverify.regression.runner import Runner

Number = float | int | None
# What may come of a run that is disturbed, or driven on, until its lock is lost; the case's own limits judge its end.
LOCK_MAY_GO = ("trip", "fault", "lost_lock", "lost_angle", "end_state")
Condition = str | float | int | bool


@dataclass(frozen=True)
class Row:
    """One row of `build/regression.json`.

    id: `<set>/<case>/<variant>`. values: names carry the units (`commutation_error_deg.rms`). limits: name of a value
    -> (least, most), None = open; a value that is missing, None or not finite misses its limit and is written as null.
    note: what a reader should know.
    """

    id: str
    conditions: dict[str, Condition]
    values: dict[str, Number]
    limits: dict[str, tuple[float | None, float | None]] = field(default_factory=dict)
    note: str = ""

    def misses(self) -> list[str]:
        """Which limits are missed, in words."""
        lines = []
        for name, (least, most) in self.limits.items():
            value = self.values.get(name)
            if value is None or not math.isfinite(value):
                lines.append(f"{name} has no value")
            elif (least is not None and not value >= least) or (most is not None and not value <= most):
                lines.append(f"{name} = {value:.6g} is outside of {limit_text(least, most)}")
        return lines

    def as_json(self) -> dict[str, Any]:
        """The row as it is written."""
        limits = {name: {"min": least, "max": most} for name, (least, most) in self.limits.items()}
        return {
            "id": self.id,
            "conditions": self.conditions,
            "values": {name: _finite(value) for name, value in self.values.items()},
            "limit": limits,
            "pass": not self.misses(),
            "note": self.note,
        }


def _finite(value: Number) -> Number:
    return value if value is None or math.isfinite(value) else None


def limit_text(least: float | None, most: float | None) -> str:
    """`0.5 … 1`, `≥ 0.5`, `≤ 1`, `± 1`."""
    if least is None or most is None:
        return f"≤ {most:g}" if least is None else f"≥ {least:g}"
    if least == most:
        return f"{least:g}"
    return f"± {most:g}" if least == -most else f"{least:g} … {most:g}"


Body = Callable[["Runner"], Iterable[Row]]


@dataclass(frozen=True)
class Case:
    """A named function that yields rows; its docstring says what it shows.

    long: begun before the others. tested: `make test` runs its short version too: it is short, and the only test that
    takes the chip through this code. All others judge how well the drive does, which is the regression's.
    """

    id: str
    body: Body
    long: bool = False
    tested: bool = False

    @property
    def title(self) -> str:
        """First line of the docstring."""
        body = self.body.func if isinstance(self.body, functools.partial) else self.body
        return (body.__doc__ or self.id).strip().splitlines()[0]


CASES: dict[str, Case] = {}


def case(name: str, long: bool = False, tested: bool = False) -> Callable[[Body], Body]:
    """Register a case under `<set>/<name>`."""

    def register(body: Body) -> Body:
        if name in CASES:
            raise ValueError(f"case {name} is registered twice")
        CASES[name] = Case(name, body, long, tested)
        return body

    return register
