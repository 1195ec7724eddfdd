# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The short version of the regression's cases, save those that others stand for, and how rows judge their values."""

from __future__ import annotations

import pytest

from fluxverify.regression import sets
from fluxverify.regression.case import CASES, Row
from fluxverify.regression.runner import Runner


@pytest.mark.parametrize("name", [case.id for case in CASES.values() if case.tested])
def test_quick_case(name: str) -> None:
    """Every row of the case keeps its limits.

    Verifies: SYS-12
    """
    print(f"{name} seed 1, cases registered by {sets.__name__}")
    runner = Runner(name, quick=True, plots=False)
    rows = list(CASES[name].body(runner))
    assert rows
    for row in rows:
        print(row.as_json())
    doubts = [f"{row.id.removeprefix(name)[1:]}: {miss}" for row in rows for miss in row.misses()] + runner.unvouched
    assert not doubts


def test_limits_are_judged() -> None:
    """A value outside of its limits, without a value or missing altogether fails the row.

    Verifies: SYS-12
    """
    limits = {"a": (0.0, 1.0)}
    assert not Row("r", {}, {"a": 1.0}, limits).misses()
    for values in ({"a": 1.01}, {"a": -0.01}, {"a": None}, {"b": 0.5}, {"a": float("nan")}):
        assert Row("r", {}, dict(values), limits).misses(), values
