# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The command on the real chip: what the console refuses, and what is left when a run is broken off."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from fluxlock.base.paths import ROOT
from fluxlock.cosim.chip import build_chip
from tests.closed_loop.support import drive

SPIN = ROOT / "tests" / "closed_loop" / "scenarios" / "spin.toml"


def test_refused_lines_are_failures() -> None:
    """Each refused line with its time and reason, also those behind long replies and at the very end.

    Verifies: FRONT-17
    """
    lines = (
        (0.001, "get"),
        (0.0011, "start"),
        (0.0012, "status"),
        (0.006, "clear"),
        (0.01, "set carrier_hz 1"),
    )
    events = ",".join(f'{{at_s={at},command="{line}"}}' for at, line in lines)
    run = drive(SPIN, "refused", "duration_s=0.01", f"event=[{events}]", "window=[]", "expect=[]")
    assert [(round(r.time_s, 6), r.line) for r in run.data.rejected] == [
        (0.0011, "start"),
        (0.006, "clear"),
        (0.01, "set carrier_hz 1"),
    ]
    assert 'console at 0.001100 s: "start" was rejected: speed_rpm is 0' in run.verdict.failures
    assert len(run.verdict.failures) == 3
    assert run.data.isr["control"]["count"] > 0, "the statistics are still read"


def test_lines_of_one_instant_are_all_carried_out() -> None:
    """Longer together than the receive FIFO: each is sent when the one before is answered.

    Verifies: FRONT-17
    """
    lines = ("set speed_rpm 12000", "set accel_rpm_s 123456", "set commutation NSC", "get", "set accel_rpm_s 234567")
    events = ",".join(f'{{at_s=0.002,command="{line}"}}' for line in lines)
    run = drive(SPIN, "one-instant", "duration_s=0.004", f"event=[{events}]", "window=[]", "expect=[]")
    assert run.data.rejected == []
    assert "accel_rpm_s 123456" in run.console()


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_build_broken_off_leaves_no_compiler(tmp_path: Path) -> None:
    """A build takes everything it has started with it.

    Verifies: FRONT-18
    """
    pid_file = tmp_path / "pid"
    program = (
        "import os, pathlib; from fluxlock.cosim.chip import _run;"
        f"_run(['sh', '-c', 'sleep 300 & echo $! > {pid_file}; wait'],"
        f"pathlib.Path('{tmp_path}/log'), dict(os.environ))"
    )
    build = subprocess.Popen([sys.executable, "-c", program], stderr=subprocess.DEVNULL)
    give_up = time.monotonic() + 60
    while not (pid_file.exists() and pid_file.read_text().strip()) and time.monotonic() < give_up:
        time.sleep(0.05)
    grandchild = int(pid_file.read_text())
    build.send_signal(signal.SIGINT)
    build.wait(timeout=120)
    assert gone(grandchild), "the compiler runs on"


def gone(pid: int) -> bool:
    """Whether a process ends within a minute; where nobody reaps it, it may stay as a zombie."""
    stat = Path(f"/proc/{pid}/stat")
    give_up = time.monotonic() + 60
    while time.monotonic() < give_up:
        try:
            if stat.read_text().rpartition(")")[2].split()[0] == "Z":
                return True
        except (FileNotFoundError, ProcessLookupError):
            return True
        time.sleep(0.05)
    return False


def children_of(pid: int) -> list[int]:
    return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
@pytest.mark.parametrize(
    ("number", "code"), [(signal.SIGTERM, 143), (signal.SIGINT, 130), (signal.SIGKILL, -signal.SIGKILL)]
)
def test_no_process_is_left(tmp_path: Path, number: signal.Signals, code: int) -> None:
    """A run that is broken off takes the simulator's process with it, without a traceback.

    Verifies: FRONT-18
    """
    build_chip(method="six-step")
    command = [sys.executable, "-m", "fluxlock.cli", "run", str(SPIN), "--out", str(tmp_path)]
    run = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    progress = tmp_path / "simulator" / "progress.json"
    give_up = time.monotonic() + 120
    while not progress.exists() and run.poll() is None and time.monotonic() < give_up:
        time.sleep(0.05)
    assert progress.exists() and run.poll() is None
    (simulator,) = children_of(run.pid)
    os.kill(run.pid, number)
    _, err = run.communicate(timeout=120)
    assert run.returncode == code and "Traceback" not in err
    word = {signal.SIGINT: "interrupted\n", signal.SIGTERM: "terminated\n", signal.SIGKILL: ""}[number]
    assert err.endswith(word)
    assert gone(simulator), "the simulator runs on"
