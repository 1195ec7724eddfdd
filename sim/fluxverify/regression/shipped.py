# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Every shipped scenario that states what must happen, on the chip as a user runs it: its own verdict."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from fluxlock.base.paths import ROOT
from fluxlock.config import load_scenario
from fluxverify.regression.case import Row, case
from fluxverify.regression.runner import Runner

SCENARIOS = ROOT / "scenarios"
# Folders of a family; what lies above them is six-step.
FOLDERS = {"six-step": (".", "six-step"), "five-phase": ("five-phase",), "vector": ("vector",)}


def stated(family: str) -> list[Path]:
    """Files of a family with limits, or with a trip or a fault that has to come."""
    found = []
    for folder in FOLDERS[family]:
        for path in sorted((SCENARIOS / folder).glob("*.toml")):
            scenario = load_scenario(path)
            if scenario.expect or scenario.expect_trip or scenario.expect_fault:
                found.append(path.relative_to(SCENARIOS))
    return found


def _rows(runner: Runner, family: str) -> Iterator[Row]:
    files = stated(family)
    for file in files[:1] if runner.quick else files:
        verdict = runner.drive(file, file.stem, expects=True).verdict
        yield Row(
            f"{family}/shipped/{file.stem}",
            {"scenario": file.as_posix()},
            {"passed": int(verdict.passed)},
            {"passed": (1, 1)},
            verdict.lines[0],
        )


@case("six-step/shipped", long=True)
def six_step(runner: Runner) -> Iterator[Row]:
    """Shipped six-step scenarios keep what they state."""
    yield from _rows(runner, "six-step")


@case("five-phase/shipped", long=True)
def five_phase(runner: Runner) -> Iterator[Row]:
    """Shipped five-phase scenarios keep what they state."""
    yield from _rows(runner, "five-phase")


@case("vector/shipped", long=True)
def vector(runner: Runner) -> Iterator[Row]:
    """Shipped vector scenarios keep what they state."""
    yield from _rows(runner, "vector")
