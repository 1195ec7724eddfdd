# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Folders and files below `build/`: locks, and those that cannot be written.

The latter is one line that says which and what to do, no traceback.
"""

from __future__ import annotations

import errno
import fcntl
import os
import signal
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

EXIT_BAD_INPUT = 2
EXIT_READER_GONE = 128 + signal.SIGPIPE
OWN = "let this user write there, or work in a checkout of your own"
ROOM = "make room"
ADVICE = {
    errno.EACCES: OWN,
    errno.EPERM: OWN,
    errno.EROFS: "work in a checkout that can be written",
    errno.ENOSPC: ROOM,
    errno.EDQUOT: ROOM,
    errno.ENOTSUP: "clone the repository and run it there",
}


def refusal(error: BaseException) -> str | None:
    """What the system refused and what to do, in one line; None if the error is none of this kind."""
    if not isinstance(error, OSError) or error.errno not in ADVICE:
        return None
    path = f"{error.filename}: " if error.filename else ""
    return f"{path}{error.strerror}; {ADVICE[error.errno]}"


def check_folder(folder: Path) -> None:
    """Make a folder and see that files can be made in it; OSError names the folder that refuses."""
    folder.mkdir(parents=True, exist_ok=True)
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise type(error)(error.errno, error.strerror, str(folder)) from None


def check_file(path: Path) -> None:
    """See that a file can be written, before what is to stand in it takes time; OSError names it or its folder."""
    check_folder(path.parent)
    if path.exists() and not os.access(path, os.W_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))


def write_whole(path: Path, text: str) -> None:
    """Write a file that others may read, or write, meanwhile: they find the whole old one or the whole new one."""
    own = path.with_name(f"{path.name}.{os.getpid()}-{threading.get_native_id()}.part")
    own.write_text(text, encoding="utf-8")
    own.replace(path)


class InUseError(RuntimeError):
    """Another process, or another part of this one, has the lock."""


@contextmanager
def file_lock(path: Path, wait: bool = True) -> Iterator[None]:
    """Hold an exclusive lock, which ends with the process at the latest. wait: until it is free; else InUseError."""
    check_folder(path.parent)
    with path.open("w") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        except BlockingIOError:
            raise InUseError(str(path)) from None
        yield


@contextmanager
def alone(folder: Path, wait: bool = False) -> Iterator[None]:
    """Have a folder, made if it is not there, to oneself. wait: until it is free; else InUseError."""
    with file_lock(folder / ".lock", wait):
        yield


def reader_gone() -> int:
    """Exit code where the reader of the output, such as `head`, has enough.

    What is left goes nowhere, also when the interpreter flushes.
    """
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return EXIT_READER_GONE


def guarded(main: Callable[[], int | None]) -> int:
    """Exit code of a module's command line; 2 with a line on the error output where something cannot be written."""
    try:
        code = main() or 0
        sys.stdout.flush()
        return code
    except BrokenPipeError:
        return reader_gone()
    except OSError as error:
        text = refusal(error)
        if text is None:
            raise
        print(f"error: {text}", file=sys.stderr)
        return EXIT_BAD_INPUT
