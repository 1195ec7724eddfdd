# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The `fluxlock` command: checks what the user typed, calls the package that does it, prints the result.

Each command is one function; its docstring is the help text. Heavy packages are imported inside the functions, so that
`--help` answers at once. Bad input raises `ConfigError`; `main` prints each problem on one line, without a traceback.

Exit codes: `fluxlock.command_line`.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, nullcontext
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer
from rich.console import Console

from fluxlock.base.paths import BUILD, INSTALLED, RESULTS, ROOT
from fluxlock.base.progress import ProgressBar
from fluxlock.base.writable import InUseError, alone, check_file
from fluxlock.can.can_bus import DEFAULT as DEFAULT_BUS
from fluxlock.command_line import EXIT_FAILED, SeedOption, SetOption, run_command_line
from fluxlock.config import ALLOW_OVERLOAD, ConfigError, Problem, Scenario
from fluxlock.edge.cli import app as edge_app
from fluxlock.edge.inverter_cli import app as inverter_app
from fluxlock.export.command import export
from fluxlock.first_start.command import first_start
from fluxlock.flash.command import flash
from fluxlock.help import BOARD, LIVE, MOTOR, RUN, THEORY, VERIFY, Grouped, complete_toml, example
from fluxlock.init_command import init
from fluxlock.live.cli import live
from fluxlock.motor_cli import app as motor_app
from fluxlock.population.cli import app as population_app
from fluxlock.prove.command import prove
from fluxlock.replay.cli import replay
from fluxlock.results.rundata import SimulationFault
from fluxlock.results.verdict import Verdict, say
from fluxlock.sweep_cli import sweep
from fluxlock.theory.injection.cli import app as injection_app
from fluxlock.theory.six_step.cli import app as six_step_app
from fluxlock.theory.six_step.cli import read_trace
from fluxlock.theory.vector.cli import app as vector_app
from fluxlock.wiring.command import check_wiring

if TYPE_CHECKING:
    from fluxlock.cosim.native_firmware import NativeFirmware
    from fluxlock.cosim.outcome import Run

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


def _say_version(asked: bool) -> None:
    if asked:
        print("fluxlock", version("fluxlock"))
        raise typer.Exit


@app.callback()
def _options(
    _version: Annotated[
        bool, typer.Option("--version", callback=_say_version, is_eager=True, help="Print the version and end.")
    ] = False,
) -> None:
    """Take the options before the command."""


app.add_typer(motor_app, name="motor", rich_help_panel=MOTOR)
app.add_typer(edge_app, name="edge", rich_help_panel=MOTOR)
app.add_typer(inverter_app, name="inverter", rich_help_panel=MOTOR)
app.add_typer(six_step_app)  # soa, stability, spectrum, ...
app.add_typer(vector_app, name="vector", rich_help_panel=THEORY)
app.add_typer(injection_app)
app.add_typer(population_app, name="population", rich_help_panel=VERIFY)
app.command(rich_help_panel=BOARD, epilog=example("fluxlock flash scenarios/demo.toml --port /dev/ttyUSB0"))(flash)
app.command(
    rich_help_panel=BOARD,
    epilog=example(
        "fluxlock check-wiring scenarios/vector/start.toml",
        "fluxlock check-wiring scenarios/vector/start.toml --set inverter.sensing.current_order='ACB'",
        "fluxlock check-wiring scenarios/vector/start.toml --port /dev/ttyUSB0",
    ),
)(check_wiring)
app.command(
    "first-start",
    rich_help_panel=BOARD,
    epilog=example(
        "fluxlock first-start scenarios/own-spindle.toml",
        "fluxlock first-start scenarios/own-spindle.toml --port /dev/ttyUSB0",
    ),
)(first_start)
app.command(
    rich_help_panel=BOARD, epilog=example("fluxlock export ../my-chip", "fluxlock export ../my-chip --board arty")
)(export)

ScenarioArgument = Annotated[
    Path, typer.Argument(help="Scenario file (TOML).", autocompletion=complete_toml("scenarios"))
]
OverloadOption = Annotated[
    bool,
    typer.Option(ALLOW_OVERLOAD, help="Targets may need more than the current limit: the drive runs at its limit."),
]


def _checked(path: Path, set_: list[str] | None, allow_overload: bool = False) -> Scenario:
    from fluxlock.cosim.cautions import checked

    return checked(path, set_ or (), allow_overload)


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
    from fluxlock.results.report import handlers_table, metrics_table, run_line

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
        str | None, typer.Option(metavar="[HOST]:PORT", help="Wait there for GDB or LLDB, which stops core and motor.")
    ] = None,
) -> None:
    """Run a scenario in closed loop: verdict, result.json, trace.npz, plots."""
    from fluxlock.cosim.native_firmware import native_firmware

    firmware = native_firmware(native, sanitize, debugger)
    if gdb is not None and native:
        raise ConfigError([Problem("--gdb", gdb, 'is for the core; with --native use --debugger "gdb --args"')])
    loaded = _checked(scenario, set_, allow_overload)
    for k, event in enumerate(loaded.event if native else ()):
        if event.fault is not None and event.fault.kind == "dead_core":
            raise ConfigError([loaded.sources.problem(f"event[{k}].fault", "with --native there is no core to hang")])
    out_dir = out if out is not None else RESULTS / scenario.stem
    with _output(out_dir):
        _run(loaded, out_dir, loaded.seed if seed is None else seed, waves, firmware, gdb)


