# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""cocotb tests that do not see each other: each runs in a copy of the simulation, from power-up or a common start."""

from __future__ import annotations

import os
from collections.abc import Awaitable, Callable
from functools import wraps
from multiprocessing import Pipe
from typing import Any, ClassVar

import cocotb

from fluxlock.drive.bench import DRIVE_TEST
from fluxlock.drive.copies import Copy, Report
from fluxlock.drive.drive import Drive, session_of_process

Body = Callable[[Drive], Awaitable[None]]


class Holder:
    """A copy of the simulation that has made a common start, and is copied for each test that goes on from there."""

    made: ClassVar[dict[Body, Holder]] = {}  # of this process

    def __init__(self) -> None:
        self._ours, self._its = Pipe()
        self.copy = Copy()
        (self._its if self.copy.pid else self._ours).close()

    async def serve(self, dut: object, start: Body) -> None:
        """The copy: make the start, then run a test in a copy for each number that comes. Does not return."""
        drive = Drive(dut)
        await start(drive)
        while True:
            try:
                body = bodies[self._its.recv()]
            except EOFError:  # the simulation is over
                os._exit(0)
            copy = Copy()
            if copy.pid == 0:
                await lead(body, drive)
                copy.end()
            self._its.send(copy.wait())

    def ask(self, body: Body) -> Report:
        """The original: have a test run."""
        try:
            self._ours.send(bodies.index(body))
            report = self._ours.recv()
        except (EOFError, OSError):
            end = self.copy.wait()
            return Report(f"the common start did not come to its end:\n{end.error}", None)
        assert isinstance(report, Report)
        return report


bodies: list[Body] = []


async def lead(body: Body, drive: Drive) -> None:
    """Run a test's body. The log says how far it came: cocotb's table has the time of the process that waits, 0."""
    try:
        await body(drive)
    finally:
        cocotb.log.info(f"{body.__qualname__} ends at {drive.time_s:.6f} s after {drive.session.cycle} clocks")


def drive_test(
    after: Body | None = None,
    **options: Any,  # noqa: ANN401  # cocotb's, each with its type
) -> Callable[[Body], object]:
    """Make a cocotb test of a coroutine that takes a `Drive`. It begins at the chip's power-up, or where `after` ends.

    after: a coroutine that takes a `Drive`, for instance to start the motor. It runs once; every test with the same
    `after` goes on from a copy of its end. options: of `cocotb.test`, for instance `expect_fail`.
    """

    def make(body: Body) -> object:
        bodies.append(body)

        @wraps(body)
        async def test(dut: object) -> None:
            session_of_process()  # once for all copies
            if after is None:
                copy = Copy()
                if copy.pid == 0:
                    await lead(body, Drive(dut))
                    copy.end()
                report = copy.wait()
            else:
                holder = Holder.made.get(after)
                if holder is None:
                    holder = Holder.made[after] = Holder()
                    if holder.copy.pid == 0:
                        await holder.serve(dut, after)
                report = holder.ask(body)
            if report.error is not None:
                raise AssertionError(report.error)

        made = cocotb.test(**options)(test)
        setattr(made, DRIVE_TEST, True)
        return made

    return make
