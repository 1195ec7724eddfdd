# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The clock of a source: what the page is told of it."""

from __future__ import annotations

import time
from typing import Any

import pytest

from fluxlock.config import load_scenario
from fluxlock.live.worker import Worker

SLOW_S = 0.06  # that the other end takes for each rows
ROUNDS = 30


class SlowPipe:
    """The other end takes its time."""

    def __init__(self) -> None:
        self.statuses: list[dict[str, Any]] = []

    def send(self, message: dict[str, Any]) -> None:
        if message["kind"] == "rows":
            self.statuses.append(message["status"])
            time.sleep(SLOW_S)

    def poll(self, wait_s: float) -> bool:
        if len(self.statuses) >= ROUNDS:
            raise EOFError
        time.sleep(wait_s)
        return False


def worker_of(pipe: Any, factor: float) -> Worker:
    """A worker of the twin whose other end is a stand-in."""
    return Worker(pipe, load_scenario("scenarios/own-spindle.toml"), 1, factor)


def test_time_factor() -> None:
    """The factor that the page shows is simulated over real time, with all that lies between two stretches.

    Verifies: LIVE-17
    """
    pipe = SlowPipe()
    worker = worker_of(pipe, 0.5)
    began = time.monotonic()
    with pytest.raises(EOFError):
        worker.run()
    mean = worker.source.now / (time.monotonic() - began)
    shown = [status["reached"] for status in pipe.statuses[ROUNDS // 2 :]]
    assert sum(shown) / len(shown) == pytest.approx(mean, rel=0.25)


def test_a_source_at_its_end_costs_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where time stands, a round looks at the source once."""
    worker = worker_of(SlowPipe(), 1.0)
    calls: list[float] = []

    def stands(seconds: float, until: str = "end") -> bool:
        calls.append(seconds)
        return False

    monkeypatch.setattr(worker.source, "advance", stands)
    with pytest.raises(EOFError):
        worker.run()
    assert 0 < len(calls) <= ROUNDS
