# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Lives of the population: judged, refused, kept, counted; the judge sees what is wrong."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fluxlock.base.paths import ROOT
from fluxlock.population import page as page_module
from fluxlock.population import run as run_module
from fluxlock.population.draw import Draw, Method
from fluxlock.population.ideal import ideal_ripple_rpm, ideal_torque_nm
from fluxlock.population.judge import judge, play
from fluxlock.population.life import Life, life_of, refusals
from fluxlock.population.run import makers, run_life
from fluxlock.population.table import deciles, groups
from fluxlock.results.rundata import LogKind, RunData

SEED = 1
RIGHT_VECTOR, REFUSED_VECTOR = (3, 5), 80
RIGHT_SIX_STEP = (3, 6, 7, 14, 20, 22, 33)


@pytest.fixture(scope="module")
def life() -> Life:
    return life_of(Draw.of(SEED, RIGHT_VECTOR[0]), "vector")


@pytest.fixture(scope="module")
def data(life: Life) -> RunData:
    return play(life)


@pytest.mark.parametrize(
    ("method", "index"),
    [*(("vector", index) for index in RIGHT_VECTOR), *(("six-step", index) for index in RIGHT_SIX_STEP)],
)
def test_lives_that_are_right(method: Method, index: int) -> None:
    """Machines that nobody tuned for keep every limit.

    Verifies: POP-04
    """
    row = run_life(method, SEED, makers(), index)
    assert row["outcome"] == "right", row["reasons"]
    assert len(row["holds"]) == 8 and all(abs(hold["off"]) < 0.005 for hold in row["holds"])


@pytest.mark.parametrize("index", [38, 61, 73, 74, 82, 89])
def test_six_step_lives_turn_evenly(index: int) -> None:
    """Drives that brake swung by 2 % by restarted carriers, by 1.1 % by unequal pairs, by 2 to 4 % by dead times.

    A light rotor swung by 10 % by restarted carriers (38).

    Verifies: FW-74
    """
    row = run_life("six-step", SEED, makers(), index)
    assert row["outcome"] == "right", row["reasons"]


def test_a_crossing_stays_visible_in_short_sectors() -> None:
    """A machine of much inductance lost its lock while it sped up and tripped: freewheeling hid the crossings.

    Verifies: FW-72
    """
    row = run_life("six-step", SEED, makers(), 132)
    assert row["outcome"] == "right", row["reasons"]


def test_a_brake_knows_its_current() -> None:
    """The DC link alone has two currents for it: with the other one the brake held half of its torque back.

    Verifies: FW-71
    """
    row = run_life("six-step", SEED, makers(), 185)
    assert row["outcome"] == "right", row["reasons"]


def test_refused_by_name() -> None:
    """A machine that the file check refuses does not run.

    Verifies: POP-04
    """
    row = run_life("vector", SEED, makers(), REFUSED_VECTOR)
    assert row["outcome"] == "refused" and row["reasons"][0]["kind"] == "drive.carrier_hz", row


def test_least_speed_refuses_and_says_what_would_run(life: Life) -> None:
    """The refusal names a resistance with which the same machine is not refused.

    Verifies: POP-04
    """
    slow = replace(life.draw, resistance_pu=0.4)
    text = refusals(life_of(slow, "vector"))[0]
    assert text.startswith("least speed: ") and "it runs with an encoder, resistance_ohm up to " in text
    named_ohm = float(text.split("resistance_ohm up to ")[1].split()[0])
    told_ohm = sum(life_of(slow, "vector").scenario.motor.resistance_ohm) / 3 * slow.error.resistance
    lower = replace(slow, resistance_pu=0.4 * 0.9 * named_ohm / told_ohm)
    assert not any(text.startswith("least speed") for text in refusals(life_of(lower, "vector")))


def _kinds(data: RunData, life: Life) -> set[str]:
    return {reason.kind for reason in judge(data, life).reasons}


def _changed(data: RunData, **columns: np.ndarray) -> RunData:
    records = data.records.copy()
    for name, values in columns.items():
        records[name] = values
    return replace(data, records=records)


def test_judge_finds_nothing_in_a_right_life(life: Life, data: RunData) -> None:
    """What the following tests change was right.

    Verifies: POP-05
    """
    assert _kinds(data, life) == set()


