# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The installed command: what ends it before it has read the command line, and while its workers begin or work."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from contextlib import suppress
from importlib.metadata import entry_points
from pathlib import Path

import pytest

from fluxlock.base.interrupts import EXIT_TERMINATED
from fluxlock.base.paths import ROOT
from fluxlock.cosim import block

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
from fluxverify.regression import run

print("workers begin", file=sys.stderr, flush=True)
try:
    run.side_by_side(run._rows, ["a", "b"], 2, print)
except KeyboardInterrupt:
    sys.exit(130)
"""
    assert interrupted(program, seen, "workers begin") == (130, "workers begin\n")


def write_and_sleep(name: str) -> None:
    """Work of a worker that would last: leaves its process's number in the file `name`."""
    partial = Path(f"{name}.partial")
    partial.write_text(str(os.getpid()))
    partial.rename(name)
    time.sleep(600)


def alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def test_terminated_while_workers_work(tmp_path: Path) -> None:
    """A command that SIGTERM ends does not wait for what its workers have begun, and takes them with it.

    Verifies: FRONT-18
    """
    program = f"""
import signal, sys
from fluxlock.workers import side_by_side
from tests.config.test_entry import write_and_sleep

signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
side_by_side(write_and_sleep, [{str(tmp_path)!r} + f"/{{k}}" for k in range(4)], 2, print)
"""
    command = subprocess.Popen([sys.executable, "-c", program], cwd=ROOT, start_new_session=True)
    begun = [tmp_path / "0", tmp_path / "1"]
    give_up = time.monotonic() + 120
    try:
        while not all(path.exists() for path in begun) and command.poll() is None and time.monotonic() < give_up:
            time.sleep(0.05)
        workers = [int(path.read_text()) for path in begun]
        command.terminate()
        assert command.wait(60) == 143
        assert not any(map(alive, workers))
    finally:
        with suppress(ProcessLookupError):
            os.killpg(command.pid, signal.SIGKILL)
    assert not (tmp_path / "2").exists()


@pytest.mark.parametrize(("code", "raised"), [(EXIT_TERMINATED, SystemExit), (1, AssertionError)])
def test_terminated_while_a_block_is_simulated(
    code: int, raised: type[BaseException], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """SIGTERM during a block's tests ends the command; what else ends their simulator is a test that failed.

    Verifies: FRONT-18
    """

    class Runner:
        """Of cocotb: nothing to build, and an end instead of a simulation."""

        def build(self, **_: object) -> None:
            """Nothing."""

        def test(self, **_: object) -> None:
            sys.exit(code)

    monkeypatch.setattr(block, "BUILD", tmp_path)
    monkeypatch.setattr(block, "get_runner", lambda _: Runner())
    with pytest.raises(raised):
        block.run_block_test("fl_sync", ["common/fl_sync.sv"], __name__)
