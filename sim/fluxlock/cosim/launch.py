# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Start the simulator's process on a plan and wait for it."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import cocotb_tools.config

from fluxlock.base.paths import BUILD, ROOT
from fluxlock.base.stage import SIMULATING, Progress, ProgressInfo
from fluxlock.cosim.chip import Chip
from fluxlock.cosim.plan import META_FILE, PLAN_ENV, PROGRESS_FILE, SessionPlan
from fluxlock.cosim.waves import GTKWAVE_FILE, SURFER_FILE, WAVE_FILE, write_view
from fluxlock.firmware import BusLibrary
from fluxlock.generate.registers import python_library

LOG_FILE = "simulator.log"  # in the plan's folder


class SimulatorError(Exception):
    """The simulator's process ended without a result; the message holds the end of its log."""


def bytecode_environment() -> dict[str, str]:
    """A simulator's Python keeps what it compiles, whatever its caller does: else it imports for twice as long."""
    prefix = os.environ.get("PYTHONPYCACHEPREFIX", str(BUILD / "pycache"))
    return {"PYTHONPYCACHEPREFIX": prefix, "PYTHONDONTWRITEBYTECODE": ""}


def simulator_environment(
    plan_file: Path, results: Path, top: str, module: str = "fluxlock.cosim.planned"
) -> dict[str, str]:
    """Environment in which a Verilated executable finds this interpreter, cocotb, the plan and the test that leads."""
    env = dict(os.environ)
    env.update(
        GPI_USERS=f"{python_library()};{cocotb_tools.config.pygpi_entry_point()}",
        PYGPI_PYTHON_BIN=sys.executable,
        PYTHONPATH=os.pathsep.join([str(ROOT), *filter(None, sys.path)]),
        PATH=os.pathsep.join([env.get("PATH", ""), str(cocotb_tools.config.libs_dir)]),
        COCOTB_TOPLEVEL=top,
        COCOTB_TEST_MODULES=module,
        COCOTB_RESULTS_FILE=str(results),
        COCOTB_REWRITE_ASSERTION_FILES="test_*.py",
        COCOTB_LOG_LEVEL="WARNING",
        TOPLEVEL_LANG="verilog",
        COCOTB_TRUST_INERTIAL_WRITES="1",
        **bytecode_environment(),
    )
    for name in ("PYTEST_CURRENT_TEST", "COCOTB_TEST_FILTER"):
        env.pop(name, None)
    env[PLAN_ENV] = str(plan_file)
    return env


@contextmanager
def _interrupts_left_to(debugger: Sequence[str]) -> Iterator[None]:
    """Ctrl-C at a debugger's terminal is meant for what it debugs."""
    before = signal.signal(signal.SIGINT, signal.SIG_IGN) if debugger else None
    try:
        yield
    finally:
        if debugger:
            signal.signal(signal.SIGINT, before)


def run_plan(
    plan: SessionPlan,
    chip: Chip,
    progress: Progress | None = None,
    own_group: bool = False,
    firmware: BusLibrary | None = None,
    debugger: Sequence[str] = (),
) -> dict[str, Any]:
    """Run a plan whose folder holds `firmware.hex`; return the meta data, leave the arrays in the folder.

    A chip that can write waveforms writes those of the plan's zoom window. own_group: Ctrl-C does not reach the
    simulator; whoever has asked for that ends it. firmware: of a chip without its core. debugger: words in front of the
    simulator's command; it has the terminal then, in place of the log file.
    """
    folder = plan.folder
    for name in (META_FILE, PROGRESS_FILE, WAVE_FILE, GTKWAVE_FILE, SURFER_FILE):
        (folder / name).unlink(missing_ok=True)
    command = [*debugger, str(chip.executable)]
    if chip.waves:
        first, last = plan.plant.recording.zoom[0]
        command += ["--waves-from", str(first), "--waves-to", str(last)]
    log_path = folder / LOG_FILE
    env = simulator_environment(plan.save(), folder / "results.xml", chip.top)
    if firmware is not None:
        command += ["--firmware", str(firmware.path)]
        env.update(_sanitizer_environment(firmware))
    with log_path.open("w") as log:
        group = 0 if own_group else None
        output = None if debugger else log
        process = subprocess.Popen(
            command, cwd=folder, env=env, stdout=output, stderr=output and subprocess.STDOUT, process_group=group,
            pass_fds=() if plan.gdb is None else (plan.gdb,),
        )  # fmt: skip
        stop = threading.Event()
        watcher = threading.Thread(target=_watch, args=(plan, progress, stop), daemon=True)
        if progress is not None:
            watcher.start()
        try:
            with _interrupts_left_to(debugger):
                process.wait()
        except BaseException:
            # Ctrl-C, SIGTERM: the simulator has nothing to clean up, and must not outlive the command.
            process.kill()
            process.wait()
            raise
        finally:
            stop.set()
            if progress is not None:
                watcher.join()
    if (folder / WAVE_FILE).exists():
        write_view(folder, chip.phases, chip.paths)
    meta_path = folder / META_FILE
    if not meta_path.exists():
        tail = "\n".join(log_path.read_text(errors="replace").splitlines()[-25:])
        raise SimulatorError(
            f"the simulator ended with code {process.returncode} and no result; end of {log_path}:\n{tail}"
        )
    meta: dict[str, Any] = json.loads(meta_path.read_text())
    return meta


def _sanitizer_environment(firmware: BusLibrary) -> dict[str, str]:
    """Their runtime, ahead of all libraries; what Python still holds at its end is no leak."""
    if firmware.preload is None:
        return {}
    options = "detect_leaks=0:print_legend=0"
    return {"LD_PRELOAD": str(firmware.preload), "ASAN_OPTIONS": options, "UBSAN_OPTIONS": "print_stacktrace=1"}


def _watch(plan: SessionPlan, progress: Progress | None, stop: threading.Event) -> None:
    """Turn the simulator's progress file into calls of `progress`."""
    path = plan.folder / PROGRESS_FILE
    duration = plan.duration_cycles / plan.clock_hz
    last = ""
    while progress is not None and not stop.is_set():
        text = path.read_text() if path.exists() else ""
        if text and text != last:
            last = text
            line = json.loads(text)
            t_s = min(line["t_s"], duration)  # the statistics are asked after the end
            end = min(t_s / line["share"], duration) if line.get("share") else duration
            stage = line.get("stage", SIMULATING)
            progress(ProgressInfo(t_s, end, line["speed_rpm"], line["rate_cycles_per_s"], stage))
        time.sleep(0.1)
