# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The command `fluxlock flash`."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from fluxlock.base.progress import counting_bars
from fluxlock.can.can_bus import OPTION as CAN_OPTION
from fluxlock.can.can_bus import open_bus
from fluxlock.clock import CLOCK_HZ
from fluxlock.command_line import SetOption
from fluxlock.config import ConfigError, Problem, Scenario, load_scenario
from fluxlock.config.drive import MotorError
from fluxlock.generate.memory import RAM_BYTES

if TYPE_CHECKING:
    from fluxlock.flash.image import Plan
    from fluxlock.flash.loader import Line
    from fluxlock.flash.serial_port import SerialPort

EXIT_FAILED = 1
# Converters of the boards (fl_board): strobe to valid codes, and the least spacing of strobes.
CONVERSION_S = 34 / CLOCK_HZ
SPACING_S = 36 / CLOCK_HZ


@contextmanager
def open_port(port: Path) -> Iterator[SerialPort]:
    """The serial port that `--port` names. Raises ConfigError."""
    from fluxlock.flash.serial_port import PortError, SerialPort

    if not os.access(port, os.R_OK | os.W_OK) or not port.is_char_device():
        raise ConfigError([Problem("--port", str(port), "is not a serial port that you may read and write")])
    try:
        opened = SerialPort(port)
    except PortError as error:
        raise ConfigError([Problem("--port", str(port), str(error))]) from None
    with opened:
        yield opened


def write_and_start(line: Line, steps: Plan, wait_s: float, console: Console) -> None:
    """Write a program and its parameters through the loader, once it answers, and start it. Raises LoaderError."""
    from fluxlock.flash.loader import Loader, LoaderError

    loader = Loader(line)
    console.print("waiting for the loader: reset the board", highlight=False)
    version, identity = loader.find(wait_s)
    console.print(f"loader {version}, flash {identity:06x}", highlight=False)
    with counting_bars() as bar:
        task = bar.add_task("write", total=None)
        loader.upload(steps, lambda done, total: bar.update(task, completed=done, total=total))
    if (found := loader.start()) != "good":
        raise LoaderError(f"not started: {found}")
    console.print(f"started; {len(steps.write)} pages written", highlight=False)


@contextmanager
def _line(port: Path | None, can: str | None, node: int | None, bit_rate: int | None) -> Iterator[Line]:
    """The line to the board that the options name."""
    from fluxlock.flash.can_line import KBIT_PER_S_DEFAULT, NODE_DEFAULT, CanLine, PythonCan
    from fluxlock.flash.loader import SerialLine

    if can is not None:
        if port is not None:
            raise ConfigError([Problem(CAN_OPTION, can, "and --port exclude each other: leave out --port")])
        bus = open_bus(can, KBIT_PER_S_DEFAULT if bit_rate is None else bit_rate)
        with bus:
            yield CanLine(PythonCan(bus), NODE_DEFAULT if node is None else node)
        return
    for option, value in (("--node", node), ("--bit-rate", bit_rate)):
        if value is not None:
            raise ConfigError([Problem(option, str(value), f"has an effect with {CAN_OPTION} only")])
    if port is None:
        raise ConfigError([Problem("--port", "", f"is missing: a serial port, or {CAN_OPTION} INTERFACE:CHANNEL")])
    with open_port(port) as serial:
        yield SerialLine(serial)


def _image(scenario: Scenario, ram_kib: int) -> bytes:
    """The firmware for a chip with that much RAM."""
    from fluxlock.cosim.run import image_of
    from fluxlock.firmware import FirmwareError

    option = "--ram-kib"
    if not RAM_BYTES // 2 < 1024 * ram_kib <= RAM_BYTES or ram_kib % 8:
        raise ConfigError([Problem(option, str(ram_kib), "must be a multiple of 8 from 72 to 128")])
    small = 1024 * ram_kib < RAM_BYTES
    injects = scenario.drive.vector.injection is not None
    if small and (scenario.motor.phases != 3 or injects or scenario.can is not None):
        text = "five phases, injection and the node of a CAN bus need 128"
        raise ConfigError([Problem(option, str(ram_kib), text)])
    try:
        return image_of(scenario, 256 * ram_kib).read_bytes()
    except FirmwareError as error:
        if not small:
            raise
        raise ConfigError([Problem(option, str(ram_kib), str(error))]) from None


