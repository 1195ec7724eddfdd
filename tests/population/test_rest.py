# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Lives from rest: machines that start at any angle and reverse; the judge sees what is wrong."""

from __future__ import annotations

import math
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from fluxlock.base.paths import ROOT
from fluxlock.population.command import starts_text
from fluxlock.population.draw import Draw, Method
from fluxlock.population.judge import play
from fluxlock.population.life import life_of
from fluxlock.population.rest import RestLife, judge_rest, rest_life
from fluxlock.population.run import makers, run_life
from fluxlock.results.rundata import LogKind, RunData
from fluxlock.results.verdict import RUNNING, STATES

SEED, JUDGED = 1, 4


@pytest.mark.parametrize(
    ("method", "index"),
    [*(("six-step", index) for index in (0, 4, 8, 14, 18, 38, 41, 58, 63, 234, 274)), ("vector", 3), ("vector", 5)],
)
def test_machines_start_from_rest_and_reverse(method: Method, index: int) -> None:
    """Machines that nobody tuned for, each way, within the limit of the current.

    Verifies: POP-11
    """
    row = run_life(method, SEED, makers(), index, rest=True)
    assert row["outcome"] == "right", row["reasons"]
    assert row["lock_s"] < row["allowed_s"]


@pytest.fixture(scope="module")
def life() -> RestLife:
    return rest_life(life_of(Draw.of(SEED, JUDGED), "six-step"))


@pytest.fixture(scope="module")
def data(life: RestLife) -> RunData:
    return play(life)


def _kinds(data: RunData, life: RestLife) -> set[str]:
    return {reason.kind for reason in judge_rest(data, life).reasons}


def _in_state(data: RunData, name: str, from_s: float, to_s: float) -> RunData:
    """The drive in another state for a while."""
    log = data.log.copy()
    rows = (
        (log[:, 1] == int(LogKind.UPDATE)) & (log[:, 0] >= from_s * data.clock_hz) & (log[:, 0] < to_s * data.clock_hz)
    )
    log[rows, 2] = log[rows, 2] & ~0xFF | STATES.index(name)
    return replace(data, log=log)


def test_judge_finds_nothing_in_a_right_life(life: RestLife, data: RunData) -> None:
    """What the following tests change was right, and its times are those of the run.

    Verifies: POP-11
    """
    found = judge_rest(data, life)
    assert found.reasons == () and 0.0 < (found.lock_s or 0.0) < found.allowed_s
    states = data.states()
    first = states["t_s"][np.flatnonzero(states["state"] == RUNNING)[0]]
    assert life.aligned_s + (found.lock_s or 0.0) == pytest.approx(first, abs=1e-9)


def test_judge_sees_starts_that_never_lock(life: RestLife, data: RunData) -> None:
    """Before the reversal, and after it.

    Verifies: POP-11
    """
    end_s = life.scenario.duration_s
    assert "never locked" in _kinds(_in_state(data, "starting", 0.0, life.reversed_s), life)
    assert "never locked" in _kinds(_in_state(data, "starting", life.reversed_s + 0.01, end_s + 1.0), life)


def test_judge_sees_a_lock_that_is_lost(life: RestLife, data: RunData) -> None:
    """10 ms of another state while it should run, in either direction.

    Verifies: POP-11
    """
    for at_s in (life.reversed_s - 0.1, life.scenario.duration_s - 0.1):
        assert _kinds(_in_state(data, "starting", at_s, at_s + 0.01), life) == {"lock lost"}


def test_judge_sees_speed_and_current(life: RestLife, data: RunData) -> None:
    """A speed that is off by 2 %, and a quarter more than the limit of the current for 2 ms.

    Verifies: POP-11
    """
    records = data.records.copy()
    records["omega_e"] *= 1.02
    assert _kinds(replace(data, records=records), life) == {"speed"}
    records, time_s = data.records.copy(), data.records["t_cycle"] / data.clock_hz
    more = (time_s > 1.0) & (time_s < 1.002)
    records["ia"][more], records["ib"][more], records["ic"][more] = 1.25 * life.scenario.current_limit_a, 0.0, 0.0
    records["ib"][more] = -records["ia"][more]
    assert _kinds(replace(data, records=records), life) == {"current"}


def test_judge_sees_a_rotor_that_turns_back(life: RestLife, data: RunData) -> None:
    """250 degrees back in the middle of the first start.

    Verifies: POP-11
    """
    records, time_s = data.records.copy(), data.records["t_cycle"] / data.clock_hz
    middle_s = life.aligned_s + 0.5 * (judge_rest(data, life).lock_s or 0.0)
    records["theta_e"][time_s >= middle_s] -= math.radians(250.0 + 120.0)
    found = judge_rest(replace(data, records=records), life)
    assert {reason.kind for reason in found.reasons} == {"turned back"} and found.back_deg > 210.0


def test_summary_counts_late_and_far_ones() -> None:
    """Lives that were refused count nowhere.

    Verifies: POP-11
    """
    rows = [
        {"lock_s": 0.1, "allowed_s": 0.4, "back_deg": 10.0},
        {"lock_s": 0.5, "allowed_s": 0.4, "back_deg": 61.0},
        {"lock_s": None, "allowed_s": 0.4, "back_deg": 0.0},
        {"lock_s": 0.2, "allowed_s": 0.4, "back_deg": 0.0},
        {"outcome": "refused"},
    ]
    text = starts_text(rows)
    assert "50.0 % locked in time, 75.0 % turned back by at most 60 degrees" in text and "all by at most 61" in text


def test_command_line() -> None:
    """One life by its exit code; what goes with no life from rest is one line and exit code 2.

    Verifies: POP-11
    """

    def command(*words: str) -> subprocess.CompletedProcess[str]:
        call = [sys.executable, "-m", "fluxlock", "population", *words, "--rest"]
        return subprocess.run(call, capture_output=True, text=True, check=False, cwd=ROOT)

    done = command("run", "--method", "six-step", "--first", str(JUDGED), "--lives", "1", "--jobs", "1")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "six-step-rest: 1 lives, 1 right" in done.stdout and "100.0 % locked in time" in done.stdout
    for words, text in (
        (("run", "--method", "injection"), "lives of injection begin at rest"),
        (("run", "--wirings", "3"), "does not go with --wirings"),
    ):
        wrong = command(*words)
        assert wrong.returncode == 2 and text in wrong.stderr and wrong.stderr.count("\n") == 1, wrong.stderr
