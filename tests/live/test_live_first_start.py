# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A first start as a source of the page: questions, answers, the end by hand, what a page shows of the turns."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from fluxlock.base.stage import Progress
from fluxlock.commission.simulate import Measured
from fluxlock.config import ConfigError, Scenario, load_scenario
from fluxlock.first_start.bench import SimulatedBench
from fluxlock.live import messages
from fluxlock.live.cli import first_start_of
from fluxlock.live.first_start import FirstStartPlan, FirstStartSource
from fluxlock.live.source import RefusedError
from fluxlock.live.traces import NAMES
from tests.first_start.benches import averaged_identify

SPINDLE = "scenarios/own-spindle.toml"
PATIENCE_S = 300.0


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """The averaged bench in place of the simulated chip."""

    def identify(self: SimulatedBench, scenario: Scenario, progress: Progress) -> Measured:
        return averaged_identify(scenario)

    monkeypatch.setattr(SimulatedBench, "identify", identify)


@contextmanager
def begun(folder: Path) -> Iterator[FirstStartSource]:
    """A source whose steps wait for the first answer."""
    folder.mkdir(exist_ok=True)
    source = FirstStartSource(FirstStartPlan(load_scenario(SPINDLE), None, folder))
    try:
        yield source
    finally:
        source.end()


def until(condition: Callable[[], object]) -> None:
    """Wait for the steps' thread."""
    end_s = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < end_s
        time.sleep(0.01)


def asked(source: FirstStartSource) -> str:
    """The next question."""
    until(lambda: source.guide.question or source.verdict)
    return str(source.status()["wizard"]["question"])


def test_step_by_step(tmp_path: Path) -> None:
    """Each step waits for its yes; the turns are traces of the page; report, motor file and plots are there to load.

    Verifies: FST-06
    """
    with begun(tmp_path) as source:
        steps = source.hello()["wizard"]["steps"]
        assert [name for name, _ in steps] == ["wiring", "identify", "first turn", "tune"]
        assert all("A" in limits for _, limits in steps)
        questions = []
        while question := asked(source):
            questions.append(question)
            with pytest.raises(RefusedError, match="goes by its steps"):
                source.act(messages.Drive(kind="drive", do="start"))
            source.answer(source.guide.asked - 1, True)  # a second click on the question before
            assert source.status()["wizard"]["question"] == question
            source.answer(source.guide.asked, True)
        assert questions == ["go on?"] * 3 + ["did the shaft turn the way that you want?", "go on?"]
        told = source.status()["wizard"]
        assert told["verdict"].startswith("ok: the machine is wired") and told["step"] == 4
        assert all(passed for passed, _ in told["ended"].values())
        time_s, rows = source.take()
        speeds = rows[NAMES.index("measured_rpm")]
        assert np.all(np.diff(time_s) > 0) and np.nanmax(speeds) > source.run.turn_rpm
        assert np.nanmax(rows[NAMES.index("motor_a")]) < 1.5 * source.run.limit_a
        assert set(source.written()) == {"first-start.json", "motor.toml", "motor.png", "turns.png"}
        with pytest.raises(RefusedError, match="has ended"):
            source.answer(source.guide.asked, True)


def test_a_turn_that_is_stopped(tmp_path: Path) -> None:
    """Stop while the shaft turns: the step ends, by name, with the gates off.

    Verifies: FST-06, FST-03
    """
    with begun(tmp_path) as source:
        for _ in range(3):
            assert asked(source) == "go on?"
            source.answer(source.guide.asked, True)
        until(lambda: source.guide.state == "running")
        source.answer(source.guide.asked, False)
        until(lambda: source.verdict)
        assert source.verdict == "failed: stopped by hand in the step first turn; the gates are off"
        assert "turns.png" in source.written()


def test_a_no_and_the_end_of_the_page(tmp_path: Path) -> None:
    """A no stops before its step; a source that is ended while it asks stops too.

    Verifies: FST-06, FST-03
    """
    with begun(tmp_path / "no") as source:
        assert asked(source) == "go on?"
        source.answer(source.guide.asked, False)
        until(lambda: source.verdict)
        assert source.verdict == "failed: stopped before the step wiring; the gates are off"
    with begun(tmp_path / "late") as source:
        assert asked(source) == "go on?"
        source.answer(0, False)  # a stop that was meant for what has ended meanwhile
        until(lambda: source.verdict)
        assert source.verdict == "failed: stopped by hand in the step wiring; the gates are off"
    with begun(tmp_path / "end") as source:
        assert asked(source) == "go on?"
    assert source.verdict == "failed: stopped by hand in the step wiring; the gates are off"


@pytest.mark.parametrize(
    ("file", "chip", "text"),
    [
        (SPINDLE, True, "leave out --chip"),
        ("scenarios", False, "goes with a scenario"),
        ("scenarios/five-phase/yu.toml", False, "the steps are of three phases"),
    ],
)
def test_refused(file: str, chip: bool, text: str, tmp_path: Path) -> None:
    """What has no first start is named at once.

    Verifies: FST-03
    """
    with pytest.raises(ConfigError) as refused:
        first_start_of(Path(file), None, (), None, chip, tmp_path)
    assert text in str(refused.value)