def plan_of(scenario: Scenario, ram_kib: int = RAM_BYTES // 1024) -> Plan:
    """What a board's flash gets for a scenario. Raises ConfigError."""
    from fluxlock.cosim.parameters import check_parameters, parameter_block
    from fluxlock.flash.image import pack_can_setup, pack_image, plan

    check_board(scenario)
    check_parameters(scenario)
    image = pack_image(_image(scenario, ram_kib), scenario.motor.phases)
    bus = scenario.can
    setup = pack_can_setup(bus.node_id, bus.bit_rate_kbit_per_s) if bus is not None else b""
    return plan(image, parameter_block(scenario).pack(), setup)


def check_board(scenario: Scenario) -> None:
    """What is right in a simulation only: sampling that the boards' converters do not keep up with, no dead time."""
    sensing = scenario.inverter.sensing
    table = "inverter.sensing."
    found = []
    if sensing.sample_period_s < SPACING_S:
        text = f"must be at least {SPACING_S:.2g} s on a board: its converters miss samples that come faster"
        found.append(Problem(f"{table}sample_period_s", f"{sensing.sample_period_s:g}", text))
    if scenario.drive.method == "vector" and sensing.conversion_s < CONVERSION_S:
        text = f"must be at least {CONVERSION_S:.2g} s on a board: --set {table}conversion_s={CONVERSION_S:.2g}"
        found.append(Problem(f"{table}conversion_s", f"{sensing.conversion_s:g}", text))
    if scenario.inverter.dead_time_s <= 0.0:
        found.append(Problem("inverter.dead_time_s", "0", "must be more than 0 on a board: its switches need one"))
    if scenario.drive.motor_error != MotorError():
        text = "is for simulations: the firmware of a board is told of the motor as it is"
        found.append(Problem("drive.motor_error", "", text))
    if found:
        raise ConfigError(found)


def flash(
    scenario: Annotated[Path, typer.Argument(help="Scenario file (TOML): its firmware and parameter block.")],
    port: Annotated[Path | None, typer.Option(help="Serial port of the board, for example /dev/ttyUSB0.")] = None,
    can: Annotated[
        str | None,
        typer.Option(CAN_OPTION, metavar="INTERFACE:CHANNEL", help="In place of it the board's bus: socketcan:can0."),
    ] = None,
    node: Annotated[
        int | None,
        typer.Option(min=0, max=127, help="With --can: node-ID stored in the board's flash, default 0: none is."),
    ] = None,
    bit_rate: Annotated[
        int | None,
        typer.Option(
            min=10,
            max=1000,
            metavar="KBIT_PER_S",
            help="With --can: what is stored in the board's flash, default 500; socketcan has the kernel's.",
        ),
    ] = None,
    set_: SetOption = None,
    ram_kib: Annotated[
        int,
        typer.Option(metavar="KIB", help="RAM of the board's chip; with less than 128 one method is held only."),
    ] = RAM_BYTES // 1024,
    wait_s: Annotated[float, typer.Option(min=0.1, help="How long to wait for the loader, s.")] = 60.0,
) -> None:
    """Write firmware and parameters into a board's flash, by UART or CAN.

    The loader listens for 0.2 s after a reset: reset the board while the command waits. A scenario with a
    CAN bus gets the firmware with the CANopen node; what the node has stored stays.
    """
    from fluxlock.flash.loader import LoaderError
    from fluxlock.flash.serial_port import PortError

    steps = plan_of(load_scenario(scenario, set_ or ()), ram_kib)
    with _line(port, can, node, bit_rate) as line:
        try:
            write_and_start(line, steps, wait_s, Console())
        except (LoaderError, PortError) as error:
            print(f"failed: {error}", file=sys.stderr)
            raise typer.Exit(EXIT_FAILED) from None
