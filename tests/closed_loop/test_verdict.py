# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The verdict over runs of the chip: no limit is set, and what is wrong has one line; its remedy passes."""

from __future__ import annotations

import re

import pytest

from fluxlock.config import load_scenario
from fluxlock.cosim.outcome import Run
from fluxlock.results.verdict import judge_run
from tests.closed_loop.support import drive
from tests.closed_loop.test_command import SPIN

# A rotor that turns a fifteenth too fast, with nothing on its shaft.
FREE = (
    "initial.speed_rpm=16000",
    'event=[{at_s=0.003,speed_rpm=15000},{at_s=0.004,command="start"}]',
    "load.fan_torque_nm=1e-5",
    'window=[{name="held",from_s=0.1,to_s=0.15}]',
    "duration_s=0.16",
    "expect=[]",
)


@pytest.fixture(scope="module")
def over_speed() -> Run:
    """The run itself."""
    return drive(SPIN, "least-duty", *FREE)


def test_over_speed_by_the_least_duty(over_speed: Run) -> None:
    """Nothing brakes the rotor: the run fails with the limit that was active, for how long, and what to do.

    Verifies: FRONT-35
    """
    run = over_speed
    (line,) = run.verdict.failures
    found = re.match(
        r"(\d+)\.\d r/min for 15000 r/min in held \(\+\d+\.\d %\), \d+\.\d at the end: "
        r"limit duty_min active for 0\.1\d\d s",
        line,
    )
    assert found and int(found[1]) > 16_000, line
    assert "set drive.sync_rect = true" in line and run.result["verdict"] == {"passed": False, "lines": [line]}


def test_its_remedy_and_its_statement(over_speed: Run) -> None:
    """The same with synchronous rectification holds its speed; stated, the over-speed passes with its reason.

    Verifies: FRONT-35, FRONT-36
    """
    run = drive(SPIN, "least-duty-braked", *FREE, "drive.sync_rect=true")
    assert run.verdict.passed, run.verdict.lines
    found = re.match(r"(\d+\.\d) r/min for 15000 r/min in held", run.verdict.lines[0])
    assert found and abs(float(found[1]) - 15000.0) < 150.0, run.verdict.lines[0]
    stated = load_scenario(SPIN, (*FREE, 'accept=[{what="duty_min",why="nothing on the shaft"}]'))
    verdict = judge_run(over_speed.data, stated, over_speed.analysis, over_speed.metrics)
    assert verdict.passed and "accepted duty_min: nothing on the shaft" in verdict.lines
