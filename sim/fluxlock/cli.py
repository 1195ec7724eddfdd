# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The `fluxlock` command: checks what the user typed, calls the package that does it, prints the result.

Each command is one function; its docstring is the help text. Heavy packages are imported inside the functions, so that
`--help` answers at once. Bad input raises `ConfigError`; `main` prints each problem on one line, without a traceback.

Exit codes:

* 0: done and passed
* 1: the run failed (`fluxlock.analysis.verdict`), or the simulation broke off
* 2: bad input
* 130: interrupted
* 141: the reader of the output is gone (`| head`)
* 143: terminated
"""

from __future__ import annotations

import json
import os
import signal
import sys
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer
from rich.console import Console

from fluxlock.analysis.injection_cli import app as injection_app
from fluxlock.analysis.rundata import SimulationFault
from fluxlock.analysis.six_step.cli import app as six_step_app
from fluxlock.analysis.six_step.cli import read_trace
from fluxlock.analysis.vector.cli import app as vector_app
from fluxlock.analysis.verdict import Verdict, say
from fluxlock.can_bus import DEFAULT as DEFAULT_BUS
from fluxlock.config import ALLOW_OVERLOAD, ConfigError, Problem, Scenario
from fluxlock.edge.cli import app as edge_app
from fluxlock.edge.inverter_cli import app as inverter_app
from fluxlock.export.command import export
from fluxlock.flash.command import flash
from fluxlock.generated import SourceError
from fluxlock.help import BOARD, LIVE, MOTOR, RUN, THEORY, VERIFY, Grouped, complete_toml, example, fit_help
from fluxlock.init_command import init
from fluxlock.live.cli import live
from fluxlock.motor_cli import app as motor_app
from fluxlock.paths import BUILD, INSTALLED, RESULTS, ROOT, needs_checkout
from fluxlock.population.cli import app as population_app
from fluxlock.progress import ProgressBar
from fluxlock.prove.command import prove
from fluxlock.stage import PLOTTING, ProgressInfo
from fluxlock.sweep_cli import sweep
from fluxlock.writable import EXIT_READER_GONE, InUseError, alone, check_file, reader_gone, refusal

if TYPE_CHECKING:
    from fluxlock.cosim.native_firmware import NativeFirmware

EXIT_FAILED = 1
EXIT_BAD_INPUT = 2
EXIT_INTERRUPTED = 128 + signal.SIGINT
EXIT_TERMINATED = 128 + signal.SIGTERM

SEED_MAX = 2**31 - 1
OUTPUTS = ("result.json", "trace.npz", "overview.png", "zoom.png")
WAVES = "simulator/waves.fst"
DEMO = (RESULTS if INSTALLED else BUILD) / "demo"
FAILS = ROOT / "docs" / "fails" / "index.md"  # what each failure means

app = typer.Typer(
    cls=Grouped,
    help="Sensorless motor control on an FPGA: the chip, its firmware and a motor run together, clock by clock.",
    epilog=example(
        "fluxlock demo",
        "fluxlock run scenarios/own-spindle.toml",
        "fluxlock motor info motors/spindle-2pp.toml",
        "fluxlock can scenarios/can.toml",
        "fluxlock flash scenarios/demo.toml --port /dev/ttyUSB0",
        "fluxlock soa motors/motor-1.toml",
    ),
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)
app.add_typer(motor_app, name="motor", rich_help_panel=MOTOR)
app.add_typer(edge_app, name="edge", rich_help_panel=MOTOR)
app.add_typer(inverter_app, name="inverter", rich_help_panel=MOTOR)
app.add_typer(six_step_app)  # soa, stability, spectrum, ...
app.add_typer(vector_app, name="vector", rich_help_panel=THEORY)
app.add_typer(injection_app)
app.add_typer(population_app, name="population", rich_help_panel=VERIFY)
app.command(rich_help_panel=BOARD, epilog=example("fluxlock flash scenarios/demo.toml --port /dev/ttyUSB0"))(flash)
app.command(
    rich_help_panel=BOARD, epilog=example("fluxlock export ../my-chip", "fluxlock export ../my-chip --board arty")
)(export)

ScenarioArgument = Annotated[
    Path, typer.Argument(help="Scenario file (TOML).", autocompletion=complete_toml("scenarios"))
]
SeedOption = Annotated[
    int | None, typer.Option(parser=lambda text: _seed(text), metavar="NUMBER", help="Seed of the noise.")
]
SetOption = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Override a key, also motor.KEY and inverter.KEY. Repeatable."),
]
OverloadOption = Annotated[
    bool,
    typer.Option(ALLOW_OVERLOAD, help="Targets may need more than the current limit: the drive runs at its limit."),
]


def _checked(path: Path, set_: list[str] | None, allow_overload: bool = False) -> Scenario:
    from fluxlock.cosim.cautions import checked

    return checked(path, set_ or (), allow_overload)


def _seed(text: str) -> int:
    """Value of `--seed`."""
    if not (text.isascii() and text.isdigit() and int(text) <= SEED_MAX):
        raise ConfigError([Problem("--seed", "", f"must be a whole number from 0 to {SEED_MAX}, not {text!r}")])
    return int(text)


@contextmanager
def _output(out_dir: Path) -> Iterator[None]:
    """Make the folder of the results and keep it for this run; find out now, not after it, what cannot be written.

    Results of an earlier run are removed: what stands there after the run belongs to it.
    """
    if out_dir.resolve() == Path.cwd():
        raise _unwritable(out_dir, "it is the current folder; name a folder of the run's own")
    simulator = out_dir / "simulator"
    for folder in (out_dir, simulator):
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=folder):
                pass
        except OSError as error:
            reason = "a file is in the way" if isinstance(error, FileExistsError) else error.strerror
            raise _unwritable(folder, f"{reason}; name another folder") from None
    for path in [*(out_dir / name for name in OUTPUTS), *sorted(simulator.iterdir())]:
        if path.is_dir():
            raise _unwritable(path, "a folder is in the way; remove it or name another folder")
        if path.exists() and not os.access(path, os.W_OK):
            raise _unwritable(path, "Permission denied; remove it or name another folder")
    with ExitStack() as stack:
        try:
            stack.enter_context(alone(simulator))
        except InUseError:
            raise _unwritable(out_dir, "another run is using it; wait for its end or name another folder") from None
        for name in OUTPUTS:
            (out_dir / name).unlink(missing_ok=True)
        yield


def _unwritable(path: Path, reason: str) -> ConfigError:
    return ConfigError([Problem("--out", str(path), f"cannot be written: {reason}")])


def _report(console: Console, result: dict[str, Any], out_dir: Path) -> None:
    from fluxlock.analysis.report import handlers_table, metrics_table, run_line

    if result["metrics"]:
        console.print(metrics_table(result))
    if result["run"]["isr"]:
        console.print(handlers_table(result))
    for trip in result["trips"]:
        console.print(f"trip at {trip['time_s']:.6f} s: {trip['cause']}", highlight=False)
    if result["fault"]:
        console.print(f"fault at the end: {result['fault']}", highlight=False)
    console.print(run_line(result), highlight=False)
    written = ", ".join(name for name in (*OUTPUTS, WAVES) if (out_dir / name).exists())
    console.print(f"written: {out_dir}/{written}", highlight=False, soft_wrap=True)


@app.command(rich_help_panel=RUN, epilog=example("fluxlock demo"))
def demo(
    out: Annotated[Path, typer.Option(help="Folder for results.", show_default="build/demo of the checkout")] = DEMO,
    seed: SeedOption = None,
) -> None:
    """Start a motor without a sensor, hold 60 000 r/min, take a load step.

    Works from any folder of the checkout. The first run builds the chip's simulator, about two minutes; later ones take
    about one.
    """
    run(ROOT / "scenarios" / "demo.toml", out=_from_here(out), seed=seed)


def _from_here(path: Path) -> Path:
    """A path as it is shown from the current folder, where it lies below that."""
    return path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path


@app.command(
    rich_help_panel=RUN,
    epilog=example(
        "fluxlock run scenarios/own-spindle.toml",
        "fluxlock run scenarios/demo.toml --set load.fan_torque_nm=0.015 --out build/light",
    ),
)
def run(
    scenario: ScenarioArgument,
    out: Annotated[Path | None, typer.Option(help="Folder for results, default build/<name of the file>.")] = None,
    set_: SetOption = None,
    seed: SeedOption = None,
    allow_overload: OverloadOption = False,
    waves: Annotated[bool, typer.Option("--waves", help="Write an FST of the chip's signals (zoomed span).")] = False,
    native: Annotated[
        bool,
        typer.Option("--native", help="The firmware runs on this machine and drives the chip's bus: no core."),
    ] = False,
    sanitize: Annotated[
        bool, typer.Option("--sanitize", help="With --native: with the address and undefined behaviour sanitizers.")
    ] = False,
    debugger: Annotated[
        str, typer.Option(metavar="COMMAND", help='With --native: starts the simulator, for instance "gdb --args".')
    ] = "",
    gdb: Annotated[
        str, typer.Option(metavar="[HOST]:PORT", help="Wait there for GDB or LLDB, which stops core and motor.")
    ] = "",
) -> None:
    """Run a scenario in closed loop: verdict, result.json, trace.npz, plots."""
    from fluxlock.cosim.native_firmware import native_firmware

    firmware = native_firmware(native, sanitize, debugger)
    if gdb and native:
        raise ConfigError([Problem("--gdb", gdb, 'is for the core; with --native use --debugger "gdb --args"')])
    loaded = _checked(scenario, set_, allow_overload)
    out_dir = out if out is not None else RESULTS / scenario.stem
    with _output(out_dir):
        _run(loaded, out_dir, loaded.seed if seed is None else seed, waves, firmware, gdb)


def _run(
    scenario: Scenario, out_dir: Path, seed: int, waves: bool, native: NativeFirmware | None, gdb: str = ""
) -> None:
    """Run, write, print."""
    # Simulator and Matplotlib are slow to import and not needed by the other commands.
    from fluxlock.build import check_build
    from fluxlock.cosim.debugger import gdb_server
    from fluxlock.cosim.outcome import write_outcome
    from fluxlock.cosim.run import run_scenario

    server = gdb_server(gdb) if gdb else None
    check_build()
    console, messages = Console(), Console(stderr=True)
    fault: SimulationFault | None = None
    debugged = native is not None and native.debugger  # the debugger has the terminal
    with nullcontext() if debugged else ProgressBar(messages, scenario.duration_s) as progress:
        try:
            data = run_scenario(scenario, out_dir, seed, waves, progress, native=native, gdb=server)
        except SimulationFault as error:
            fault = error
            # Two records are the least that has an angle to measure against.
            if error.data is None or error.data.records.size < 2:
                _fail([f"simulation: {error}"])
            data = error.data
        if progress is not None:
            progress(ProgressInfo(data.duration_s, scenario.duration_s, 0.0, 0.0, PLOTTING))
        outcome = write_outcome(data, scenario, out_dir, broken=None if fault is None else str(fault))
    say(outcome.verdict)
    _report(console, outcome.result, out_dir)
    if not outcome.verdict.passed:
        print(f"what to do: {_from_here(FAILS)}", file=sys.stderr)
        raise typer.Exit(EXIT_FAILED)


def _fail(lines: list[str]) -> NoReturn:
    """Say why the run failed and leave with the exit code for it."""
    say(Verdict(False, lines))
    raise typer.Exit(EXIT_FAILED)


@app.command(
    rich_help_panel=RUN,
    epilog=example(
        "fluxlock profile scenarios/demo.toml --to 0.1",
        "fluxlock profile scenarios/vector/start.toml --from 0.05 --to 0.06",
    ),
)
def profile(
    scenario: ScenarioArgument,
    out: Annotated[
        Path | None, typer.Option(help="Folder for results, default build/<name of the file>-profile.")
    ] = None,
    set_: SetOption = None,
    seed: SeedOption = None,
    from_s: Annotated[float, typer.Option("--from", min=0.0, help="Begin of the traced time, s.")] = 0.0,
    to_s: Annotated[
        float | None, typer.Option("--to", min=0.0, help="Its end and that of the run, s; default the scenario's.")
    ] = None,
) -> None:
    """Count the core's clocks per function and interrupt while a scenario runs; draw flame graphs.

    A trace of every instruction takes some 200 MB of disk a simulated second until it is read.
    """
    from fluxlock.clock import CLOCK_HZ
    from fluxlock.profile.command import run_profile

    loaded = _checked(scenario, set_)
    end_s = loaded.duration_s if to_s is None else to_s
    if not from_s < end_s <= loaded.duration_s:
        text = f"must be after --from, {from_s:g} s, and within the run of {loaded.duration_s:g} s"
        raise ConfigError([Problem("--to", f"{end_s:g}", text)])
    out_dir = out if out is not None else RESULTS / f"{scenario.stem}-profile"
    span = (round(from_s * CLOCK_HZ), round(end_s * CLOCK_HZ))
    with _output(out_dir), ProgressBar(Console(stderr=True), loaded.duration_s) as progress:
        try:
            run_profile(loaded, out_dir, loaded.seed if seed is None else seed, span, progress, Console())
        except SimulationFault as error:
            _fail([f"simulation: {error}"])


@app.command(
    "scope",
    rich_help_panel=RUN,
    epilog=example("fluxlock scope build/demo", "fluxlock scope build/demo --out demo.svg"),
)
def scope_command(
    folder: Annotated[Path, typer.Argument(metavar="RUN", help="Folder of a run's results.")],
    out: Annotated[
        Path | None, typer.Option(help="SVG to write; NAME-still.svg goes beside it. Default RUN/scope.svg.")
    ] = None,
) -> None:
    """Draw a finished run as a moving scope: an SVG for any browser."""
    try:
        result = json.loads((folder / "result.json").read_text(encoding="utf-8"))
    except (FileNotFoundError, NotADirectoryError, ValueError):
        text = "is no result of a run; name the folder of a finished run, such as build/demo"
        raise ConfigError([Problem(str(folder / "result.json"), "", text)]) from None
    path = out if out is not None else folder / "scope.svg"
    if path.suffix != ".svg":
        raise ConfigError([Problem("--out", str(path), "must be a file name that ends in .svg")])
    data = read_trace(folder / "trace.npz")
    check_file(path)
    from fluxlock.analysis import scope

    still = path.with_name(f"{path.stem}-still.svg")
    for file, moving in ((path, True), (still, False)):
        file.write_text(scope.svg(data, result, moving), encoding="utf-8")
    print(scope.caption(data, result))
    print(f"written: {path}, {still.name}")


app.command(rich_help_panel=RUN, epilog=example("fluxlock init my-drive"))(init)
app.command(
    rich_help_panel=RUN,
    epilog=example(
        "fluxlock sweep scenarios/own-spindle.toml --twin --set motor.resistance_ohm=0.8x:1.2x:5",
        "fluxlock sweep scenarios/own-spindle.toml --set drive.commutation=RSC,NSC,CSC",
    ),
)(sweep)
app.command(
    rich_help_panel=RUN,
    epilog=example(
        "fluxlock prove motors/spindle-2pp.toml inverters/drive-48v.toml",
        "fluxlock prove motors/pump-4pp.toml inverters/drive-24v.toml --method six-step --step-deg 30",
    ),
)(prove)


@app.command(
    rich_help_panel=MOTOR,
    epilog=example("fluxlock identify --plant motors/motor-1.toml --inverter inverters/bench-25v.toml"),
)
def identify(
    plant: Annotated[Path, typer.Option(help="Motor file of the machine on the bench; the tool reads its name plate.")],
    inverter: Annotated[Path, typer.Option(help="Inverter file.")],
    out: Annotated[Path | None, typer.Option(help="Motor file to write, default build/identify/<plant>.toml.")] = None,
    seed: SeedOption = None,
    current_hz: Annotated[float, typer.Option(min=1.0, max=20e3, help="Bandwidth of the current gains, Hz.")] = 800.0,
    speed_hz: Annotated[float, typer.Option(min=0.1, max=2e3, help="Bandwidth of the speed gains, Hz.")] = 20.0,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Measure a machine through the chip, write its motor file.

    Resistance, inductance on d and q, flux, dead-time voltage, inertia and friction. The bench is simulated; known are
    the name plate (pole pairs, rated current, highest speed) and the inverter file.
    """
    from fluxlock.commission.bench import bench_of

    bench = bench_of(plant, inverter)
    path = out if out is not None else RESULTS / "identify" / f"{plant.stem}.toml"
    if path.suffix != ".toml":
        raise ConfigError([Problem("--out", str(path), "must be a file name that ends in .toml")])
    if path.resolve() in (plant.resolve(), inverter.resolve()):
        raise ConfigError([Problem("--out", str(path), "is one of the files that are read; name another file")])
    # Simulator and Matplotlib are slow to import and not needed by the other commands.
    from fluxlock.commission.command import identify as run_identify
    from fluxlock.cosim.plan import ConversationError

    try:
        passed = run_identify(bench, path, 1 if seed is None else seed, current_hz, speed_hz, as_json)
    except (ConversationError, SimulationFault) as error:
        _fail([f"identify: {error}"])
    if not passed:
        raise typer.Exit(EXIT_FAILED)


