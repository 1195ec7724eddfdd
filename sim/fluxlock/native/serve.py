# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Join a native drive to a bus of python-can and to a console, paced by the clock."""

from __future__ import annotations

import time
from collections.abc import Callable

import can

from fluxlock.native.drive import STEP_US, NativeDrive
from fluxlock.native.node import EXTENDED, REMOTE, Frame

STEP_S = STEP_US / 1e6
# Of a bus at 1 Mbit/s in a millisecond; more wait, as they would on wires.
FRAMES_A_STEP = 20
# What the clock is ahead by at most: a machine that was held up for longer does not race to catch up.
LAG_S = 0.1


def serve(
    drive: NativeDrive,
    bus: can.BusABC,
    stop: Callable[[], bool],
    speed: float | None = 1.0,
    keep: Callable[[], None] | None = None,
) -> None:
    """Run until `stop` says so, which is asked once a simulated millisecond.

    speed: simulated over real time; None: as fast as it goes. keep: makes lasting what a frame has stored, before the
    answer to it is sent.
    """
    due = time.monotonic()
    while not stop():
        drive.step()
        _send(drive, bus)
        if speed is not None:
            due = max(due + STEP_S / speed, time.monotonic() - LAG_S)
        taken = 0
        while taken < FRAMES_A_STEP:
            wait = max(0.0, due - time.monotonic()) if speed is not None else 0.0
            message = bus.recv(wait)
            if message is None:
                if wait == 0.0:
                    break
                continue
            taken += 1
            _receive(drive, message)
            if keep is not None:
                keep()
            _send(drive, bus)
        if speed is not None:
            time.sleep(max(0.0, due - time.monotonic()))


def _receive(drive: NativeDrive, message: can.Message) -> None:
    if message.is_error_frame or message.is_fd:
        return
    flags = (EXTENDED if message.is_extended_id else 0) | (REMOTE if message.is_remote_frame else 0)
    drive.node.receive(Frame(message.arbitration_id, bytes(message.data), flags))


def _send(drive: NativeDrive, bus: can.BusABC) -> None:
    for frame in drive.node.sent():
        bus.send(can.Message(arbitration_id=frame.id, data=frame.data, is_extended_id=False), timeout=1.0)