def _run(
    scenario: Scenario, out_dir: Path, seed: int, waves: bool, native: NativeFirmware | None, gdb: str | None = None
) -> None:
    """Run, write, print."""
    # Simulator and Matplotlib are slow to import and not needed by the other commands.
    from fluxlock.api import OnChip, run_checked
    from fluxlock.cosim.debugger import gdb_server
    from fluxlock.cosim.outcome import write_outcome

    chip = OnChip(waves, native, gdb_server(gdb) if gdb is not None else None)
    debugged = native is not None and native.debugger  # the debugger has the terminal
    with nullcontext() if debugged else ProgressBar(Console(stderr=True), scenario.duration_s) as progress:
        try:
            finished = run_checked(scenario, False, seed, out_dir, progress=progress, chip=chip)
        except SimulationFault as error:
            # Two records are the least that has an angle to measure against.
            if error.data is None or error.data.records.size < 2:
                _fail([f"simulation: {error}"])
            finished = write_outcome(error.data, scenario, out_dir, broken=str(error))
    _tell(finished, out_dir)


def _tell(run: Run, out_dir: Path) -> None:
    """Print verdict and results; exit code of a failure."""
    say(run.verdict)
    _report(Console(), run.result, out_dir)
    if not run.verdict.passed:
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
    with _output(out_dir), ProgressBar(Console(stderr=True), end_s) as progress:
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
    from fluxlock.results import scope

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
    epilog=example(
        "fluxlock identify --plant motors/motor-1.toml --inverter inverters/bench-25v.toml",
        "fluxlock identify --plant motors/spindle-2pp.toml --inverter inverters/drive-48v.toml --port /dev/ttyUSB0",
    ),
)
def identify(
    plant: Annotated[Path, typer.Option(help="Motor file of the machine on the bench; the tool reads its name plate.")],
    inverter: Annotated[Path, typer.Option(help="Inverter file.")],
    port: Annotated[
        Path | None,
        typer.Option(help="Serial port of a board, for example /dev/ttyUSB0, in place of the simulated bench."),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Motor file to write, default build/identify/<plant>.toml.")] = None,
    set_: SetOption = None,
    seed: SeedOption = None,
    current_hz: Annotated[float, typer.Option(min=1.0, max=20e3, help="Bandwidth of the current gains, Hz.")] = 800.0,
    speed_hz: Annotated[float, typer.Option(min=0.1, max=2e3, help="Bandwidth of the speed gains, Hz.")] = 20.0,
    wait_s: Annotated[
        float | None, typer.Option(min=0.1, help="With --port: how long to wait for the loader, s, default 60.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Measure a machine through the chip, write its motor file.

    Resistance, inductance on d and q, flux, dead-time voltage, inertia and friction. Known are the name plate (pole
    pairs, rated current, highest speed) and the inverter file. The bench is simulated, or with `--port` a real one: its
    board gets the commissioning program in place of the drive (reset it while the command waits), the shaft has to turn
    freely, and `fluxlock flash` brings the drive back.
    """
    from fluxlock.commission.bench import bench_of

    for option, value, real in (("--wait-s", wait_s, True), ("--seed", seed, False)):
        if value is not None and real != (port is not None):
            text = f"has an effect {'with' if real else 'without'} --port only: leave it out"
            raise ConfigError([Problem(option, str(value), text)])
    bench = bench_of(plant, inverter, set_ or ())
    path = out if out is not None else RESULTS / "identify" / f"{plant.stem}.toml"
    if path.suffix != ".toml":
        raise ConfigError([Problem("--out", str(path), "must be a file name that ends in .toml")])
    if path.resolve() in (plant.resolve(), inverter.resolve()):
        raise ConfigError([Problem("--out", str(path), "is one of the files that are read; name another file")])
    # Simulator and Matplotlib are slow to import and not needed by the other commands.
    from fluxlock.commission.command import Board
    from fluxlock.commission.command import identify as run_identify
    from fluxlock.cosim.plan import ConversationError

    where = Board(port, 60.0 if wait_s is None else wait_s) if port is not None else 1 if seed is None else seed
    try:
        passed = run_identify(bench, path, where, current_hz, speed_hz, as_json)
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
    from fluxlock.api import run_checked

    with _output(out_dir), ProgressBar(Console(stderr=True), scenario.duration_s) as progress:
        finished = run_checked(scenario, True, seed, out_dir, progress=progress)
    _tell(finished, out_dir)


app.command(
    rich_help_panel=LIVE,
    epilog=example("fluxlock live scenarios/own-spindle.toml", "fluxlock live my-drive.toml --port 0 --browser"),
)(live)
app.command(
    rich_help_panel=LIVE,
    epilog=example("fluxlock replay my-log.csv scenarios/vector/start.toml"),
)(replay)


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


def main() -> None:
    """Entry point."""
    run_command_line(app, "fluxlock")


if __name__ == "__main__":
    main()