@app.command(
    rich_help_panel=LIVE,
    epilog=example(
        "fluxlock native scenarios/demo.toml",
        "fluxlock native scenarios/vector/start.toml --play",
    ),
)
def native(
    scenario: Annotated[Path, typer.Argument(help="Scenario file (TOML); its motor, inverter, drive and load.")],
    set_: SetOption = None,
    can: Annotated[
        str, typer.Option("--can", metavar="INTERFACE:CHANNEL", help="Bus of python-can, for instance socketcan:vcan0.")
    ] = DEFAULT_BUS,
    node: Annotated[int, typer.Option(min=1, max=127, help="CANopen node-ID.")] = 1,
    speed: Annotated[float, typer.Option(min=0.0, help="Simulated over real time; 0: as fast as it goes.")] = 1.0,
    seconds: Annotated[
        float | None, typer.Option(min=0.0, help="Simulated time to run; without it until Ctrl-C.")
    ] = None,
    memory: Annotated[
        Path | None, typer.Option(help="File of the non-volatile memory, made if it is not there.")
    ] = None,
    play: Annotated[
        bool, typer.Option("--play", help="Carry out the scenario and judge it as `run` does: no bus, no console.")
    ] = False,
    out: Annotated[
        Path | None, typer.Option(help="With --play: folder for results, default build/<name of the file>-native.")
    ] = None,
    seed: SeedOption = None,
    allow_overload: OverloadOption = False,
) -> None:
    """Run the firmware as a Linux program: faster than real time, CANopen on a bus.

    The console is on stdin, the motor is an averaged model.
    No chip: inverter and crossing detection are averaged models, so that it is faster than real time. Events and
    windows of the scenario count with --play alone; vector control needs it.
    """
    loaded = _checked(scenario, set_, allow_overload)
    if play:
        if seconds is not None or memory is not None:
            text = "ends with the scenario and keeps no memory; leave out --seconds and --memory"
            raise ConfigError([Problem("--play", "", text)])
        folder = out if out is not None else RESULTS / f"{scenario.stem}-native"
        _play(loaded, folder, loaded.seed if seed is None else seed)
        return
    if out is not None:
        raise ConfigError([Problem("--out", str(out), "needs --play")])
    from fluxlock.native.program import run_native

    if not run_native(loaded, can, node, speed or None, seconds, memory):
        raise typer.Exit(EXIT_FAILED)


