# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The real bench: a board gets the commissioning program, which then answers at its serial port."""

from __future__ import annotations

import contextlib
import time
from pathlib import Path

from rich.console import Console as Terminal

from fluxlock.base.stage import Progress, ProgressInfo
from fluxlock.commission.protocol import MeasurementError
from fluxlock.commission.simulate import Measured, known_of
from fluxlock.config import Scenario
from fluxlock.cosim.plan import Dialogue
from fluxlock.firmware import build_commission
from fluxlock.flash.board_console import Console, Port, SilentError
from fluxlock.flash.command import check_board, open_port, write_and_start
from fluxlock.flash.image import pack_image, plan
from fluxlock.flash.loader import LoaderError, SerialLine
from fluxlock.flash.serial_port import PortError

BOOT_S = 0.1  # auto-zero of the current channels included
OFF = "o"


def converse(dialogue: Dialogue, port: Port, progress: Progress | None = None) -> object:
    """Lead a dialogue at a port; its conclusion. However it ends, the gates are off.

    Raises what the dialogue raises, and MeasurementError if the board is silent.
    """
    try:
        console, begin_s = Console(port), time.monotonic()
    except SilentError as error:
        raise MeasurementError(str(error)) from None
    try:
        talk = dialogue.conversation()
        line = next(talk)
        while True:
            reply = console.ask(line)
            if progress is not None:
                now_s = time.monotonic() - begin_s
                share = max(dialogue.share, 0.01)
                progress(ProgressInfo(now_s, now_s / share, 0.0, 0.0, dialogue.stage))
            line = talk.send(reply)
    except StopIteration as end:
        return end.value
    except SilentError as error:
        raise MeasurementError(str(error)) from None
    finally:
        with contextlib.suppress(SilentError):
            console.ask(OFF)


def measure_on_board(bench: Scenario, port: Path, wait_s: float, progress: Progress | None = None) -> Measured:
    """Write the commissioning program into a board's flash, start it and measure the machine there.

    wait_s: for the board's reset. Raises ConfigError (see known_of, check_board) and MeasurementError.
    """
    check_board(bench)
    dialogue, block = known_of(bench)
    steps = plan(pack_image(build_commission().read_bytes(), bench.motor.phases), block.pack())
    with open_port(port) as serial:
        try:
            write_and_start(SerialLine(serial), steps, wait_s, Terminal(stderr=True))
        except (LoaderError, PortError) as error:
            raise MeasurementError(str(error)) from None
        time.sleep(BOOT_S)
        begin_s = time.monotonic()
        values = converse(dialogue, serial, progress)
    assert isinstance(values, dict)
    wall_s = time.monotonic() - begin_s
    return Measured(values, wall_s, wall_s)