def test_judge_sees_a_wrong_speed(life: Life, data: RunData) -> None:
    """An angle that turns 1 % faster than it should.

    Verifies: POP-05
    """
    records = data.records
    faster = _changed(data, theta_e=1.01 * records["theta_e"], omega_e=1.01 * records["omega_e"])
    assert "speed" in _kinds(faster, life)


def test_judge_sees_ripple(life: Life, data: RunData) -> None:
    """A speed that goes to and fro by 2 % p-p about its right mean.

    Verifies: POP-05
    """
    time_s = data.records["t_cycle"] / data.clock_hz
    swinging = data.records["omega_e"] * (1 + 0.01 * np.sin(2 * np.pi * 200 * time_s))
    assert _kinds(_changed(data, omega_e=swinging), life) == {"ripple"}


def test_judge_sees_a_wrong_angle_and_a_lost_one(life: Life, data: RunData) -> None:
    """A published angle that is off by 5 degrees, and by 120.

    Verifies: POP-05
    """
    for deg, kinds in ((5.0, {"angle"}), (120.0, {"angle", "angle lost"})):
        log = data.log.copy()
        rows = log[:, 1] == int(LogKind.ANGLE)
        log[rows, 2] += round(deg / 360 * 2**32)
        assert _kinds(replace(data, log=log), life) == kinds


def test_judge_sees_the_current(life: Life, data: RunData) -> None:
    """2 ms of a quarter more than the limit.

    Verifies: POP-05
    """
    time_s = data.records["t_cycle"] / data.clock_hz
    factor = np.where((time_s > 1.0) & (time_s < 1.002), 1.25 * life.scenario.current_limit_a, 0.0)
    columns = {
        name: data.records[name] + factor * np.cos(data.records["theta_e"] - 2 * math.pi / 3 * k)
        for k, name in enumerate(("ia", "ib", "ic"))
    }
    assert _kinds(_changed(data, **columns), life) == {"current"}


def test_judge_sees_overshoot(life: Life, data: RunData) -> None:
    """A speed beyond its new target by 10 % of the change, outside of the holds.

    Verifies: POP-05
    """
    change = life.changes[0]
    time_s = data.records["t_cycle"] / data.clock_hz
    beyond = change.to_rpm + 0.1 * (change.to_rpm - change.from_rpm)
    speed = data.records["omega_e"].copy()
    speed[(time_s > change.to_s - 0.1) & (time_s < change.to_s - 0.09)] *= beyond / change.to_rpm
    assert _kinds(_changed(data, omega_e=speed), life) == {"overshoot"}


def test_ideal_drive_of_an_equal_sinusoidal_machine_has_no_ripple(life: Life) -> None:
    """Its torque is 1.5 p psi i_q with sinusoidal currents; constant currents of pairs leave the known ripple.

    Verifies: POP-05
    """
    motor = life.scenario.motor.model_copy(
        update={"psi_vs": (0.01,) * 3, "emf": "sinusoidal", "inductance_q_h": None, "pole_pairs": 2}
    )
    torque = ideal_torque_nm(motor, "vector", 3j)
    assert torque == pytest.approx(1.5 * 2 * 0.01 * 3)
    assert ideal_ripple_rpm(motor, "vector", 1000.0, 3j) == pytest.approx(0.0, abs=1e-9)
    pair = ideal_torque_nm(motor, "six-step", 3j)
    assert pair.mean() == pytest.approx(2 * 0.01 * 3 * 3 * math.sqrt(3) / math.pi, rel=1e-3)
    assert np.ptp(pair) / pair.max() == pytest.approx(1 - math.cos(math.pi / 6), rel=1e-2)