def _play(scenario: Scenario, out_dir: Path, seed: int) -> None:
    """Run a scenario on the native drive, write, print."""
    from fluxlock.cosim.outcome import write_outcome
    from fluxlock.native.player import player

    print("compiling what has changed", file=sys.stderr, flush=True)
    drive = player(scenario, seed)
    with _output(out_dir):
        outcome = write_outcome(drive.run(), scenario, out_dir)
    say(outcome.verdict)
    _report(Console(), outcome.result, out_dir)
    if not outcome.verdict.passed:
        print(f"what to do: {_from_here(FAILS)}", file=sys.stderr)
        raise typer.Exit(EXIT_FAILED)


app.command(
    rich_help_panel=LIVE,
    epilog=example("fluxlock live scenarios/own-spindle.toml", "fluxlock live my-drive.toml --port 0 --browser"),
)(live)


@app.command("can", rich_help_panel=LIVE, epilog=example("fluxlock can scenarios/can.toml --can socketcan:vcan0"))
def can_command(
    scenario: Annotated[Path, typer.Argument(help="Scenario file (TOML) with the table \\[can].")],
    can: Annotated[
        str, typer.Option("--can", metavar="INTERFACE:CHANNEL", help="Bus of python-can, for instance socketcan:vcan0.")
    ] = DEFAULT_BUS,
    seconds: Annotated[
        float | None, typer.Option(min=0.001, max=3600.0, help="Simulated time to run; without it until Ctrl-C.")
    ] = None,
    set_: SetOption = None,
    out: Annotated[Path | None, typer.Option(help="Folder for the results, default build/<name>.")] = None,
    seed: SeedOption = None,
) -> None:
    """Run the chip with its CAN bus on SocketCAN or UDP: a master, candump, cansend.

    The simulation is slower than real time by the factor that it prints; give a master's timeouts that much more.
    Events of the scenario happen, windows and limits do not count. Ctrl-C ends the run and writes its results.
    """
    from fluxlock.cosim.can_command import join, run_can

    loaded = _checked(scenario, set_)
    out_dir = out if out is not None else RESULTS / scenario.stem
    try:
        with join(loaded, can) as bus, _output(out_dir):
            passed = run_can(loaded, bus, can, out_dir, loaded.seed if seed is None else seed, seconds)
    except SimulationFault as error:
        _fail([f"simulation: {error}"])
    if not passed:
        raise typer.Exit(EXIT_FAILED)


