# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Test of the wiring on the twin: each wrong order and sign is named, a right one passes, and the rotor stays."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable
from dataclasses import replace
from itertools import combinations, permutations
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fluxlock import cli
from fluxlock.base.paths import ROOT
from fluxlock.config import ConfigError, Scenario, load_scenario
from fluxlock.native.player import check_playable
from fluxlock.native.vector_chip import VectorChip, set_machine
from fluxlock.native.vector_run import vector_chip_of
from fluxlock.population import wirings
from fluxlock.population.draw import Draw
from fluxlock.population.life import life_of
from fluxlock.population.wirings import Machine, Trial, try_machines
from fluxlock.population.wirings import verdict_of as verdict_of_machines
from fluxlock.wiring.command import verdict_of
from fluxlock.wiring.measure import Measured, first_answers, judge, lead, on_twin
from fluxlock.wiring.naming import anisotropy, stopped
from fluxlock.wiring.reach import ByConsole, Told, WiringError

FILE = ROOT / "scenarios" / "vector" / "start.toml"
# Limits: share of the rated current, time with the coast before it, angle.
CURRENT_SHARE, LONGEST_S, MOST_DEG = 0.1, 0.2, 5.0
ORDERS = ["".join(order) for order in permutations("ABC")]
SIGNS = ["".join(letters) for count in range(4) for letters in combinations("ABC", count)]
PLAIN: dict[str, Any] = {"event": [], "window": [], "expect": []}


def carry_out(scenario: Scenario, change: Callable[[VectorChip], None] | None = None) -> tuple[Measured, VectorChip]:
    """The firmware's test on the twin, with its limits."""
    chip = vector_chip_of(scenario, seed=3)
    period_s = chip.timing.period_s
    chip.advance(round(5e-3 / period_s))
    if change is not None:
        change(chip)
    chip.keep_rows(round(1.0 / period_s))
    told, peak_a = lead(ByConsole(chip.fw.command), lambda s: chip.advance(round(s / period_s)))
    measured = judge(told, scenario, peak_a)
    rows = chip.rows()
    starting = rows["state"] == 2
    assert starting.sum() * period_s <= LONGEST_S
    assert np.abs(rows["i"]).max() <= CURRENT_SHARE * scenario.rated_current_a
    assert math.degrees(np.abs(rows["theta"] - rows["theta"][0]).max()) < MOST_DEG
    return measured, chip


def wired(**keys: Any) -> Scenario:
    """The file's scenario with keys of its inverter's sensing."""
    changes = [f"inverter.sensing.{key}={json.dumps(value)}" for key, value in keys.items()]
    return load_scenario(FILE, changes).model_copy(update=PLAIN)


def test_a_right_wiring_passes() -> None:
    """The drive is ready again, its tables are those of three phases whose currents sum to zero.

    Verifies: WIRE-01
    """
    measured, chip = carry_out(wired())
    assert measured.passed, measured.findings
    assert chip.fw.state == "ready"
    most = measured.current_a.max()
    assert most > 0.01 * wired().rated_current_a
    assert measured.current_a == pytest.approx(most * (1.5 * np.eye(3) - 0.5), abs=0.15 * most)
    swing = measured.voltage_v - measured.voltage_v.min(axis=0)
    assert (np.diag(swing) > 5 * (swing.sum(axis=0) - np.diag(swing))).all()


@pytest.mark.parametrize("order", ORDERS)
def test_each_order_and_sign_of_the_current_sensors_is_named(order: str) -> None:
    """All 47 wrong ones: the drive stops with the fault, the tables give order and signs.

    Verifies: WIRE-02
    """
    for inverted in SIGNS:
        measured, chip = carry_out(wired(current_order=order, current_inverted=list(inverted)))
        right = (order, inverted) == ("ABC", "")
        assert (measured.fault == "none", chip.fw.state == "ready") == (right, right), inverted
        assert (measured.wiring.current_order, measured.wiring.current_inverted) == (order, inverted)
        assert {finding.kind for finding in measured.findings} == (set() if right else {"current_wiring"}), inverted


