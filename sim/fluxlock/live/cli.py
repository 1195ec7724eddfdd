# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Command `fluxlock live`: a page that shows a running drive."""

from __future__ import annotations

import os
import secrets
import socket
import webbrowser
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fluxlock.base.paths import RESULTS
from fluxlock.command_line import SetOption
from fluxlock.config import ALLOW_OVERLOAD, ConfigError, Problem
from fluxlock.config.scenario import SEED_MAX
from fluxlock.help import complete_toml
from fluxlock.theory.six_step.output import prepare_folder

if TYPE_CHECKING:
    from fluxlock.live.worker import Shown

EXTRA = "`make setup` in a checkout, else pip install 'fluxlock[live]'"
LIBRARIES = ("starlette", "uvicorn", "websockets")
PORT = 8437
LOOPBACK = ("127.0.0.1", "localhost")


def live(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="SOURCE",
            help="Scenario file (TOML), whose twin runs, or folder of a finished run, which is shown again.",
            autocompletion=complete_toml("scenarios"),
        ),
    ],
    host: Annotated[str, typer.Option(help="Address to listen at; beyond this machine a token is needed.")] = LOOPBACK[
        0
    ],
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port; 0: a free one.")] = PORT,
    token: Annotated[
        str | None, typer.Option(help="Word that a viewer must know; beyond this machine one is made if none is given.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder of exports, default build/<name of the file>-live.")] = None,
    set_: SetOption = None,
    seed: Annotated[
        int | None, typer.Option(min=0, max=SEED_MAX, help="Seed of the noise, default the scenario's.")
    ] = None,
    speed: Annotated[
        float, typer.Option(min=0.0, max=100.0, help="Simulated over real time at the begin; 0: paused.")
    ] = 1.0,
    port_of_board: Annotated[
        Path | None,
        typer.Option("--board", metavar="PORT", help="Serial port of a board that runs the scenario's firmware."),
    ] = None,
    can: Annotated[
        str | None,
        typer.Option("--can", metavar="INTERFACE:CHANNEL", help="Bus of python-can with a board's CANopen node."),
    ] = None,
    chip: Annotated[
        bool, typer.Option("--chip", help="The Verilated chip in place of the twin, in slow motion, clock by clock.")
    ] = False,
    first_start: Annotated[
        bool,
        typer.Option(
            "--first-start",
            help="The steps of `fluxlock first-start`, one by one on the page; with --board at your bench.",
        ),
    ] = False,
    browser: Annotated[bool, typer.Option("--browser", help="Open the page in this machine's browser.")] = False,
    allow_overload: Annotated[
        bool, typer.Option(ALLOW_OVERLOAD, help="Targets may need more than the current limit.")
    ] = False,
) -> None:
    """Show a running drive on a page: turn its knobs, break it by a click, look at any trace.

    A scenario runs as the twin: the firmware as a program on a machine model, which knows the true angle. With --chip
    the RTL itself runs, much slower. The page exports what was done as a scenario, which `fluxlock native --play`
    repeats, or `fluxlock run` for a chip. Ctrl-C ends the program.
    """
    if missing := [name for name in LIBRARIES if find_spec(name) is None]:
        raise ConfigError([Problem("live", "", f"the page needs {', '.join(missing)}: {EXTRA}")])
    from fluxlock.live.link import Link
    from fluxlock.live.server import Server, application

    folder = (out if out is not None else RESULTS / f"{source.stem}-live").resolve()
    if can is not None:
        if chip or first_start or port_of_board is not None or seed is not None or source.is_dir():
            text = "goes with the scenario of the board's firmware; leave out --board, --chip, --first-start and --seed"
            raise ConfigError([Problem("--can", can, text)])
        shown, used_seed = node_of(source, can, set_ or (), allow_overload), 0
    elif first_start:
        shown, used_seed = first_start_of(source, port_of_board, set_ or (), seed, chip, folder), 0
    else:
        shown, used_seed = shown_of(source, port_of_board, set_ or (), seed, allow_overload, chip)
    prepare_folder(folder)
    if token is None:
        token = "" if host in LOOPBACK else secrets.token_urlsafe(16)
    elif not token.isascii() or not token.isprintable() or not 8 <= len(token) <= 64 or set(token) & set("&#?%+ "):
        text = "must have 8 to 64 letters, digits and signs that an address may hold"
        raise ConfigError([Problem("--token", "", text)])
    listener = listening(host, port)
    number = listener.getsockname()[1]
    server = Server(folder, token)
    link = Link(shown, used_seed, speed, server.tell)
    hosts = list(LOOPBACK) if host in LOOPBACK else ["*"]
    place = f"[{host}]" if ":" in host else host
    address = f"http://{place}:{number}/" + (f"?token={token}" if token else "")
    print(f"page: {address}", flush=True)
    if browser:
        webbrowser.open(address)
    import uvicorn

    config = uvicorn.Config(
        application(server, link, hosts), log_level="warning", ws_max_size=2**16, timeout_graceful_shutdown=1
    )
    uvicorn.Server(config).run(sockets=[listener])