@app.command(rich_help_panel=VERIFY, epilog=example("fluxlock regression six-step --quick"))
def regression(
    cases: Annotated[list[str] | None, typer.Argument(help="Cases, or beginnings of their names; all without.")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="A short version of each, same limits.")] = False,
    list_: Annotated[bool, typer.Option("--list", help="Only list the cases.")] = False,
    jobs: Annotated[int, typer.Option(min=1, help="Cases run side by side.")] = os.cpu_count() or 1,
    seed: SeedOption = None,
    record: Annotated[
        bool, typer.Option("--record", help="Run with many seeds; record means, scatters, bands.")
    ] = False,
    seeds: Annotated[int, typer.Option(min=5, help="With --record: seeds 1 to this.")] = 5,
    accept: Annotated[
        list[str] | None,
        typer.Option("--accept", metavar="ROW", help="Run nothing: record the last run's row, or rows that begin so."),
    ] = None,
    why: Annotated[str, typer.Option("--why", help="With --accept: the reason, which the record keeps.")] = "",
) -> None:
    """Run the long sets with their limits: build/regression.json.

    The command keeps finished runs and does not repeat them.
    A row fails when it misses a limit or leaves the bands of docs/verification/record.json.
    """
    needs_checkout("regression")
    from fluxlock.regression.command import accept_rows, list_cases, record_regression, run_regression

    if (accept or record) and (quick or list_ or seed is not None or (accept and (record or cases))):
        text = "stand alone: full length, seeds of their own, one of them at a time"
        raise ConfigError([Problem("regression", "--accept, --record", text)])
    if why and not accept:
        raise ConfigError([Problem("regression", "--why", "belongs to --accept")])
    if list_:
        list_cases(cases or [])
    elif accept:
        accept_rows(accept, why)
    elif record:
        if not record_regression(cases or [], seeds, jobs):
            raise typer.Exit(EXIT_FAILED)
    elif not run_regression(cases or [], quick, 1 if seed is None else seed, jobs):
        raise typer.Exit(EXIT_FAILED)


