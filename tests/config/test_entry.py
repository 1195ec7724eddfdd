"""The installed command: what Ctrl-C does before the command line has been read, and while worker processes begin."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from importlib.metadata import entry_points

import pytest

SIGNALS = "import signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler); "


def interrupted(program: str, seen: str, since: str = "") -> tuple[int, str]:
    """Exit code and error output of a program that gets Ctrl-C as soon as it has loaded a module.

    since: a line on its error output, before which loading does not count.
    """
    # Python tells every module that it has loaded; those that follow take a good while.
    process = subprocess.Popen(
        [sys.executable, "-c", SIGNALS + program],
        env={**os.environ, "PYTHONPROFILEIMPORTTIME": "1"},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    give_up = threading.Timer(60, lambda: os.killpg(process.pid, signal.SIGKILL))
    give_up.start()
    assert process.stderr
    lines, ready, sent = [], not since, False
    for line in process.stderr:
        if not line.startswith("import time:"):
            ready = ready or line.strip() == since
            lines.append(line)
        elif ready and not sent and line.rpartition("|")[2].strip() == seen:
            os.killpg(process.pid, signal.SIGINT)
            sent = True
    code = process.wait()
    give_up.cancel()
    return code, "".join(lines)


@pytest.mark.parametrize("seen", ["typer", "rich.console", "pydantic_core", "numpy._core.multiarray"])
def test_interrupted_while_it_loads(seen: str) -> None:
    """Ctrl-C while modules are loaded: one word and exit code 130.

    Verifies: FRONT-18
    """
    (entry,) = entry_points(group="console_scripts", name="fluxlock")
    program = f"sys.argv = ['fluxlock', 'stability', '--help']; from {entry.module} import {entry.attr}; {entry.attr}()"
    assert interrupted(program, seen) == (130, "interrupted\n")


@pytest.mark.parametrize("seen", ["concurrent.futures", "numpy._core.multiarray"])
def test_interrupted_while_workers_load(seen: str) -> None:
    """Ctrl-C while the worker processes load their modules: the command alone ends aloud.

    Verifies: FRONT-18
    """
    program = """
from fluxlock.regression import runner

runner.ready_chip = runner.build_firmware = lambda *_: None
print("workers begin", file=sys.stderr, flush=True)
try:
    runner.side_by_side(runner._rows, ["a", "b"], False, 1, 2, print)
except KeyboardInterrupt:
    sys.exit(130)
"""
    assert interrupted(program, seen, "workers begin") == (130, "workers begin\n")
