"""The command `fluxlock flash`."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import Progress

from fluxlock.config import ConfigError, Problem, load_scenario

EXIT_FAILED = 1


def flash(
    scenario: Annotated[Path, typer.Argument(help="Scenario file (TOML): its firmware and parameter block.")],
    port: Annotated[Path, typer.Option(help="Serial port of the board, for example /dev/ttyUSB0.")],
    set_: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="Override a key, also motor.KEY and inverter.KEY. Repeatable."),
    ] = None,
    wait_s: Annotated[float, typer.Option(min=0.1, help="How long to wait for the loader, s.")] = 60.0,
) -> None:
    """Write firmware and parameter block of a scenario into the flash of a board and start them.

    The loader listens for 0.2 s after a reset: reset the board while the command waits. A scenario with a
    CAN bus gets the firmware with the CANopen node; what the node has stored stays.
    """
    from fluxlock.cosim.parameters import check_parameters, parameter_block
    from fluxlock.cosim.run import image_of
    from fluxlock.flash.image import pack_can_setup, pack_image, plan
    from fluxlock.flash.loader import HELLO_S, Loader, LoaderError
    from fluxlock.flash.serial_port import SerialPort

    loaded = load_scenario(scenario, set_ or ())
    check_parameters(loaded)
    image = pack_image(image_of(loaded).read_bytes(), loaded.motor.phases)
    bus = loaded.can
    setup = pack_can_setup(bus.node_id, bus.bit_rate_kbit_per_s) if bus is not None else b""
    steps = plan(image, parameter_block(loaded).pack(), setup)
    if not os.access(port, os.R_OK | os.W_OK) or not port.is_char_device():
        raise ConfigError([Problem("--port", str(port), "is no serial port that may be read and written")])
    console = Console()
    with SerialPort(port) as line:
        loader = Loader(line)
        try:
            console.print("waiting for the loader: reset the board", highlight=False)
            version, identity = loader.find(max(1, round(wait_s / HELLO_S)))
            console.print(f"loader {version}, flash {identity:06x}", highlight=False)
            with Progress(console=Console(stderr=True)) as bar:
                task = bar.add_task("write", total=None)
                loader.upload(steps, lambda done, total: bar.update(task, completed=done, total=total))
            found = loader.start()
        except LoaderError as error:
            print(f"failed: {error}", file=sys.stderr)
            raise typer.Exit(EXIT_FAILED) from None
    if found != "good":
        print(f"failed: not started: {found}", file=sys.stderr)
        raise typer.Exit(EXIT_FAILED)
    console.print(f"started; {len(steps.write)} pages written", highlight=False)