def test_same_life_is_not_run_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A finished life is read.

    Verifies: POP-04
    """
    monkeypatch.setattr(run_module, "FOLDER", tmp_path)
    (tmp_path / "vector").mkdir()
    runs = []

    def counted(life: Life) -> RunData:
        runs.append(life.draw.index)
        return play(life)

    monkeypatch.setattr(run_module, "play", counted)
    first, again = (run_life("vector", SEED, makers(), RIGHT_VECTOR[0]) for _ in range(2))
    assert runs == [RIGHT_VECTOR[0]] and json.dumps(first) == json.dumps(again)


def test_groups_and_deciles_count_every_life_once() -> None:
    """First reasons add up to the lives that are not right; deciles to all.

    Verifies: POP-04
    """

    def row(index: int, outcome: str, *kinds: str) -> dict[str, object]:
        reasons = [{"kind": kind, "text": f"{kind} of {index}"} for kind in kinds]
        return {"index": index, "outcome": outcome, "reasons": reasons, "machine": {"inductance_pu": 0.01 * index}}

    rows = [row(1, "right"), row(2, "wrong", "speed", "angle"), row(3, "wrong", "angle"), row(4, "refused", "angle")]
    rows += [row(k, "right") for k in range(5, 24)]
    found = {(g.outcome, g.kind): (g.indices, g.also) for g in groups(rows)}
    assert found == {
        ("wrong", "speed"): ((2,), 0),
        ("wrong", "angle"): ((3,), 1),
        ("refused", "angle"): ((4,), 0),
    }
    parts = deciles(rows)
    assert len(parts) == 10 and sum(sum(part[2:]) for part in parts) == len(rows)
    assert parts[0] == (0.01, 0.02, 1, 0, 0, 1)


def test_command_line(tmp_path: Path) -> None:
    """Exit code 0 where no life is wrong, 2 with one line for a method that there is not.

    Verifies: POP-04
    """

    def command(*words: str) -> subprocess.CompletedProcess[str]:
        call = [sys.executable, "-m", "fluxlock", "population", *words]
        return subprocess.run(call, capture_output=True, text=True, check=False, cwd=ROOT)

    words = ("run", "--method", "vector", "--first", str(REFUSED_VECTOR), "--lives", "1", "--jobs", "1")
    done = command(*words)
    assert done.returncode == 0 and "1 lives, 0 right, 1 refused, 0 wrong" in done.stdout, done.stdout + done.stderr
    wrong = command("run", "--method", "sixstep")
    assert wrong.returncode == 2 and wrong.stderr.count("\n") == 1 and '"sixstep" is no method' in wrong.stderr
    drawn = command("draw", str(RIGHT_VECTOR[0]), "--out", str(tmp_path))
    assert drawn.returncode == 0 and (tmp_path / "scenario.toml").exists()


def test_page_shows_every_life(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Counts of all methods, the ranges and the limits; a missing document is one line and exit code 2.

    Verifies: POP-08
    """
    monkeypatch.setattr(page_module, "FOLDER", tmp_path)
    monkeypatch.setattr(page_module, "PAGE", tmp_path / "population.md")
    assert page_module.main([]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 3 and all("fluxlock population run --method" in line for line in lines)
    machine = {"inductance_pu": 0.1}
    rows = [
        {"index": 0, "outcome": "right", "reasons": [], "machine": machine},
        {"index": 1, "outcome": "wrong", "reasons": [{"kind": "speed", "text": "high: 3 r/min"}], "machine": machine},
    ]
    for method in ("vector", "six-step"):
        document = {"method": method, "seed": 1, "sources": {}, "rows": rows}
        (tmp_path / f"{method}.json").write_text(json.dumps(document))
    rows.append({"index": 2, "outcome": "named", "reasons": [{"kind": "no_saliency", "text": "x"}], "machine": machine})
    document = {"method": "injection", "seed": 1, "sources": {}, "rows": rows}
    (tmp_path / "injection.json").write_text(json.dumps(document))
    assert page_module.main([]) == 0
    text = (tmp_path / "population.md").read_text()
    assert text.count("**2 lives: 1 right, 0 refused by name, 1 wrong.**") == 2
    assert text.count("| wrong | speed | 1 | 0 | 1 | high: 3 r/min |") == 3
    assert "**3 lives: 1 right, 1 ended by a named fault, 0 refused by name, 1 wrong.**" in text
    assert "| L_q / L_d | 1.05 | 4 |  |" in text and "| named | no_saliency | 1 | 0 | 2 | x |" in text
    assert "| pole pairs | 1 | 24 |" in text and "| mean speed | ± 0.5 % |" in text
