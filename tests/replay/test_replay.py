# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A log is put into the twin, and the machine behind it is found."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from fluxlock.cli import app
from fluxlock.config import ConfigError, Scenario, load_scenario
from fluxlock.native.vector_chip import set_machine
from fluxlock.native.vector_run import Play
from fluxlock.replay.fit import PARAMETERS, Replay
from fluxlock.replay.table import NEEDED, read_table

VECTOR = "scenarios/vector/start.toml"
TRUE = {"R": 1.15, "L": 0.88, "psi": 1.07, "J": 1.25}  # of the motor file
KEYS = {"R": "resistance_ohm", "L": "inductance_h", "psi": "psi_vs", "J": "inertia_kgm2"}
WITHIN = 0.03
BEGIN_S, END_S, EVERY = 0.01, 0.35, 10
HEAD = "t [s],target [r/min],speed [r/min],vdc [V],ia [A],ib [A],ic [A],idc [A],va [V],vb [V],vc [V]"


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return load_scenario(VECTOR, ["event=[]", "window=[]", "expect=[]", f"duration_s={END_S}"])


@pytest.fixture(scope="module")
def log(scenario: Scenario, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Of a machine that no file names, with another seed of the noise."""
    motor = scenario.motor
    assert not any(motor.mutual_h) and motor.inductance_q_h is None  # else these would have to be changed too
    own = {name: getattr(motor, key) for name, key in KEYS.items()}
    changed = [
        f"motor.{KEYS[name]}={[factor * x for x in own[name]] if name != 'J' else factor * own[name]}"
        for name, factor in TRUE.items()
    ]
    play = Play(scenario, 7)
    set_machine(play.chip.plant, load_scenario(VECTOR, changed).motor, scenario.inverter.on_resistance_ohm)
    play.advance(BEGIN_S)
    play.command("set speed_rpm 30000")
    play.command("start")
    play.advance(END_S)
    assert play.uart == ["ok", "ok"]
    rows = play.data(0.0).records[::EVERY]
    time = rows["t_cycle"] / play.data(0.0).clock_hz
    target = np.where(time >= BEGIN_S, 30_000.0, 0.0)
    speed = rows["omega_e"] / scenario.motor.pole_pairs * 30 / np.pi
    names = ("vdc", "ia", "ib", "ic", "idc", "va", "vb", "vc")
    table = np.column_stack([time, target, speed, *(rows[name] for name in names)])
    path = tmp_path_factory.mktemp("log") / "log.csv"
    np.savetxt(path, table, delimiter=",", header=HEAD, comments="", fmt="%.7g")
    return path


def test_a_machine_that_no_file_names_is_found(scenario: Scenario, log: Path) -> None:
    """R, L, flux and inertia within 3 %, and a residual well below that of the motor file.

    Verifies: REPLAY-01
    """
    found = Replay(scenario, read_table(log), 1).fit()
    for name in PARAMETERS:
        assert found.factors[name] == pytest.approx(TRUE[name], rel=WITHIN), found
    assert all(found.residual[name] < 0.5 * found.before[name] for name in ("speed", "current", "power")), found


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "is empty"),
        ("t [s],speed [r/min]\n", "column vdc: is missing"),
        (HEAD.replace("vdc [V]", "vdc [A]") + "\n", "column vdc: unit is A"),
        (HEAD.replace("speed [r/min]", "speed") + "\n", "column speed: unit is missing"),
        (HEAD + "\n" + "0,0,0,1,0,0,0,0,0,0,0\n" * 60, "row 2: its time is not after"),
        (HEAD + "\n" + "0,0,0,1,0,0,0,0,0,0\n" * 60, "row 1: vc"),
        (HEAD + "\n" + "0,0,x,1,0,0,0,0,0,0,0\n" * 60, "row 1: speed [r/min] is 'x'"),
        (HEAD + "\n0,0,0,1,0,0,0,0,0,0,0\n", "has 1 rows"),
        ("\0\1\2", "column time: is missing"),
    ],
)
def test_bad_log(tmp_path: Path, text: str, said: str) -> None:
    """Each is one line with file, row or column, and what to do.

    Verifies: REPLAY-02
    """
    path = tmp_path / "log.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError) as caught:
        read_table(path)
    assert said in str(caught.value)


def lines(**columns: float) -> str:
    """A log in which nothing changes."""
    row = {name: 0.0 for name in (*NEEDED, "idc")} | {"vdc": 25.0} | columns
    head = {"time": "t_s", "target": "target_rpm", "speed": "speed_rpm"}
    units = {"vdc": "vdc [V]"}
    names = [head.get(name, units.get(name, f"{name} [A]")) for name in row]
    body = [[0.001 * k, *list(row.values())[1:]] for k in range(60)]
    return "\n".join([",".join(names), *(",".join(str(value) for value in values) for values in body)])


@pytest.mark.parametrize(
    ("file", "columns", "said"),
    [
        ("scenarios/own-spindle.toml", {"target": 1000.0}, "vector control only"),
        (VECTOR, {}, "nothing to replay"),
        (VECTOR, {"target": 1000.0, "speed": 900.0}, "cut the log where the rotor stands"),
    ],
)
def test_a_log_that_does_not_fit(tmp_path: Path, file: str, columns: dict[str, float], said: str) -> None:
    """The command names what is wrong in one line.

    Verifies: REPLAY-02
    """
    path = tmp_path / "log.csv"
    path.write_text(lines(**columns), encoding="utf-8")
    result = CliRunner().invoke(app, ["replay", str(path), file])
    assert isinstance(result.exception, ConfigError) and said in str(result.exception)


def test_units(tmp_path: Path) -> None:
    """Units of the head become s, r/min, A and V; a column that nobody knows is left out."""
    path = tmp_path / "log.csv"
    head = "time [ms],demand [1/s],speed [rad/s],vdc [mV],ia [mA],ib [A],ic [A],note"
    path.write_text("\n".join([head, *(f"{k},1,{np.pi},25000,500,0,0,x" for k in range(60))]), encoding="utf-8")
    table = read_table(path)
    assert table["time"][1] == pytest.approx(1e-3) and table["target"][0] == 60.0
    assert table["speed"][0] == pytest.approx(30.0) and table["vdc"][0] == 25.0 and table["ia"][0] == 0.5
    assert not table.has_voltages
