# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The command line as a user meets it: output, exit codes, no tracebacks.

The simulation is replaced by synthetic data.
"""

from __future__ import annotations

import fcntl
import io
import json
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from importlib.metadata import version
from pathlib import Path
from types import ModuleType
from typing import Any

import click
import pytest
import typer
import typer.core
import typer.rich_utils
from rich.console import Console

from fluxlock import cli
from fluxlock.base.paths import ROOT
from fluxlock.base.progress import ProgressBar, counting_bars
from fluxlock.base.stage import BUILDING, ProgressInfo
from fluxlock.config import Scenario
from fluxlock.cosim import outcome
from fluxlock.cosim.run import rejected_lines
from fluxlock.interface.settings import SettingsError
from fluxlock.results.rundata import Rejection, RunData, SimulationFault, load_trace
from fluxverify import cli as verify_cli
from fluxverify.campaign import command as campaign
from fluxverify.campaign.grid import DRIVES
from tests.results.synthetic import Drive, make_run

Invoke = Callable[..., tuple[int, str, str]]

ASYMMETRIC = ROOT / "motors" / "motor-1-asymmetric.toml"
DEMO = str(ROOT / "scenarios" / "demo.toml")
SHORT = [
    "--set",
    "duration_s=0.02",
    "--set",
    'event=[{at_s=0.001,speed_rpm=60000},{at_s=0.001,command="start"}]',
    "--set",
    'window=[{name="steady",from_s=0.002,to_s=0.01},{name="loaded",from_s=0.01,to_s=0.018}]',
    "--set",
    "expect=["
    + ",".join(
        f'{{window="{window}",metric="commutation_error_deg.{kind}",min=-0.3,max=0.3}}'
        for window in ("steady", "loaded")
        for kind in ("mean", "rms")
    )
    + "]",
]


@pytest.fixture
def invoke(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Invoke:
    """Call main() with arguments; returns exit code, stdout, stderr."""

    def call(*arguments: str, command: ModuleType = cli) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", [command.__name__.partition(".")[0], *arguments])
        monkeypatch.setenv("COLUMNS", "120")
        with pytest.raises(SystemExit) as caught:
            command.main()
        out, err = capsys.readouterr()
        return int(caught.value.code or 0), out, err

    return call


@pytest.fixture
def simulator(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Replace the co-simulation; `calls` collects what it was asked for, `drive` is what it returns."""
    module = ModuleType("fluxlock.cosim.run")
    state: dict[str, Any] = {"calls": [], "drive": Drive(), "fault": None, "rejected": [], "interrupt": False}
    state["uart"] = ["state ready", "fault none", "ok", "now none", "ok"]

    def run_scenario(
        scenario: Scenario,
        out_dir: Path,
        seed: int,
        waves: bool,
        progress: Callable[[ProgressInfo], None],
        native: None,
        gdb: None,
        load: None,
    ) -> RunData:
        state["calls"].append((scenario.name, out_dir, seed, waves))
        progress(ProgressInfo(0.01, 0.02, 60_000.0, 1.1e6, "run"))
        if state["interrupt"]:
            raise KeyboardInterrupt
        data = make_run(state["drive"])
        data.seed = seed
        data.rejected = state["rejected"]
        data.uart = state["uart"]
        if state["fault"]:
            raise SimulationFault(state["fault"], data)
        return data

    module.run_scenario = run_scenario
    monkeypatch.setitem(sys.modules, "fluxlock.cosim.run", module)
    return state