def shown_of(
    source: Path, board: Path | None, set_: Sequence[str], seed: int | None, allow_overload: bool, chip: bool = False
) -> tuple[Shown, int]:
    """What the page shows, and the seed of its noise; ConfigError."""
    from fluxlock.cosim.cautions import checked
    from fluxlock.live.board import BoardPlan
    from fluxlock.live.chip import ChipPlan
    from fluxlock.live.replay import read_run
    from fluxlock.native.player import check_playable

    if chip and (board is not None or source.is_dir()):
        text = "goes with a scenario, and without --board"
        raise ConfigError([Problem("--chip", str(source), text)])
    if board is not None:
        if source.is_dir() or seed is not None:
            text = "goes with the scenario that the board's firmware was made from, and without --seed"
            raise ConfigError([Problem("--board", str(board), text)])
        check_port(board)
        return BoardPlan(board, checked(source, set_, allow_overload)), 0
    if source.is_dir():
        if set_ or seed is not None or allow_overload:
            text = "a finished run is shown as it was; leave out --set, --seed and --allow-overload"
            raise ConfigError([Problem("live", str(source), text)])
        read_run(source)
        return source.resolve(), 0
    scenario = checked(source, set_, allow_overload)
    used = scenario.seed if seed is None else seed
    if chip:
        return ChipPlan(scenario), used
    check_playable(scenario)
    return scenario, used


def node_of(source: Path, bus: str, set_: Sequence[str], allow_overload: bool) -> Shown:
    """A board by its CANopen node; ConfigError."""
    from fluxlock.can.can_bus import bus_of
    from fluxlock.cosim.cautions import checked
    from fluxlock.live.board import BoardPlan

    scenario = checked(source, set_, allow_overload)
    bus_of(scenario, bus)[0].shutdown()
    return BoardPlan(None, scenario, bus)


def first_start_of(
    source: Path, board: Path | None, set_: Sequence[str], seed: int | None, chip: bool, folder: Path
) -> Shown:
    """A first start, at a board or simulated; ConfigError."""
    from fluxlock.cosim.cautions import checked
    from fluxlock.first_start.bench import check_bench
    from fluxlock.first_start.steps import FirstStart
    from fluxlock.live.first_start import CURRENT_SHARE, FirstStartPlan, PageGuide

    if source.is_dir() or chip or seed is not None:
        text = "goes with a scenario and, at a bench, --board; leave out --chip and --seed"
        raise ConfigError([Problem("--first-start", str(source), text)])
    scenario = checked(source, set_, True)
    if board is not None:
        check_port(board)
    check_bench(scenario, board)
    FirstStart(scenario, folder, CURRENT_SHARE, PageGuide())  # is there room for a turn?
    return FirstStartPlan(scenario, board, folder)


def _is_terminal(port: Path) -> bool:
    """What any serial port is, and /dev/null is not."""
    try:
        opened = os.open(port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    except OSError:
        return False
    try:
        return os.isatty(opened)
    finally:
        os.close(opened)


def check_port(port: Path) -> None:
    """ConfigError for what is no serial port."""
    if not os.access(port, os.R_OK | os.W_OK) or not port.is_char_device() or not _is_terminal(port):
        text = "is not a serial port that you may read and write; `ls /dev/ttyUSB*` shows those that are there"
        raise ConfigError([Problem("--board", str(port), text)])


def listening(host: str, port: int) -> socket.socket:
    """A socket that listens; ConfigError names the option that is wrong."""
    try:
        family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
    except socket.gaierror:
        raise ConfigError([Problem("--host", host, "is no address of this machine; leave it out")]) from None
    try:
        return socket.create_server((host, port), family=family)
    except OSError as error:
        reason = os.strerror(error.errno or 0)
        text = f"cannot listen at {host}: {reason}; name another --port or --host, --port 0 takes a free one"
        raise ConfigError([Problem("--port", str(port), text)]) from None