@app.command(rich_help_panel=VERIFY, epilog=example("fluxlock campaign six-step --quick"))
def campaign(
    drives: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="DRIVE",
            help="six-step, start, vector, five-phase, hall, encoder, can, board, board-vector, boot; all without.",
        ),
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="One moment a drive, a sixth of the faults.")] = False,
    every: Annotated[int, typer.Option(min=1, help="Only one run of so many.")] = 1,
    show: Annotated[bool, typer.Option("--show", help="Run nothing: the runs that have finished.")] = False,
    jobs: Annotated[int, typer.Option(min=1, help="Runs side by side.")] = os.cpu_count() or 1,
    seed: Annotated[int | None, typer.Option(parser=_seed, metavar="NUMBER", help="Seed of noise and upsets.")] = None,
) -> None:
    """Put faults into plant, sensors and chip, judge how each run ends.

    The results go to build/campaign.json.
    Runs finished before with equal inputs are not repeated.
    `python -m fluxlock.campaign.page` makes the page of the documentation from it.
    """
    needs_checkout("campaign")
    from fluxlock.campaign.command import run as run_campaign

    if not run_campaign(drives or [], quick, every, 1 if seed is None else seed, 0 if show else jobs):
        raise typer.Exit(EXIT_FAILED)


@app.command(rich_help_panel=VERIFY, epilog=example("fluxlock fuzz six-step --runs 2"))
def fuzz(
    drives: Annotated[
        list[str] | None, typer.Argument(metavar="DRIVE", help="six-step, vector, five-phase; all without.")
    ] = None,
    runs: Annotated[int, typer.Option(min=1, help="Runs a drive, each with a seed of its own.")] = 10,
    ms: Annotated[float, typer.Option(min=1.0, max=100.0, help="Length of a run, ms.")] = 10.0,
    jobs: Annotated[int, typer.Option(min=1, help="Runs side by side.")] = os.cpu_count() or 1,
    seed: Annotated[int | None, typer.Option(parser=_seed, metavar="NUMBER", help="Seed of noise and runs.")] = None,
) -> None:
    """Write random registers while the machine runs: the gates must stay safe.

    Every access must be answered too.
    """
    needs_checkout("fuzz")
    from fluxlock.campaign.fuzz import fuzz_drives

    if not fuzz_drives(drives or [], 1 if seed is None else seed, runs, 1e-3 * ms, jobs):
        raise typer.Exit(EXIT_FAILED)


