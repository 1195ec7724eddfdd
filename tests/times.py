# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Processor time of every test, its own and that of the tools that it starts, and the order in which workers get them.

With FLUXLOCK_TEST_TIMES=FILE (`make test`) the session leaves a JSON list there, an object a test: `id`, `cpu_s`,
`wall_s`, `outcome`, `reason` (why it was skipped, else empty). What a test builds for others counts as its own.
`tests/times.json` holds what each file took of such a list; workers begin with the longest files, so that none is left
over for a single worker at the end. Tests of a file stay together, for the sake of what they share.
"""

from __future__ import annotations

import json
import os
import resource
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

KNOWN = Path(__file__).with_name("times.json")
FILE_VARIABLE = "FLUXLOCK_TEST_TIMES"
CPU = "cpu_s"  # name of the property that workers hand over with a report


def used_s() -> float:
    """Processor time of this process and of its children that have ended, s."""
    spans = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(span.ru_utime + span.ru_stime for span in spans)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> Iterator[None]:
    """Each phase's report carries the processor time since the one before it."""
    report = yield
    now = used_s()
    last = item.stash.get(BEGUN, now)
    item.stash[BEGUN] = now
    report.user_properties = [*report.user_properties, (CPU, now - last)]
    return report


BEGUN = pytest.StashKey[float]()


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """The time begins with the test's fixtures."""
    item.stash[BEGUN] = used_s()


class Times:
    """What the reports of a session say, by test."""

    def __init__(self) -> None:
        self.rows: dict[str, dict[str, Any]] = {}

    def add(self, report: pytest.TestReport) -> None:
        """Take a report of one phase."""
        row = self.rows.setdefault(
            report.nodeid, {"id": report.nodeid, "cpu_s": 0.0, "wall_s": 0.0, "outcome": "passed", "reason": ""}
        )
        row["cpu_s"] = round(row["cpu_s"] + sum(value for name, value in report.user_properties if name == CPU), 2)
        row["wall_s"] = round(row["wall_s"] + report.duration, 2)
        if report.outcome != "passed":
            row["outcome"] = report.outcome
        if report.skipped and isinstance(report.longrepr, tuple):
            row["reason"] = report.longrepr[2].removeprefix("Skipped: ")


TIMES = pytest.StashKey[Times]()


def pytest_configure(config: pytest.Config) -> None:
    """Take notes in the process that starts the workers, or has none."""
    if FILE_VARIABLE in os.environ and not hasattr(config, "workerinput"):
        config.stash[TIMES] = Times()
        config.pluginmanager.register(_Listener(config.stash[TIMES]))


class _Listener:
    """Hears of every report."""

    def __init__(self, times: Times) -> None:
        self.times = times

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        self.times.add(report)

    def pytest_sessionfinish(self) -> None:
        path = Path(os.environ[FILE_VARIABLE])
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(list(self.times.rows.values()), indent=0) + "\n", encoding="utf-8")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """The longest files first, where there are several workers; the others stay as they are."""
    if not hasattr(config, "workerinput") or not KNOWN.exists():
        return
    known: dict[str, float] = json.loads(KNOWN.read_text(encoding="utf-8"))
    items.sort(key=lambda item: -known.get(item.nodeid.partition("::")[0], 0.0))
