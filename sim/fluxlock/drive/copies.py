# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Copies of the simulator's process: each goes on from the same state, runs its part of a test and reports its end."""

from __future__ import annotations

import os
import pickle
import sys
import tempfile
import traceback
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import IO, Any, ClassVar, Generic, TypeVar

from cocotb.task import Task, current_task

from fluxlock.base.processes import end_with_parent

Value = TypeVar("Value")
FAILED = "failed"
LEFT = "the body left the loop over the branch (return or break)"


class BranchError(AssertionError):
    """Ends of a branch failed; the text holds each with its value and its traceback."""


@dataclass(frozen=True)
class Report:
    """What a copy leaves. error: its traceback, None: it came to its end. kept: what the test wants to have of it."""

    error: str | None
    kept: object


def _flush() -> None:
    sys.stdout.flush()
    sys.stderr.flush()


def _pickled(report: Report) -> bytes:
    """A report; where pickle cannot carry what it keeps, one that says so."""
    try:
        return pickle.dumps(report)
    except Exception as error:  # whatever an object of the user's raises
        return pickle.dumps(Report(f"keep({report.kept!r}): pickle cannot carry it: {error}", None))


class Copy:
    """A copy of this process. In the original: `pid` is its number and `wait` gets its report; in the copy `pid` is 0.

    A copy that leaves its part of the test without `end`, by an exception or otherwise, reports that and ends there.
    """

    here: ClassVar[Copy | None] = None  # the one that this process is

    def __init__(self) -> None:
        # A file, not a pipe: a copy need not wait for whoever reads it.
        self._file: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115  # closed by `wait`
        _flush()
        self.pid = os.fork()
        if self.pid == 0:
            end_with_parent()
            Copy.here = self
            # Before cocotb's own callback, which would score the test and start the next one.
            current_task()._done_callbacks.insert(0, self._left)

    def end(self, error: str | None = None, kept: object = None) -> None:
        """The copy: report and be gone. A copy of it that has left its loop comes here too, and reports that."""
        if Copy.here is not None and Copy.here is not self:
            Copy.here.end(LEFT)
        code = 1
        try:
            self._file.write(_pickled(Report(error, kept)))
            self._file.flush()
            code = 0
        except Exception:
            traceback.print_exc()
        finally:
            _flush()
            # The simulator's own end waits for threads that a fork does not copy.
            os._exit(code)

    def _left(self, task: Task[Any]) -> None:
        if task.cancelled():
            self.end("the copy's test was cancelled: its timeout_time is over, or the log says why")
        error = task.exception()
        if error is None:
            self.end(LEFT)
        else:
            self.end("".join(traceback.format_exception(error)))

    def wait(self) -> Report:
        """The original: until the copy has ended."""
        _, status = os.waitpid(self.pid, 0)
        with self._file as file:
            file.seek(0)
            data = file.read()
        if not data:
            return Report(f"the copy ended with code {os.waitstatus_to_exitcode(status)} and no report", None)
        report = pickle.loads(data)
        assert isinstance(report, Report)
        return report


class End(Generic[Value]):
    """One end of a branch, in its own copy of the simulation. number: its place, value: what it is for."""

    def __init__(self, number: int, value: Value) -> None:
        self.number, self.value = number, value
        self.kept: object = None

    def keep(self, found: object) -> None:
        """What the test shall have of this end after the loop; anything that pickle can carry."""
        self.kept = found


class Branch(Generic[Value]):
    """Loop over the ends of a branch; after it `kept` holds what each of them has kept, in the order of the values.

    None stands for an end that has kept nothing.

    jobs: copies at a time.
    """

    def __init__(self, values: Iterable[Value], jobs: int = 1) -> None:
        self._values, self._jobs = list(values), max(1, jobs)
        self.kept: list[Any] = []
        self._looped = False

    def __iter__(self) -> Iterator[End[Value]]:
        """Each end in its copy; the original waits and comes out of the loop when all have ended.

        Raises BranchError there if some failed.
        """
        if self._looped:
            raise RuntimeError("a branch has one loop; call drive.branch again for another one")
        self._looped = True
        running: list[tuple[End[Value], Copy]] = []
        errors: list[str] = []

        def wait() -> None:
            end, copy = running.pop(0)
            report = copy.wait()
            self.kept.append(report.kept)
            if report.error is not None:
                errors.append(f"end {end.number} ({end.value!r}): {report.error.rstrip()}")

        for number, value in enumerate(self._values):
            if len(running) >= self._jobs:
                wait()
            end = End(number, value)
            copy = Copy()
            if copy.pid == 0:
                yield end
                copy.end(kept=end.kept)
            running.append((end, copy))
        while running:
            wait()
        if errors:
            raise BranchError(f"{len(errors)} of {len(self._values)} ends {FAILED}:\n" + "\n".join(errors))