@app.command(rich_help_panel=VERIFY, epilog=example("fluxlock figures six-step 2.11"))
def figures(
    family: Annotated[
        str,
        typer.Argument(
            help="Whose: six-step (Yang 2020, chapters 2 to 6), blac (chapter 7), five-phase (Tian 2019, Yu 2022)."
        ),
    ],
    numbers: Annotated[
        list[str] | None,
        typer.Argument(metavar="FIGURE", help="Numbers (2.11, tian.4), chapters (2) or papers (yu); all without."),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder; PNG and figures.json go to FOLDER/FAMILY.")] = Path(
        "build/figures"
    ),
    quick: Annotated[
        bool,
        typer.Option(
            "--quick",
            help="Short runs, fewer points; what needs the chip's long runs is left out and the caption says so.",
        ),
    ] = False,
    list_: Annotated[bool, typer.Option("--list", help="Only list the figures.")] = False,
    jobs: Annotated[int, typer.Option(min=1, help="Figures drawn side by side.")] = os.cpu_count() or 1,
    seed: SeedOption = None,
) -> None:
    """Draw a thesis's and two papers' figures from our own runs.

    Each has a table: printed, measured.
    Runs finished before with the same chip, firmware, scenario and plant are read, also those of the regression.
    `python -m fluxlock.docs.figures` makes the page of the documentation from what stands in build/figures.
    """
    needs_checkout("figures")
    from fluxlock.figures.command import list_figures, run_figures

    if list_:
        list_figures(family, numbers or [])
    elif not run_figures(family, numbers or [], out, quick, 1 if seed is None else seed, jobs):
        raise typer.Exit(EXIT_FAILED)