@pytest.fixture
def without_plots(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave out the plots, which take most of the time of a run without a simulation."""
    monkeypatch.setattr(outcome, "write_plots", lambda *_: [])


def test_run_that_passes(invoke: Invoke, simulator: dict[str, Any], tmp_path: Path) -> None:
    """Exit code 0; result, trace and plots are written and the table is printed.

    Verifies: FRONT-06, FRONT-09
    """
    code, out, err = invoke("run", DEMO, "--out", str(tmp_path / "o"), *SHORT, "--seed", "5", "--waves")
    assert code == 0, err
    assert simulator["calls"] == [("demo", tmp_path / "o", 5, True)]
    assert {p.name for p in (tmp_path / "o").iterdir()} == {
        "result.json",
        "trace.npz",
        "overview.png",
        "zoom.png",
        "simulator",
    }
    assert "crossing error rms" in out and "zcp" not in out
    assert "commutation error rms" in out and "steady" in out and "loaded" in out
    result = json.loads((tmp_path / "o" / "result.json").read_text())
    assert result["verdict"]["passed"] and result["trips"] == []
    assert out.startswith("ok: ") and out.splitlines()[0] == f"ok: {result['verdict']['lines'][0]}"
    assert result["metrics"]["steady"]["commutation_error_deg"]["rms"] < 0.01
    run = result["run"]
    assert run["seed"] == 5 and run["cycles"] == 1_000_000 and run["overruns"] == 0
    assert run["cycles_per_s"] == pytest.approx(500_000) and run["realtime_factor"] == pytest.approx(0.01)
    assert run["isr"]["control"] == {"min": 300, "mean": 350.5, "max": 400, "count": 1000}
    versions = run["tool_versions"]
    assert "python" in versions and versions["verilator_program"] and versions["cxx"]
    assert result["rejected"] == [] and "git_revision" in run
    assert result["scenario"]["settings"]["motor"]["pole_pairs"] == 1
    assert load_trace(tmp_path / "o" / "trace.npz").seed == 5


@pytest.mark.usefixtures("without_plots")
def test_missed_expectation_fails(invoke: Invoke, simulator: dict[str, Any], tmp_path: Path) -> None:
    """Exit code 1 and a line that names window, metric, value and limit.

    Verifies: FRONT-06, FRONT-07
    """
    simulator["drive"] = Drive(commutation_error=lambda k: 1.0)
    code, out, err = invoke("run", DEMO, "--out", str(tmp_path), *SHORT)
    assert code == 1
    assert re.search(
        r"^failed: steady: commutation_error_deg.rms is 1(\.00\d)?, expected min -0.3 and max 0.3$", err, re.M
    ), err
    assert re.search(r"1\.00\d !", out), out
    result = json.loads((tmp_path / "result.json").read_text())
    assert sum(not e["pass"] for e in result["expectations"]) == 4


@pytest.mark.usefixtures("without_plots")
def test_trip_fails_unless_expected(invoke: Invoke, simulator: dict[str, Any], tmp_path: Path) -> None:
    """An unexpected trip fails the run, an expected one passes it, an expected one that stays away fails.

    Verifies: FRONT-06, FRONT-07, FRONT-14
    """
    expects = [*SHORT, "--set", 'expect_trip=["phase_current"]']
    simulator["drive"] = Drive(trip_at_s=0.019, trip_mask=1)
    code, out, err = invoke("run", DEMO, "--out", str(tmp_path), *SHORT)
    assert code == 1 and "failed: trip at 0.019000 s: phase_current" in err and "phase_current" in out
    assert invoke("run", DEMO, "--out", str(tmp_path), *expects)[0] == 0
    simulator["drive"] = Drive()
    code, _, err = invoke("run", DEMO, "--out", str(tmp_path), *expects)
    assert code == 1 and "expected trip did not happen: phase_current" in err


STATUS = ["state running", "fault none", "duty 0.5", "ok"]
FAILED_START = [*STATUS, "state fault", "fault start_failed", "ok", "now start_failed", "fault lost_lock tick 77", "ok"]
OVER_CURRENT = ["state fault", "fault phase_over_current", "ok", "now phase_over_current", "ok", "overruns 0 0", "ok"]


@pytest.mark.usefixtures("without_plots")
def test_fault_fails_unless_expected(invoke: Invoke, simulator: dict[str, Any], tmp_path: Path) -> None:
    """A fault in which the drive ends, without a trip, fails the run by name; an expected one must come.

    Verifies: FRONT-06, FRONT-31
    """
    simulator["uart"] = FAILED_START
    code, out, err = invoke("run", DEMO, "--out", str(tmp_path), *SHORT)
    assert code == 1 and err.splitlines()[-2] == "failed: the drive ended in fault start_failed"
    page = err.splitlines()[-1].removeprefix("what to do: ")
    assert (ROOT / page).is_file()
    assert "fault at the end: start_failed" in out
    result = json.loads((tmp_path / "result.json").read_text())
    assert result["fault"] == "start_failed"
    assert load_trace(tmp_path / "trace.npz").fault == "start_failed"
    assert invoke("run", DEMO, "--out", str(tmp_path), *SHORT, "--set", "expect_fault=start_failed")[0] == 0
    code, _, err = invoke("run", DEMO, "--out", str(tmp_path), *SHORT, "--set", "expect_fault=overspeed")
    assert code == 1 and "failed: expected fault is not there at the end: overspeed\n" in err
    assert "failed: the drive ended in fault start_failed\n" in err
    simulator["uart"] = [*FAILED_START, *STATUS]
    code, out, err = invoke("run", DEMO, "--out", str(tmp_path), *SHORT, "--set", "expect_fault=start_failed")
    assert code == 1 and "failed: expected fault is not there at the end: start_failed" in err
    assert "fault at the end" not in out
    assert json.loads((tmp_path / "result.json").read_text())["fault"] is None


@pytest.mark.usefixtures("without_plots")
def test_fault_of_a_trip_has_one_cause(invoke: Invoke, simulator: dict[str, Any], tmp_path: Path) -> None:
    """The fault that a trip means is judged with the trip; lost locks, which the drive ends itself, are not.

    Verifies: FRONT-31
    """
    simulator |= {"drive": Drive(trip_at_s=0.019, trip_mask=1), "uart": OVER_CURRENT}
    _, _, err = invoke("run", DEMO, "--out", str(tmp_path), *SHORT)
    assert [x for x in err.splitlines() if x.startswith("failed")] == ["failed: trip at 0.019000 s: phase_current"]
    expects = [*SHORT, "--set", 'expect_trip=["phase_current"]']
    assert invoke("run", DEMO, "--out", str(tmp_path), *expects)[0] == 0
    simulator["uart"] = ["state fault", "fault hall_sensor", "ok"]
    assert invoke("run", DEMO, "--out", str(tmp_path), *expects)[0] == 1
    simulator |= {"drive": Drive(trip_at_s=0.019, trip_mask=8), "uart": ["state fault", "fault lost_lock", "ok"]}
    expects = [*SHORT, "--set", 'expect_trip=["lost_lock"]']
    code, _, err = invoke("run", DEMO, "--out", str(tmp_path), *expects)
    assert code == 1 and "failed: the drive ended in fault lost_lock" in err
    assert invoke("run", DEMO, "--out", str(tmp_path), *expects, "--set", "expect_fault=lost_lock")[0] == 0


@pytest.mark.usefixtures("without_plots")
def test_rejected_command_fails(invoke: Invoke, simulator: dict[str, Any], tmp_path: Path) -> None:
    """A console line that the drive refused: exit code 1, line, time and reason in words and in the result.

    Verifies: FRONT-17
    """
    simulator["rejected"] = [Rejection(0.012, "set sped 1", "unknown name")]
    code, _, err = invoke("run", DEMO, "--out", str(tmp_path), *SHORT)
    assert code == 1 and 'failed: console at 0.012000 s: "set sped 1" was rejected: unknown name' in err
    result = json.loads((tmp_path / "result.json").read_text())
    assert result["rejected"] == [{"time_s": 0.012, "line": "set sped 1", "reason": "unknown name"}]


def test_refused_and_unanswered_lines_are_rejected() -> None:
    """A line without answer counts as rejected.

    Verifies: FRONT-17
    """
    sent = [(50, "start", "ok"), (100, "status", "error: no valid parameters"), (150, "clear", None)]
    assert rejected_lines(sent, 50.0) == [
        Rejection(2.0, "status", "no valid parameters"),
        Rejection(3.0, "clear", "no reply"),
    ]
    assert rejected_lines([(50, "start", "ok")] * 3, 50.0) == []


def test_progress_ends_at_the_duration() -> None:
    """What the simulator does after the end of the run does not show.

    Verifies: FRONT-06
    """
    console = Console(file=io.StringIO(), width=120)
    with ProgressBar(console, 0.05) as bar:
        bar(ProgressInfo(0.054, 0.05, 0.0, 1e6, "simulating"))
        assert bar._progress.tasks[0].completed == 0.05


def test_progress_without_a_terminal() -> None:
    """A file gets a line a stage and a tenth of the run, a terminal the bar alone.

    Verifies: FRONT-06
    """
    console = Console(file=io.StringIO(), width=120, force_terminal=False)
    with ProgressBar(console, 1.0) as bar:
        for t_s, phase in (
            (0.0, f"{BUILDING} chip"),
            (0.0, f"{BUILDING} chip"),
            (0.0, "simulating"),
            (0.26, "simulating"),
            (0.27, "simulating"),
            (1.01, "simulating"),
        ):
            bar(ProgressInfo(t_s, 1.0, 50.0, 1e6, phase))
    lines = [line.split(" s ")[0].split() for line in console.file.getvalue().splitlines()]
    assert lines == [[BUILDING, "chip", "0.000/1.000"]] + [
        ["simulating", f"{t}/1.000"] for t in ("0.000", "0.260", "1.000")
    ]


@pytest.mark.parametrize("terminal", (False, True))
def test_counting_bars(terminal: bool) -> None:
    """A file gets a line a name and a tenth of what is counted, and nothing twice; a terminal the bar.

    Verifies: FRONT-06
    """
    console = Console(file=io.StringIO(), width=120, force_terminal=terminal)
    with counting_bars(console) as bars:
        task = bars.add_task("grid", total=None)
        bars.update(task, total=30)
        for _ in range(30):
            bars.advance(task)
        bars.update(task, description="finished last")
    written = console.file.getvalue()
    assert ("\x1b" in written) == terminal
    if not terminal:
        lines = [line.split()[:-1] for line in written.splitlines()]
        counts = [["grid", f"{done}/30"] for done in range(0, 31, 3)]
        assert lines == [*counts, ["finished", "last", "30/30"]]


def test_progress_counts_the_simulation() -> None:
    """Times beside the bar begin anew when the building has ended.

    Verifies: FRONT-06
    """
    clock = [0.0]
    bar = ProgressBar(Console(file=io.StringIO(), width=120, get_time=lambda: clock[0]), 1.0)
    task = bar._progress.tasks[0]
    for at_s, t_s, phase, elapsed_s in (
        (70.0, 0.0, f"{BUILDING} chip", 70.0),
        (80.0, 0.0, f"{BUILDING} firmware", 80.0),
        (100.0, 0.0, "simulating", 0.0),
        (110.0, 0.2, "simulating", 10.0),
        (120.0, 0.4, "simulating", 20.0),
    ):
        clock[0] = at_s
        bar(ProgressInfo(t_s, 1.0, 0.0, 1e6, phase))
        assert task.elapsed == elapsed_s
    assert task.time_remaining == 30.0


def commands(group: typer.core.TyperGroup, *names: str) -> Iterator[tuple[list[str], click.Command]]:
    """All commands below a group, with the words that call them."""
    for name, command in group.commands.items():
        words = [*names, name]
        if isinstance(command, typer.core.TyperGroup):
            yield from commands(command, *words)
        else:
            yield words, command


def test_help_shows_all_that_is_written(invoke: Invoke, monkeypatch: pytest.MonkeyPatch) -> None:
    """No word of a help text is taken for markup.

    Verifies: FRONT-34
    """
    monkeypatch.setattr(typer.rich_utils, "MAX_WIDTH", 400)
    found = list(commands(typer.main.get_command(cli.app)))
    assert len(found) > 10
    for words, command in found:
        code, out, _ = invoke(*words, "--help")
        assert code == 0
        for parameter in command.params:
            text = getattr(parameter, "help", None) or ""
            assert text.replace("\\[", "[") in out, words
    assert "with the table [can]" in invoke("can", "--help")[1]
    assert invoke("--version") == (0, f"fluxlock {version('fluxlock')}\n", "")


def test_help_names_every_drive_of_the_campaign(invoke: Invoke, monkeypatch: pytest.MonkeyPatch) -> None:
    """The drives that the command takes are those of its help.

    Verifies: FRONT-34
    """
    monkeypatch.setattr(typer.rich_utils, "MAX_WIDTH", 400)  # the names in one line
    names = ", ".join(drive.name for drive in DRIVES)
    assert f"{names}; all without" in invoke("campaign", "--help", command=verify_cli)[1]


def test_nothing_to_show(invoke: Invoke, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """`campaign --show` before any run has finished: one line, nothing written.

    Verifies: FRONT-34
    """
    monkeypatch.setattr(campaign, "RESULT", tmp_path / "campaign.json")
    monkeypatch.setattr(campaign, "FOLDER", tmp_path / "runs")
    expected = "error: --show: no run has finished with this seed on this chip and firmware; run it without --show"
    assert invoke("campaign", "--show", command=verify_cli) == (2, "", f"{expected}\n")
    assert not list(tmp_path.iterdir())
    # Runs of another firmware.
    monkeypatch.setattr(campaign, "run_drive", lambda *_: [])
    row = tmp_path / "runs" / DRIVES[0].name / "moment" / campaign.ROW_FILE
    row.parent.mkdir(parents=True)
    row.touch()
    assert invoke("campaign", "--show", command=verify_cli) == (2, "", f"{expected}\n")
    assert not (tmp_path / "campaign.json").exists()


@pytest.mark.parametrize(
    ("scenario", "bus", "text"),
    [
        ("can", "pigeon:1", "--can: pigeon:1: pigeon is no interface of python-can"),
        ("can", "slcan", "--can: slcan: must be INTERFACE:CHANNEL, for instance socketcan:vcan0"),
        ("demo", "virtual:x", "demo.toml: can: is missing"),
    ],
)
def test_refused_bus_leaves_no_folder(invoke: Invoke, tmp_path: Path, scenario: str, bus: str, text: str) -> None:
    """A bus that cannot be had is one line, before a folder is made.

    Verifies: CO-24
    """
    path = str(ROOT / "scenarios" / f"{scenario}.toml")
    code, out, err = invoke("can", path, "--can", bus, "--out", str(tmp_path / "o"))
    assert code == 2 and out == "" and text in err and len(err.splitlines()) == 1
    assert not list(tmp_path.iterdir())


def test_interrupted(invoke: Invoke, simulator: dict[str, Any], tmp_path: Path) -> None:
    """Ctrl-C: one word and exit code 130.

    Verifies: FRONT-18
    """
    simulator["interrupt"] = True
    code, _, err = invoke("run", DEMO, "--out", str(tmp_path), *SHORT)
    assert code == 130 and err.splitlines()[-1] == "interrupted" and "Traceback" not in err


def test_simulation_fault_keeps_what_there_is(invoke: Invoke, simulator: dict[str, Any], tmp_path: Path) -> None:
    """Exit code 1 with the fault named; results up to it are written.

    Verifies: FRONT-06
    """
    simulator["fault"] = "plant: shoot-through in leg A at 0.02 s"
    code, _, err = invoke("run", DEMO, "--out", str(tmp_path), *SHORT)
    assert code == 1 and "failed: simulation: plant: shoot-through in leg A" in err
    assert "Traceback" not in err and (tmp_path / "result.json").exists()


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["run", "missing.toml"], "error: missing.toml: file not found; see `ls scenarios motors inverters`\n"),
        (
            ["run", DEMO, "--set", "drive.duty_max=1.5"],
            "error: --set: drive.duty_max: 1.5 is out of range, permitted 0.05",
        ),
        (["run", DEMO, "--set", "inverter.supply_v=10"], "needs at least 12.6 V"),
        (["run", DEMO, "--set", "nonsense"], "error: --set: nonsense: must have the form key=value"),
        (["run", DEMO, "--out", "/dev/null/x"], "error: --out: /dev/null/x: cannot be written: Not a directory"),
        (["run", DEMO, "--out", DEMO], "demo.toml: cannot be written: a file is in the way; name another folder"),
        (["run", DEMO, "--out", ""], "error: --out: .: cannot be written: it is the current folder; name"),
        (["run", DEMO, "--out", "/proc/self"], "error: --out: /proc/self"),
        (["motor", "check", "missing.toml"], "error: missing.toml: file not found"),
        (["motor", "info", DEMO], "is a scenario, not a motor file"),
        (["run", DEMO, "--seed", "x"], "error: --seed: must be a whole number from 0 to 2147483647, not 'x'"),
        (["run", DEMO, "--seed", "-1"], "error: --seed: must be a whole number from 0 to 2147483647, not '-1'"),
        (["run", DEMO, "--seed", "2147483648"], "error: --seed: must be a whole number from 0 to 2147483647"),
        (["run", DEMO, "--sanitize"], "error: --sanitize: needs --native"),
        (["run", DEMO, "--debugger", "gdb"], "error: --debugger: needs --native"),
        (
            ["run", DEMO, "--native", "--debugger", "no_such_gdb --args"],
            "error: --debugger: no_such_gdb: there is no such",
        ),
        (["run", DEMO, "--native", "--debugger", "gdb '"], "error: --debugger: gdb ': No closing quotation"),
        (["run"], "error: fluxlock run: missing argument 'scenario'; see fluxlock run --help"),
        (["run", DEMO, "--bogus"], "error: fluxlock run: no such option: --bogus"),
        (["run", DEMO, "--out"], "error: fluxlock: option '--out' requires an argument"),
        (["motor", "chek", "x"], "error: fluxlock motor: no such command 'chek'"),
        (["frobnicate"], "error: fluxlock: no such command 'frobnicate'; see fluxlock --help"),
    ],
)
def test_bad_input(invoke: Invoke, simulator: dict[str, Any], arguments: list[str], expected: str) -> None:
    """Exit code 2, one line a problem on stderr, no traceback, no simulation.

    Verifies: FRONT-02, FRONT-06
    """
    code, out, err = invoke(*arguments)
    assert code == 2 and expected in err, err
    assert "Traceback" not in err and out == "" and simulator["calls"] == []
    assert all(line.startswith("error: ") for line in err.splitlines())


@pytest.mark.parametrize("name", ["result.json", "zoom.png", "simulator/meta.json"])
def test_output_that_is_a_folder(invoke: Invoke, simulator: dict[str, Any], tmp_path: Path, name: str) -> None:
    """A folder where a file is to be written: one message before the run.

    Verifies: FRONT-06
    """
    (tmp_path / name).mkdir(parents=True)
    code, _, err = invoke("run", DEMO, "--out", str(tmp_path), *SHORT)
    assert code == 2 and simulator["calls"] == []
    text = "a folder is in the way; remove it or name another folder"
    assert err == f"error: --out: {tmp_path / name}: cannot be written: {text}\n"


def test_simulator_folder_that_is_a_file(invoke: Invoke, simulator: dict[str, Any], tmp_path: Path) -> None:
    """A file where the simulator's folder is to be.

    Verifies: FRONT-06
    """
    (tmp_path / "simulator").touch()
    code, _, err = invoke("run", DEMO, "--out", str(tmp_path), *SHORT)
    assert code == 2 and simulator["calls"] == []
    assert err.startswith(f"error: --out: {tmp_path / 'simulator'}: cannot be written: a file is in the way")


def test_output_in_use(invoke: Invoke, simulator: dict[str, Any], tmp_path: Path) -> None:
    """A folder that another run is writing to is refused; that run's files stay.

    Verifies: FRONT-17
    """
    (tmp_path / "simulator").mkdir()
    (tmp_path / "result.json").write_text("{}")
    with (tmp_path / "simulator" / ".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        code, _, err = invoke("run", DEMO, "--out", str(tmp_path), *SHORT)
    assert code == 2 and simulator["calls"] == []
    assert err.startswith(f"error: --out: {tmp_path}: cannot be written: another run is using it")
    assert (tmp_path / "result.json").exists()


def test_results_of_an_earlier_run_do_not_stay(invoke: Invoke, simulator: dict[str, Any], tmp_path: Path) -> None:
    """What a run that breaks off leaves is not mistaken for its result.

    Verifies: FRONT-17
    """
    assert invoke("run", DEMO, "--out", str(tmp_path), *SHORT)[0] in (0, 1)
    assert (tmp_path / "result.json").exists()
    simulator["interrupt"] = True
    assert invoke("run", DEMO, "--out", str(tmp_path), *SHORT)[0] == 130
    assert not (tmp_path / "result.json").exists() and not (tmp_path / "overview.png").exists()


@pytest.mark.parametrize(
    ("override", "expected"),
    [
        ("motor.inertia_kgm2=10", "error: --set: motor.inertia_kgm2: 10 kg*m^2 does not fit the firmware (parameter "),
        ('event=[{at_s=0.001,command="set carrier_hz 1"}]', "error: --set: event[0].command: 1 Hz is not a carrier of"),
    ],
)
def test_refused_parameters_cost_no_results(
    invoke: Invoke, simulator: dict[str, Any], tmp_path: Path, override: str, expected: str
) -> None:
    """What the firmware cannot hold or take is refused before the results of an earlier run are removed.

    Verifies: FRONT-02, FRONT-17
    """
    (tmp_path / "result.json").write_text("{}")
    code, _, err = invoke("run", DEMO, "--out", str(tmp_path), *SHORT, "--set", override)
    assert code == 2 and simulator["calls"] == [] and len(err.splitlines()) == 1
    assert err.startswith(expected), err
    assert (tmp_path / "result.json").read_text() == "{}"


@pytest.mark.parametrize("locked", ["", "result.json"])
def test_output_without_permission(
    invoke: Invoke, simulator: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, locked: str
) -> None:
    """A folder or a file of an earlier run that may not be written to. Refusals are simulated: root has none.

    Verifies: FRONT-06
    """
    (tmp_path / "result.json").touch()

    def refuse(**_: object) -> None:
        raise PermissionError(13, "Permission denied")

    if locked:
        monkeypatch.setattr(cli.os, "access", lambda path, mode: Path(path).name != locked)
    else:
        monkeypatch.setattr(cli.tempfile, "TemporaryFile", refuse)
    code, _, err = invoke("run", DEMO, "--out", str(tmp_path), *SHORT)
    assert code == 2 and simulator["calls"] == []
    assert err.startswith(f"error: --out: {tmp_path / locked}: cannot be written: Permission denied")
    assert len(err.splitlines()) == 1


def test_bad_file_through_the_installed_command(tmp_path: Path) -> None:
    """The real command in a process of its own: every line names file and key.

    Verifies: FRONT-02, FRONT-06
    """
    text = (ROOT / "motors" / "motor-1.toml").read_text()
    bad = tmp_path / "bad.toml"
    bad.write_text(text.replace("inductance_h = 22e-6", "inductance_h = -22e-6").replace("emf =", "enf ="))
    command = [sys.executable, "-m", "fluxlock.cli", "motor", "check", str(bad)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 2 and done.stdout == ""
    assert sorted(done.stderr.splitlines()) == [
        f"error: {bad}: emf: required key is missing; add it: docs/reference/files.md explains every key",
        f'error: {bad}: enf: unknown key, did you mean "emf"?',
        f"error: {bad}: inductance_h: -2.2e-05 H is out of range, permitted 1e-08 to 10 H",
    ]


def test_motor_commands(invoke: Invoke, tmp_path: Path) -> None:
    """Check and info of a good file; unusual contents are warned about.

    Verifies: FRONT-06, FRONT-64
    """
    motor = ROOT / "motors" / "motor-1.toml"
    code, out, err = invoke("motor", "check", str(motor))
    assert (code, err) == (0, "") and out == f"{motor}: ok (Motor-I, 1 pole pair, sinusoidal)\n"
    assert "4 pole pairs" in invoke("motor", "check", str(ROOT / "motors" / "pump-4pp.toml"))[1]
    code, out, _ = invoke("motor", "info", str(motor))
    assert code == 0 and "torque constant" in out and "sinusoidal EMF" in out and "flat_top_deg" not in out
    assert re.search(r"^inductance_h +22 +µH +10 … 11 800", out, re.M) and re.search(
        r"^inertia_kgm2 +5 +g·cm²", out, re.M
    )
    assert re.search(r"^inductance_h +27 / 22 / 22 ", invoke("motor", "info", str(ASYMMETRIC))[1], re.M)
    code, out, _ = invoke("motor", "info", str(ROOT / "motors" / "pump-4pp.toml"))
    assert "trapezoidal EMF" in out and re.search(r"^flat_top_deg +120 +deg", out, re.M)
    assert re.search(r"phase EMF, harmonic 5 over fundamental +4 +%", out), out
    code, out, _ = invoke("motor", "info", str(motor), "--json")
    derived = json.loads(out)["derived"]
    assert re.search(r"L_q +400 +µH", invoke("motor", "info", str(ROOT / "motors" / "ipm-4pp.toml"))[1])
    assert derived["rated_torque_nm"] == pytest.approx(1.5e-3 * 33.08)
    assert derived["rated_dc_current_a"] == pytest.approx(30, rel=1e-4)
    odd = tmp_path / "odd.toml"
    odd.write_text(motor.read_text().replace("rated_current_a = 33.08", "rated_current_a = 2.5"))
    code, _, err = invoke("motor", "check", str(odd))
    assert code == 0 and "warning" in err and "rated_current_a" in err
    odd.write_text(motor.read_text().replace("inertia_kgm2 = 5e-7", "inertia_kgm2 = 1"))
    code, out, err = invoke("motor", "info", str(odd))
    assert code == 0 and err.startswith(f"warning: {odd}: inertia_kgm2: ")
    assert [line.split()[0] for line in out.splitlines() if " ! " in line] == ["inertia_kgm2"]


def test_said_before_anything_is_built(tmp_path: Path, invoke: Invoke) -> None:
    """One line on the error output, before the command prepares its folder.

    Verifies: FRONT-68
    """
    taken = tmp_path / "taken"
    taken.write_text("")
    code, _, err = invoke("run", DEMO, "--set", "inverter.supply_v=13.5", "--out", str(taken))
    assert code == 2
    assert err.splitlines()[0].startswith(f"warning: {DEMO}: event[2].load_factor: ")
    assert sum(line.startswith("warning") for line in err.splitlines()) == 1


def test_broken_table_of_the_sources(monkeypatch: pytest.MonkeyPatch, invoke: Invoke) -> None:
    """A setting that nothing uses is one line and exit code 2, as bad input is.

    Verifies: FRONT-68
    """

    def broken(**_: object) -> None:
        raise SettingsError("sw/drive/settings.toml: no C source uses the setting coast_stop")

    monkeypatch.setattr(cli, "app", broken)
    code, _, err = invoke("run", DEMO)
    assert (code, err) == (2, "error: sw/drive/settings.toml: no C source uses the setting coast_stop\n")