def test_each_order_of_the_dividers_is_named() -> None:
    """All 5 wrong ones.

    Verifies: WIRE-02
    """
    for order in ORDERS[1:]:
        measured, _ = carry_out(wired(voltage_order=order))
        assert measured.fault == "wiring"
        assert measured.wiring.voltage_order == order
        assert [finding.kind for finding in measured.findings] == ["voltage_wiring"]


@pytest.mark.parametrize("letter", "ABC")
def test_what_is_missing_is_named(letter: str) -> None:
    """A sensor or divider without signal, a leg without current, a gain that is far off.

    Verifies: WIRE-03
    """
    k = "ABC".index(letter)

    def open_leg(chip: VectorChip) -> None:
        chip.plant.open_phase = k + 1

    def gain(chip: VectorChip) -> None:
        chip.plant.wired = True
        chip.plant.current_gain[0, k, k] = 2.0

    low = letter.lower()
    for kind, keys, change in (
        ("current_sensor", {"unconnected": [f"i{low}"]}, None),
        ("divider", {"unconnected": [f"v{low}"]}, None),
        ("leg", {}, open_leg),
        ("current_gain", {}, gain),
    ):
        measured, _ = carry_out(wired(**keys), change)
        assert [(f.kind, f.inputs) for f in measured.findings] == [(kind, letter)], kind
        assert not measured.passed
        assert measured.fault == ("none" if kind == "current_gain" else "wiring")


def test_machines_of_the_population_are_right() -> None:
    """No false alarm, no wiring that is not named, within the limits; `fluxlock population run --wirings 8` tries more.

    Verifies: WIRE-04
    """
    machines = try_machines(1, range(4), 3, 1, lambda: None)
    assert sum(not machine.refused for machine in machines) >= 3
    assert [text for machine in machines for text in machine.wrong] == []
    assert verdict_of_machines(machines).passed


def test_a_small_machine_has_numbers_of_its_own() -> None:
    """Pulses of 2 mA: the console's numbers are finer than that, else orders, signs and gains are guessed.

    Verifies: WIRE-04
    """
    (machine,) = try_machines(1, [218], 4, 1, lambda: None)
    assert machine.trials and machine.wrong == []


def test_a_machine_that_is_wrong_is_counted() -> None:
    """A false alarm, a wiring not named, and each limit fail the verdict.

    Verifies: WIRE-04
    """
    right = Trial("right", "", True, 0.1, 0.05, 1.0)
    assert verdict_of_machines([Machine(0, "", [right])]).passed
    assert not verdict_of_machines([Machine(0, "refused")]).passed
    for change in ({"said": "passed"}, {"longest_s": 0.3}, {"current_share": 0.2}, {"moved_deg": 6.0}):
        verdict = verdict_of_machines([Machine(0, "", [right, replace(right, **change)])])
        assert not verdict.passed and len(verdict.lines) == 2, change


@pytest.mark.parametrize(("order", "state"), [("ABC", "starting"), ("BCA", "fault")])
def test_first_start_only(order: str, state: str) -> None:
    """`first`: the test precedes the first start after a reset, and no later one; a wrong wiring does not start.

    Verifies: WIRE-01
    """
    chip = vector_chip_of(wired(current_order=order), seed=3)
    period_s = chip.timing.period_s
    chip.advance(round(5e-3 / period_s))
    tests = []
    for _ in range(2):
        for line in ("set check_wiring first", "set speed_rpm 3000", "start"):
            chip.fw.command(line)
        seen = set()
        for _ in range(60):
            chip.advance(round(2e-3 / period_s))
            seen.add(chip.fw.phase if chip.fw.state == "starting" else "")
        tests.append("wiring" in seen)
        assert chip.fw.state == state
        chip.fw.command("stop now")
        chip.advance(round(2e-3 / period_s))
    assert tests == [True, False]


