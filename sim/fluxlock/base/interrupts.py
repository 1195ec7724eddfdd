# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Ctrl-C while modules are loaded. Imports nothing that is slow: until this is there, Python shows a traceback."""

from __future__ import annotations

import os
import signal

EXIT_INTERRUPTED = 128 + signal.SIGINT
EXIT_TERMINATED = 128 + signal.SIGTERM


def _leave_aloud(*_: object) -> None:
    os.write(2, b"interrupted\n")
    os._exit(EXIT_INTERRUPTED)


def _leave(*_: object) -> None:
    os._exit(EXIT_INTERRUPTED)


def leave_when_interrupted(aloud: bool = True) -> None:
    """Let Ctrl-C end the process at once, until `raise_when_interrupted`; aloud: with a word on the error output.

    An exception in the middle of an import would be shown, or taken for a module that is missing. Where Ctrl-C is
    ignored or handled already, as in the background of a shell, it stays so.
    """
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _leave_aloud if aloud else _leave)


def raise_when_interrupted() -> None:
    """Let Ctrl-C raise KeyboardInterrupt again."""
    if signal.getsignal(signal.SIGINT) in (_leave_aloud, _leave):
        signal.signal(signal.SIGINT, signal.default_int_handler)


def hold_interrupts() -> None:
    """Keep Ctrl-C back, also in processes that are begun meanwhile, until `release_interrupts` in each of them."""
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})


def release_interrupts() -> None:
    """Let Ctrl-C through, also one that came meanwhile."""
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})


def begin_worker(module: str) -> None:
    """First call of a worker process: load what its work needs. The parent says what Ctrl-C has ended."""
    leave_when_interrupted(aloud=False)
    release_interrupts()
    __import__(module)
    raise_when_interrupted()