@app.command(rich_help_panel=VERIFY, epilog=example("fluxlock mutate fl_zcd --count 10"))
def mutate(
    blocks: Annotated[list[str] | None, typer.Argument(metavar="BLOCK", help="RTL blocks; all without.")] = None,
    count: Annotated[int, typer.Option(min=1, help="Mutants a block.")] = 300,
    seed: Annotated[int | None, typer.Option(parser=_seed, metavar="NUMBER", help="Seed of choice and tests.")] = None,
    jobs: Annotated[int, typer.Option(min=1, help="Mutants run side by side.")] = os.cpu_count() or 1,
) -> None:
    """Put defects into RTL blocks, count how many the block tests find.

    The results go to build/mutate/BLOCK.json.
    A run that was stopped goes on from there if block, tests and seed are the same.

    `python -m fluxlock.docs.mutation` makes the page of the documentation from these files.
    """
    needs_checkout("mutate")
    from fluxlock.mutation.command import mutate as run_mutate

    if not run_mutate(blocks or [], count, 1 if seed is None else seed, jobs):
        raise typer.Exit(EXIT_FAILED)


def _report_usage(error: typer.TyperException) -> None:
    """Wrong usage in one line; without any argument the help text is the answer."""
    context = getattr(error, "ctx", None)
    command = context.command_path if context else "fluxlock"
    text = error.format_message().rstrip(".")
    if text:
        print(f"error: {command}: {text[:1].lower()}{text[1:]}; see {command} --help", file=sys.stderr)