def command(monkeypatch: pytest.MonkeyPatch, *arguments: str, name: str = "check-wiring") -> int:
    """Exit code of `fluxlock check-wiring`, or of another command."""
    monkeypatch.chdir(ROOT)
    monkeypatch.setattr(sys, "argv", ["fluxlock", name, *arguments])
    with pytest.raises(SystemExit) as caught:
        cli.main()
    return int(caught.value.code or 0)


def test_command(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """Exit codes 0 and 1, the remedy in one line, the tables as JSON.

    Verifies: WIRE-05
    """
    assert command(monkeypatch, str(FILE)) == 0
    assert "ok: legs, current sensors and voltage dividers belong together" in capsys.readouterr().out
    assert command(monkeypatch, str(FILE), "--set", "inverter.sensing.current_order='ACB'", "--json") == 1
    said = capsys.readouterr()
    assert "failed: current sensors of B and C are swapped: swap the plugs of B and C" in said.err
    document = json.loads(said.out)
    assert (document["passed"], document["current_order"]) == (False, "ACB")
    assert np.array(document["current_a"]).shape == (3, 3)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["scenarios/none.toml"], "none.toml"),
        (["scenarios/demo.toml"], 'drive.method: the test needs method = "vector" with the same motor'),
        (
            ["scenarios/vector/start.toml", "--port", "/dev/none"],
            "--port: /dev/none: is not a serial port that you may read",
        ),
        (["scenarios/vector/start.toml", "--chip", "--port", "/dev/none"], "exclude each other"),
        (["scenarios/vector/start.toml", "--can", "virtual:x", "--port", "/dev/none"], "exclude each other"),
        (["scenarios/vector/start.toml", "--can", "virtual:x"], "can: with node-ID and bit rate"),
        (["scenarios/vector/start.toml", "--can", "can0", "--set", "can={node_id=5}"], "must be INTERFACE:CHANNEL"),
    ],
)
def test_bad_input(
    arguments: list[str], says: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """One line and exit code 2.

    Verifies: WIRE-05
    """
    assert command(monkeypatch, *arguments) == 2
    err = capsys.readouterr().err
    assert len(err.splitlines()) == 1, err
    assert says in err


def test_no_divider_at_all() -> None:
    """Three inputs without a divider are no machine whose pulses are too short: the drive stops, they are named.

    Verifies: WIRE-03
    """
    measured, chip = carry_out(wired(unconnected=["va", "vb", "vc"]))
    assert (chip.fw.state, measured.fault) == ("fault", "wiring")
    assert [(f.kind, f.inputs) for f in measured.findings] == [("divider", "ABC")]


@pytest.mark.parametrize("order", ["ABC", "BCA"])
def test_the_samples_are_where_they_were(order: str) -> None:
    """After the test, passed or not, the scheduler's offset is that of the parameter block.

    Verifies: WIRE-01
    """
    offsets = []
    carry_out(wired(voltage_order=order), lambda chip: offsets.append(chip.get("sense.scheduler")))
    _, chip = carry_out(wired(voltage_order=order))
    assert [chip.get("sense.scheduler")] == offsets


@pytest.mark.parametrize("file", ["own-spindle.toml", "vector/ipm-injection.toml"])
def test_other_twins_have_no_wrong_wiring(file: str) -> None:
    """The twins of six-step and injection refuse it by name, and do not run as if it were right.

    Verifies: WIRE-05
    """
    scenario = load_scenario(ROOT / "scenarios" / file, ["inverter.sensing.current_order=ACB"])
    with pytest.raises(ConfigError, match=r"sensing: the native program's sensors are wired right"):
        check_playable(scenario)


@pytest.mark.parametrize("order", ORDERS[1:])
def test_legs_in_a_wrong_order(order: str) -> None:
    """Sensors and dividers that agree with each other: it is the gates that are named.

    Verifies: WIRE-02
    """
    measured, _ = carry_out(wired(current_order=order, voltage_order=order))
    assert [finding.kind for finding in measured.findings] == ["leg_wiring"]
    assert (
        "swap the gate signals" in measured.findings[0].remedy or "put the gate signals" in measured.findings[0].remedy
    )
    assert (measured.wiring.current_order, measured.wiring.voltage_order) == (order, order)


def broken(fault: str) -> Scenario:
    """The file's scenario with a fault before the test."""
    return load_scenario(FILE, [f"event=[{{at_s=0.001, fault={fault}}}]", "window=[]", "expect=[]"])


def test_faults_of_the_scenario_happen() -> None:
    """An open lead is told from a leg that does not switch, a driver's fault is named; what a twin has not is refused.

    Verifies: WIRE-03
    """
    measured = on_twin(broken('{kind="open_phase", phases=["B"]}'), 3)
    assert [(f.kind, f.inputs) for f in measured.findings] == [("leg", "B")]
    assert "the leg switches: check the motor's lead B" in measured.findings[0].remedy
    with pytest.raises(WiringError, match=r"fault fault_pin: .* a leg is shorted to a rail"):
        on_twin(broken('{kind="fault_pin"}'), 3)
    with pytest.raises(ConfigError, match="the native program has no stuck_low"):
        on_twin(broken('{kind="stuck_low", phases=["A"]}'), 3)


@pytest.mark.parametrize("rpm", [3000, -3000])
def test_a_turning_rotor_is_named(rpm: float) -> None:
    """Too slow to be waited for: its current is named.

    Verifies: WIRE-07
    """
    scenario = load_scenario(FILE, [f"initial.speed_rpm={rpm}"])
    measured = on_twin(scenario, 3)
    assert [finding.kind for finding in measured.findings] == ["turning"]
    assert not measured.passed


@pytest.mark.parametrize("order", ["ABC", "BCA"])
def test_a_rotor_that_coasts_is_not_caught(order: str) -> None:
    """The drive waits without current, and is left ready.

    Verifies: WIRE-07
    """
    scenario = load_scenario(FILE, ["initial.speed_rpm=20000"]).model_copy(update=PLAIN)
    scenario = scenario.model_copy(update={"inverter": wired(current_order=order).inverter})
    chip = vector_chip_of(scenario, seed=3)
    period_s = chip.timing.period_s
    chip.advance(round(5e-3 / period_s))
    chip.keep_rows(round(1.0 / period_s))
    with pytest.raises(WiringError, match="the rotor turns"):
        lead(ByConsole(chip.fw.command), lambda s: chip.advance(round(s / period_s)))
    assert np.abs(chip.rows()["i"]).max() < 0.01 * scenario.rated_current_a
    chip.advance(round(5e-3 / period_s))
    assert chip.fw.state == "ready"
    assert [chip.fw.command(f"get {name}")[0] for name in ("catch", "check_wiring")] == ["catch 1", "check_wiring off"]


@pytest.mark.parametrize("key", ["noise_lsb=50", "current_full_scale_a=2000"])
def test_noise_is_no_wiring(key: str) -> None:
    """Where the pulses drown in the sensors' noise nothing else is said of them.

    Verifies: WIRE-07
    """
    for order in ("ABC", "BCA"):
        scenario = load_scenario(
            FILE, [f"inverter.sensing.{key}", f"inverter.sensing.current_order={order}"]
        ).model_copy(update=PLAIN)
        for seed in range(5):
            measured = on_twin(scenario, seed)
            assert [finding.kind for finding in measured.findings] == ["noise"], (order, seed)
            assert measured.wiring.current_order is None


def test_dividers_that_were_not_seen_have_no_order() -> None:
    """A machine that bears only pulses too short for the samples: the verdict says so, the order is null.

    Verifies: WIRE-03
    """
    life = life_of(Draw.of(1, 62), "vector")
    measured = on_twin(life.scenario.model_copy(update=PLAIN | {"initial": wired().initial}), 3)
    assert measured.passed and not measured.voltage_v.any()
    assert measured.wiring.voltage_order is None
    assert "the dividers were not seen" in verdict_of(measured).lines[0]


def test_each_stop_is_explained() -> None:
    """A fault before the tables: its name and what to do; tables of an earlier test are not judged.

    Verifies: WIRE-03
    """
    told = lead_of(wired())
    for fault, says in (
        ("phase_over_current", "shorted to each other"),
        ("fault_pin", "a switch conducts for ever"),
        ("rotor_spinning", "which must stop first"),
        ("under_voltage", "before the test had ended"),
    ):
        assert says in stopped(fault)
        with pytest.raises(WiringError, match=fault):
            judge(replace(told, fault=fault), wired())


def lead_of(scenario: Scenario) -> Told:
    """What a drive tells."""
    chip = vector_chip_of(scenario, seed=3)
    period_s = chip.timing.period_s
    chip.advance(round(5e-3 / period_s))
    return lead(ByConsole(chip.fw.command), lambda s: chip.advance(round(s / period_s)))[0]


def test_log_of_faults_is_no_answer() -> None:
    """The chip's run ends with the log of faults: `fault wiring tick 74` is no value.

    Verifies: WIRE-03
    """
    lines = ["state fault", "fault wiring", "ok", "state fault", "fault wiring tick 74", "ok"]
    assert first_answers(lines) == {"state": "fault", "fault": "wiring"}


@pytest.mark.parametrize("letter", "ABC")
def test_a_shorted_winding_is_named(letter: str) -> None:
    """Half of a phase's turns is shorted, a quarter of its inductance left; unequal phases of the file are none.

    Verifies: WIRE-03
    """
    scenario = wired()
    shorted = [
        henry / (4.0 if phase == letter else 1.0)
        for phase, henry in zip("ABC", scenario.motor.inductance_h, strict=True)
    ]
    motor = scenario.motor.model_copy(update={"inductance_h": tuple(shorted)})

    def short(chip: VectorChip) -> None:
        set_machine(chip.plant, motor, scenario.inverter.on_resistance_ohm)

    measured, _ = carry_out(scenario, short)
    assert [(f.kind, f.inputs) for f in measured.findings] == [("winding", letter)]
    assert not measured.passed
    measured, _ = carry_out(scenario.model_copy(update={"motor": motor}))
    assert measured.passed


@pytest.mark.parametrize("ratio", [1.0, 1.5, 4.0])
def test_anisotropy_is_that_of_the_admittance(ratio: float) -> None:
    """Of a salient machine at any angle, and of three phases of which one differs.

    Verifies: WIRE-03
    """
    clarke = math.sqrt(2 / 3) * np.array([[1.0, -0.5, -0.5], [0.0, math.sqrt(0.75), -math.sqrt(0.75)]])
    for angle in np.linspace(0.0, 3.0, 7):
        turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
        table = clarke.T @ turn @ np.diag([1.0, ratio]) @ turn.T @ clarke
        assert anisotropy(table) == pytest.approx(ratio)


def test_offsets_are_told() -> None:
    """Those of the inverter file, which the drive measures before it is ready.

    Verifies: WIRE-08
    """
    scenario = wired(offset_lsb=[40, -20, 0])
    measured, _ = carry_out(scenario)
    lsb_a = scenario.inverter.sensing.current_full_scale_a / 2048
    assert measured.passed
    assert measured.offset_a == pytest.approx([40 * lsb_a, -20 * lsb_a, 0.0], abs=1e-3)


def test_population_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Counts and limits in one line, each trial in a file; 1 if something is wrong, 2 for another method.

    Verifies: WIRE-04
    """
    monkeypatch.setattr(wirings, "FOLDER", tmp_path)
    words = ("run", "--wirings", "1", "--lives", "1", "--jobs", "1")
    assert command(monkeypatch, *words, name="population") == 0
    assert "ok: 7 tests on 1 machines, 0 wrong" in capsys.readouterr().out
    (machine,) = json.loads((tmp_path / "wiring.json").read_text())["machines"]
    assert len(machine["trials"]) == 7
    monkeypatch.setattr(wirings, "LONGEST_S", 0.0)
    assert command(monkeypatch, *words, name="population") == 1
    assert "machine 0, right: " in capsys.readouterr().err
    assert command(monkeypatch, *words, "--method", "six-step", name="population") == 2
    assert "--wirings: goes with --method vector, not six-step" in capsys.readouterr().err
