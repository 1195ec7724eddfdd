# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""`fluxlock first-start`: at a simulated bench, and at a board behind a terminal; what ends it, by name."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from fluxlock.base.stage import Progress
from fluxlock.cli import app
from fluxlock.commission.simulate import Measured
from fluxlock.config import ConfigError, Scenario, load_motor, load_scenario
from fluxlock.firmware.host import one_at_a_time
from fluxlock.first_start.bench import SimulatedBench
from fluxlock.first_start.guide import TerminalGuide
from fluxlock.first_start.steps import FirstStart
from fluxlock.first_start.turn import COAST_S, Lead, TurnError
from fluxlock.flash import board_console
from fluxlock.flash.board_console import SilentError
from tests.first_start.benches import TwinBoard, averaged_identify
from tests.flash.board_terminal import BoardTerminal, behind_a_terminal

SPINDLE = "scenarios/own-spindle.toml"
CONVERSION = "inverter.sensing.conversion_s=0.68e-6"  # of the boards


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """The averaged bench in place of the simulated chip, which takes a minute and a half."""

    def identify(self: SimulatedBench, scenario: Scenario, progress: Progress) -> Measured:
        return averaged_identify(scenario)

    monkeypatch.setattr(SimulatedBench, "identify", identify)


def first_start(*arguments: str, answers: str = "") -> tuple[int, str, str]:
    """The command; exit code, both outputs."""
    result = CliRunner().invoke(app, ["first-start", *arguments], input=answers)
    if isinstance(result.exception, ConfigError):
        raise result.exception
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result.exit_code, result.stdout, result.stderr


@pytest.mark.usefixtures("quick")
def test_at_a_simulated_bench(tmp_path: Path) -> None:
    """All steps, each with its limits before it; motor file, report and plots are there; the user has said yes to each.

    Verifies: FST-01, FST-02
    """
    code, said, told = first_start(SPINDLE, "--out", str(tmp_path), answers="y\n" * 5)
    assert code == 0, (said, told)
    for step, text in (("1/4 wiring", "rotor stays"), ("2/4 identify", "freely"), ("3/4 first turn", "A and")):
        assert step in told and text in told
    assert told.count("go on?") == 4 and told.count("did the shaft turn") == 1
    assert "ok: the machine is wired, measured, turns" in said
    report = json.loads((tmp_path / "first-start.json").read_text(encoding="utf-8"))
    assert report["verdict"]["passed"] and list(report["steps"]) == ["wiring", "identify", "first turn", "tune"]
    scenario = load_scenario(SPINDLE)
    assert load_motor(tmp_path / "motor.toml").psi_vs[0] == pytest.approx(
        scenario.motor.psi_vs[0] * scenario.motor.emf_fundamental, rel=0.03
    )
    assert all((tmp_path / name).stat().st_size > 10_000 for name in ("motor.png", "turns.png"))


@pytest.mark.usefixtures("quick")
def test_wrong_wires_end_it(tmp_path: Path) -> None:
    """Two sensors swapped: the first step says which, nothing turns, exit code 1.

    Verifies: FST-03
    """
    order = "inverter.sensing.current_order='ACB'"
    code, _, told = first_start("scenarios/vector/start.toml", "--yes", "--out", str(tmp_path), "--set", order)
    assert code == 1 and "2/4" not in told
    assert "failed: wiring: current sensors of B and C are swapped" in told, told
    report = json.loads((tmp_path / "first-start.json").read_text(encoding="utf-8"))
    assert not report["verdict"]["passed"] and not (tmp_path / "motor.toml").exists()


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize(
    ("answers", "text"),
    [
        ("y\nn\n", "stopped before the step identify"),
        ("y\ny\ny\nn\n", "first turn: the other way is wanted: swap two leads of the motor"),
        ("y\n", "stopped by hand in the step identify"),
    ],
    ids=["no", "other way", "end of input"],
)
def test_stopped_by_hand(answers: str, text: str, tmp_path: Path) -> None:
    """A no ends it, as does a shaft that turns the other way, and an input that is closed; each with exit code 1.

    Verifies: FST-03
    """
    code, said, told = first_start(SPINDLE, "--out", str(tmp_path), answers=answers)
    assert code == 1 and f"failed: {text}" in told.replace("[Y/n]:", "\n"), (said, told)
    assert not json.loads((tmp_path / "first-start.json").read_text(encoding="utf-8"))["verdict"]["passed"]


