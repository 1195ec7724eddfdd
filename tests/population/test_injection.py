# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Salient machines that start by injection: frozen ranges, draws within them, lives that a judge tells apart."""

from __future__ import annotations

import hashlib
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from fluxlock.cli import app
from fluxlock.config import load_motor, load_scenario
from fluxlock.population import jumps
from fluxlock.population.files import MACHINE, write_life
from fluxlock.population.injection_draw import PATH, InjectionDraw, injection_ranges, parts
from fluxlock.population.injection_judge import judge_injection, row_of
from fluxlock.population.injection_life import injection_life, injection_refusals, play_injection
from fluxlock.population.run import makers, run_life

FROZEN = "f332913631fc9b5d6769c0c0234e5d8c425fc63887b34e34776b22014b1423fc"
SEED, LIVES = 1, 300
DRAWS = [InjectionDraw.of(SEED, index) for index in range(LIVES)]
RIGHT, BLOCKED, TURNING, UNSURE, REFUSED = 15, 3, 16, 0, 1
LITTLE_SALIENCY, LIGHT = 42, 44  # L_q / L_d - 1 is a third of the file's; the inertia is a fifth
STUCK = 71  # friction of a fifth of the rated torque, and a loop that noise makes slow


def test_ranges_are_frozen() -> None:
    """A drive that fails on a machine is mended, not the ranges.

    Verifies: POP-09
    """
    assert hashlib.sha256(PATH.read_bytes()).hexdigest() == FROZEN


def test_draws_keep_the_ranges_and_reach_their_ends() -> None:
    """Two hundred machines of three phases, a hundred of five; each quantity spreads over nine tenths of its range.

    Verifies: POP-09
    """
    r = injection_ranges()
    assert Counter(d.phases for d in DRAWS) == {3: 200, 5: 100}
    for name in ("power_w", "supply_v", "base_hz", "carrier_hz", "resistance_pu", "inductance_pu", "saliency"):
        low, high = np.log(getattr(r, name))
        values = np.log([getattr(d, name) for d in DRAWS])
        assert low <= values.min() and values.max() <= high and np.ptp(values) > 0.9 * (high - low), name
    for name, share in (("resistance", 0.5), ("inductance_d", 0.2), ("inductance_q", 0.2), ("flux", 0.1)):
        off = np.abs(np.array([getattr(d.over, name) for d in DRAWS]) - 1)
        assert 0.9 * share < off.max() <= share, name
    inertia = [d.over.inertia for d in DRAWS]
    assert 0.2 <= min(inertia) < 0.25 and 18.0 < max(inertia) <= 20.0
    assert {d.bits for d in DRAWS} == {10, 11, 12}
    assert sum(d.blocked for d in DRAWS) > 20 and sum(d.turning != 0.0 for d in DRAWS) > 40


def test_machine_differs_from_its_file(tmp_path: Path) -> None:
    """The factors lie between the file and the machine; the written files load as what is run.

    Verifies: POP-09
    """
    for d in DRAWS[:20]:
        p = parts(d)
        assert p.machine.inductance_h[0] / p.motor.inductance_h[0] == pytest.approx(d.over.inductance_d, rel=1e-4)
        assert p.machine.inductance_q_h and p.motor.inductance_q_h
        assert p.machine.inductance_q_h / p.motor.inductance_q_h == pytest.approx(d.over.inductance_q, rel=1e-4)
        assert p.machine.inertia_kgm2 / p.motor.inertia_kgm2 == pytest.approx(d.over.inertia, rel=1e-4)
    life = injection_life(DRAWS[RIGHT])
    assert load_scenario(write_life(life, tmp_path)).model_dump() == life.scenario.model_dump()
    assert load_motor(tmp_path / MACHINE).model_dump() == life.machine.model_dump()


@pytest.mark.parametrize("index", [RIGHT, BLOCKED, TURNING, LITTLE_SALIENCY, LIGHT, STUCK])
def test_lives_that_are_right(index: int) -> None:
    """A rotor at rest, a blocked one, one that turns already; little saliency, little inertia, much friction.

    Verifies: POP-09
    """
    row = run_life("injection", SEED, makers(), index)
    assert row["outcome"] == "right", row["reasons"]


def test_named_and_refused() -> None:
    """A search that is not sure names it; a search whose current is too small is refused before it runs.

    Verifies: POP-09
    """
    named = run_life("injection", SEED, makers(), UNSURE)
    assert named["outcome"] == "named" and named["reasons"][0]["kind"] == "polarity_unsure, search", named
    refused = run_life("injection", SEED, makers(), REFUSED)
    assert refused["outcome"] == "refused", refused
    assert refused["reasons"][0]["kind"] == "drive.vector.injection.search_current_a"


def test_judge_sees_what_goes_on_unnamed() -> None:
    """A lost angle, motion the wrong way and a wrong speed in a run that was right, each by its name.

    Verifies: POP-10
    """
    life = injection_life(DRAWS[RIGHT])
    assert not injection_refusals(life)
    run = play_injection(life)
    assert not judge_injection(run, life).reasons
    rows, late = run.rows, run.time_s > run.found_s + 0.2
    forward = np.sign(life.target_rpm)

    def kinds(**changed: np.ndarray) -> set[str]:
        made = rows.copy()
        for name, values in changed.items():
            made[name] = values
        run._rows = [made]
        return {kind for kind, _ in judge_injection(run, life).reasons}

    jump = late & (run.time_s < run.found_s + 0.24)
    assert "angle lost" in kinds(error_deg=np.where(late, 100.0, rows["error_deg"]))
    assert kinds(error_deg=np.where(jump, 100.0, rows["error_deg"])) == {"angle"}
    assert "speed reported" in kinds(rpm=np.where(late, 2.0 * rows["rpm"], rows["rpm"]))
    backward = -forward * np.abs(rows["omega"])
    assert "wrong way" in kinds(omega=np.where(late, backward, rows["omega"]))
    assert kinds() == set()
    assert row_of(judge_injection(run, life), run)["fault"] == "none"


@pytest.mark.parametrize(("index", "share", "angle_deg"), [(2, 0.2, 180.0), (14, 0.0, 120.0), (15, 0.05, 180.0)])
def test_jump_is_named(index: int, share: float, angle_deg: float) -> None:
    """Light rotor that friction holds after the jump; rotor that stands, pulled in either direction; slow rotor.

    Verifies: INJC-17
    """
    found = jumps.jump(injection_life(InjectionDraw.of(SEED, index)), share, angle_deg)
    assert found.outcome == jumps.NAMED, str(found)


def test_jumps(monkeypatch: pytest.MonkeyPatch) -> None:
    """A jump that ended wrong fails the command, which says which.

    Verifies: INJC-17
    """
    machines = jumps.jump_machines(1, 1)
    (found,) = jumps.run_jumps(machines, lambda _: None, shares=(0.05,), angles_deg=(60.0,))
    assert found.outcome == jumps.FOLLOWED, str(found)
    late = replace(found, outcome=jumps.WRONG, fault="angle_lost", after_s=0.06)
    monkeypatch.setattr(jumps, "jump_machines", lambda seed: [])
    monkeypatch.setattr(jumps, "run_jumps", lambda lives, done: [found, late])
    done = CliRunner().invoke(app, ["population", "jumps"])
    assert done.exit_code == 1 and "1 wrong of 2 jumps" in done.output and "after 60 ms" in done.output
