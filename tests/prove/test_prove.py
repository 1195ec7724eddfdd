# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""`fluxlock prove`: which lives are run, what the verdict says of them, and the command's ends."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from fluxlock import cli
from fluxlock.base.paths import ROOT
from fluxlock.config import load_inverter, load_motor
from fluxlock.config.drive import MotorError
from fluxlock.datasheet.library import machines
from fluxlock.prove.cases import FAILS, HOLDS, REFUSED, SHARES, VALUES, Case, Row, cases, least_rpm, run_case
from fluxlock.prove.library import library_life
from fluxlock.prove.life import LIGHT, Machine, fitting_carrier_hz, life
from fluxlock.prove.page import Proof, draw

PUMP, DRIVE = ROOT / "motors" / "pump-4pp.toml", ROOT / "inverters" / "drive-24v.toml"


def pump() -> Machine:
    """The shipped pump, vector control."""
    motor, inverter = load_motor(PUMP), load_inverter(DRIVE)
    machine = Machine(motor, inverter, "vector", fitting_carrier_hz(motor, inverter.supply_v, "vector"))
    return replace(machine, least_rpm=least_rpm(machine))


def proof(**wrong: str) -> Proof:
    """A proof in which the named cases (`_` for what no name has) do not hold."""
    rows = []
    for case in cases(120):
        key = (
            case.name.replace(" ", "_").replace(",", "").replace("%", "").replace("+", "p").replace("-", "m").strip("_")
        )
        outcome = wrong.get(key, HOLDS)
        rows.append(Row(case, outcome, () if outcome == HOLDS else ("because",), 0.0, 1.0))
    return Proof(pump(), [Row(Case("nominal", "right values"), HOLDS, ())], rows)


def test_every_demand_is_a_case() -> None:
    """36 rest angles, light and loaded; each value of the file off by each share; the life holds what it should.

    Verifies: FRONT-73
    """
    of = cases()
    assert len([case for case in of if case.group == "rest"]) == 72
    assert len([case for case in of if case.group == "value"]) == len(VALUES) * len(SHARES)
    assert {case.error.inductance for case in of} == {0.8, 0.9, 1.0, 1.1, 1.2}
    scenario = life(pump(), MotorError())
    names = ["middle", "load", "sag", "high", "high-load", "low", "reverse"]
    assert [window.name for window in scenario.window] == names
    held = {e.window: (e.min + e.max) / 2 for e in scenario.expect if e.min is not None and e.max is not None}
    assert held["high"] == pytest.approx(9000)
    assert held["reverse"] == pytest.approx(-4500)
    assert held["low"] >= 900


def test_verdict_says_how_wrong_a_value_may_be() -> None:
    """The first share that fails bounds the span, also where a larger one holds; right values decide the verdict.

    Verifies: FRONT-73
    """
    good = proof(L_p10=FAILS, R_m20=REFUSED)
    assert good.span("L") == (-0.2, 0.0)
    assert good.span("R") == (-0.1, 0.2)
    verdict = good.verdict()
    assert verdict.passed
    assert "L of the file may be off by -20 … +0 %; +10 %: fails: because" in verdict.lines
    assert "J of the file may be off by -20 … +20 %, the most that was tried" in verdict.lines
    bad = proof(**{"120_deg_light": FAILS}).verdict()
    assert not bad.passed
    assert bad.lines[0].endswith("does not hold with the file's own values, 1 of 7 lives")
    assert bad.lines[1] == "120 deg, light: fails: because"


def test_a_picture_of_every_outcome(tmp_path: Path) -> None:
    """The page is drawn with failures and refusals, and the document names each.

    Verifies: FRONT-73
    """
    made = proof(L_p10=FAILS, R_m20=REFUSED, **{"120_deg_light": FAILS})
    draw(made, tmp_path / "prove.png")
    assert (tmp_path / "prove.png").stat().st_size > 10_000
    rows = json.loads(json.dumps(made.document()))["rows"]
    assert sum(row["outcome"] == FAILS for row in rows) == 2


def test_lives_on_the_twin() -> None:
    """The pump holds its whole life with right values, and with an inductance of 120 %; a speed beyond it is refused.

    Verifies: FRONT-73
    """
    machine = pump()
    for error in (MotorError(), MotorError(inductance=1.2)):
        row = run_case(machine, Case("value", "a life", error))
        assert row.holds, row.reasons
        assert row.off is not None
        assert row.off < 0.01
    weak = machine.inverter.model_copy(update={"supply_v": 12.0})
    refused = run_case(replace(machine, inverter=weak), Case("nominal", "a weak supply"))
    assert refused.outcome == REFUSED
    assert "V" in refused.reasons[0]


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["motors/none.toml", "inverters/drive-24v.toml"], "none.toml"),
        (["motors/five-phase-yu.toml", "inverters/five-leg-350v.toml"], "phases: the twin has three phases"),
        (["motors/pump-4pp.toml", "inverters/drive-24v.toml", "--method", "foc"], "--method"),
        (["motors/pump-4pp.toml", "motors/pump-4pp.toml"], "is a motor file, not an inverter file"),
    ],
)
def test_bad_input(
    arguments: list[str], says: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """One line and exit code 2.

    Verifies: FRONT-73
    """
    monkeypatch.chdir(ROOT)
    monkeypatch.setattr(sys, "argv", ["fluxlock", "prove", *arguments])
    with pytest.raises(SystemExit) as caught:
        cli.main()
    err = capsys.readouterr().err
    assert (caught.value.code, len(err.splitlines())) == (2, 1), err
    assert says in err


OVERSPEED = "a light servo without friction loses its angle in this life: fault overspeed"


@pytest.mark.parametrize(
    "stem",
    [
        "maxon-ec-4pole-30-200w",
        "hoverboard-hub-6-5in",
        "shinano-la052-080e3nl1",
        pytest.param("delta-ecma-c20604", marks=pytest.mark.xfail(strict=True, reason=OVERSPEED)),
    ],
)
def test_a_machine_of_the_library(stem: str) -> None:
    """Some of the library hold their life; the page has all (`python -m fluxverify.docs.library --run`).

    Verifies: FRONT-72
    """
    entry = next(machine for machine in machines() if machine.stem == stem)
    _, row = library_life(entry)
    assert row.holds, row.reasons


@pytest.mark.parametrize("load", [LIGHT, 1.0])
@pytest.mark.parametrize("inertia", [0.5, 1.0, 2.0])
def test_starts_from_the_worst_rest_angles(inertia: float, load: float) -> None:
    """A spindle with hardly any friction starts from across and opposite to the currents of its alignment.

    Verifies: VC-50
    """
    motor = load_motor(ROOT / "motors" / "spindle-2pp.toml")
    machine = Machine(motor, load_inverter(ROOT / "inverters" / "drive-48v.toml"), "vector", 20e3)
    for theta_deg in (90.0, 130.0, 180.0, 230.0):
        row = run_case(machine, Case("rest", "a start", MotorError(inertia=inertia), theta_deg, load))
        assert row.holds, (theta_deg, row.reasons)