def test_at_a_board(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Three programs are written and started, each step runs on its own; at the end the gates are off.

    Verifies: FST-04
    """
    monkeypatch.setattr(board_console, "REPLY_S", 60.0)  # a twin may be compiled first
    scenario = load_scenario(SPINDLE, [CONVERSION])
    board = BoardTerminal(TwinBoard(scenario), around=one_at_a_time)
    with behind_a_terminal(board.serve) as port:
        arguments = ("--yes", "--out", str(tmp_path), "--set", CONVERSION, "--port", str(port))
        code, said, told = first_start(SPINDLE, *arguments)
    assert code == 0, (said, told)
    assert board.starts == 3 and told.count("reset the board") == 3
    # Gates off, and the settings as before.
    end = board.lines[-4:]
    assert end[0] == "stop now" and [line.split()[1] for line in end[1:]] == [
        "current_limit_a",
        "command_timeout_ms",
        "speed_rpm",
    ]


def test_a_board_that_nobody_resets(tmp_path: Path) -> None:
    """One line that says what to do, exit code 1.

    Verifies: FST-04, FST-03
    """
    with behind_a_terminal(BoardTerminal(None).serve) as port:
        arguments = ("--yes", "--out", str(tmp_path), "--set", CONVERSION, "--wait-s", "0.2", "--port", str(port))
        code, _, told = first_start(SPINDLE, *arguments)
    assert code == 1 and "failed: wiring: no loader answers: reset the board" in told


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ([SPINDLE, "--port", "/dev/null"], "conversion_s"),
        ([SPINDLE, "--port", "/dev/null", "--set", CONVERSION], "does not work as a serial port"),
        (["scenarios/five-phase/yu.toml"], "phases: the steps are of three phases"),
        (["scenarios/six-step/hall.toml"], "the native program has no Hall sensors"),
        ([SPINDLE, "--out", "pyproject.toml/here"], "--out"),
    ],
)
def test_refused_before_anything(arguments: list[str], text: str, tmp_path: Path) -> None:
    """What cannot be led through the steps is named at once.

    Verifies: FST-03
    """
    out = [] if "--out" in arguments else ["--out", str(tmp_path / "out")]
    with pytest.raises(ConfigError) as refused:
        first_start(*arguments, *out, "--yes")
    assert text in str(refused.value)


def test_a_machine_without_room_for_a_turn(tmp_path: Path) -> None:
    """Whose least speed is above what a first turn and its step may have.

    Verifies: FST-03
    """
    scenario = load_scenario(SPINDLE)
    slow = scenario.model_copy(update={"motor": scenario.motor.model_copy(update={"max_speed_rpm": 30.0})})
    with pytest.raises(ConfigError, match="too near this highest speed"):
        FirstStart(slow, tmp_path, 0.6, TerminalGuide(4, False))


class Scripted:
    """A drive whose status is a list of answers."""

    def __init__(self, *status: str) -> None:
        self.status, self.lines, self.now_s = iter(status), list[str](), 0.0
        self.last = "state ready|measured_rpm 0|motor_a 0"

    def ask(self, line: str) -> list[str]:
        """See `Drive`."""
        self.lines.append(line)
        if line == "status":
            self.last = next(self.status, self.last)
            return [*self.last.split("|"), "ok"]
        if line.startswith("get "):
            value = {"state": "ready", "phase": "ramp"}.get(line[4:], "7")
            return [f"{line[4:]} {value}", "ok"]
        return ["error: not ready"] if line == "start" and self.last == "refuses" else ["ok"]

    def wait(self, seconds: float) -> None:
        """See `Drive`."""
        self.now_s += seconds


RUNS = "state running|measured_rpm {}|motor_a 1"


def reach(drive: Scripted) -> None:
    """A turn to 1000 r/min within two seconds."""
    Lead(drive).reach(1000, 2.0)


@pytest.mark.parametrize(
    ("status", "text"),
    [
        (["state starting|measured_rpm 0|motor_a 1", "state fault|fault stalled|measured_rpm 0|motor_a 0"],
         "fault stalled in the phase ramp on the way to 1000"),
        ([RUNS.format(700)], "700 r/min in the state running, 2 s after 1000"),
        ([RUNS.format(-1000)], "-1000 r/min in the state running"),
        (["state running|motor_a 1"], "status cannot be read"),
    ],
    ids=["fault", "slow", "backwards", "unreadable"],
)  # fmt: skip
def test_a_machine_that_does_not_turn_as_asked(status: list[str], text: str) -> None:
    """The message says what it does, in which phase.

    Verifies: FST-03
    """
    with pytest.raises(TurnError, match=text):
        reach(Scripted(*status))


def test_overshoot_and_time_of_a_step() -> None:
    """Beyond the target over it; until the speed is there for good, not for a moment.

    Verifies: FST-05
    """
    speeds = [0, 500, 1000, 1080, 1020, *[1003] * 40]
    lead = Lead(Scripted(*map(RUNS.format, speeds)))
    stepped = lead.reach(1000, 2.0)
    assert stepped.overshoot == pytest.approx(0.08) and not stepped.passed
    assert stepped.settled_s == pytest.approx(0.02 * 6)
    assert lead.record.speed_rpm[:5] == speeds[:5]


def test_settings_come_back_whatever_happens() -> None:
    """Also after a drive that is never ready again, and one that refuses.

    Verifies: FST-04
    """
    drive = Scripted("state stopping|measured_rpm 900|motor_a 0")
    lead = Lead(drive)
    with pytest.raises(TurnError, match=f"not ready {COAST_S:g} s after"), lead.within(2.5):
        lead.rest()
    assert drive.lines[3:5] == ["set current_limit_a 2.500", "set command_timeout_ms 500"]
    assert drive.lines[-4:] == ["stop now", "set current_limit_a 7", "set command_timeout_ms 7", "set speed_rpm 7"]
    drive = Scripted()
    drive.last = "refuses"
    with pytest.raises(TurnError, match="the drive refuses 'start'"):
        reach(drive)


def test_a_board_that_falls_silent(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the silence was, not that the gates could not be told.

    Verifies: FST-03
    """
    drive = Scripted()

    def silent(line: str) -> list[str]:
        raise SilentError("no answer")

    with pytest.raises(TurnError, match="first"), Lead(drive).within(1.0):
        monkeypatch.setattr(drive, "ask", silent)
        raise TurnError("first")