# What to do about problems that do not say it themselves, by the end of their message.
ADVICE = {
    "file not found": "; see `ls scenarios motors inverters`",
    "required key is missing": "; add it: docs/reference/files.md explains every key",
    "is a folder, not a file": "; name a file in it",
}


def _advice(problem: Problem) -> str:
    return next((advice for end, advice in ADVICE.items() if problem.message.endswith(end)), "")


def _terminate(*_: object) -> NoReturn:
    """SIGTERM unwinds like Ctrl-C: the simulator's process ends with this one."""
    sys.exit(EXIT_TERMINATED)


def main() -> None:
    """Entry point: bad input becomes one line a problem and exit code 2, never a traceback."""
    before = signal.signal(signal.SIGTERM, _terminate)
    fit_help()
    try:
        code = app(prog_name="fluxlock", standalone_mode=False) or 0
        sys.stdout.flush()
    except ConfigError as error:
        for problem in error.problems:
            print(f"error: {problem}{_advice(problem)}", file=sys.stderr)
        code = EXIT_BAD_INPUT
    except SourceError as error:
        print(f"error: {error}", file=sys.stderr)
        code = EXIT_BAD_INPUT
    except typer.TyperException as error:
        _report_usage(error)
        code = EXIT_BAD_INPUT
    except BrokenPipeError:
        code = reader_gone()
    except OSError as error:
        text = refusal(error)
        if text is None:
            raise
        print(f"error: {text}", file=sys.stderr)
        code = EXIT_BAD_INPUT
    except KeyboardInterrupt:
        code = EXIT_INTERRUPTED
    except SystemExit as error:
        # Rich ends the program itself when the reader is gone.
        gone = isinstance(error.__context__, BrokenPipeError)
        code = EXIT_READER_GONE if gone else error.code if isinstance(error.code, int) else EXIT_FAILED
    finally:
        signal.signal(signal.SIGTERM, before)
    if code in (EXIT_INTERRUPTED, EXIT_TERMINATED):
        print("interrupted" if code == EXIT_INTERRUPTED else "terminated", file=sys.stderr)
    sys.exit(code)


if __name__ == "__main__":
    main()
