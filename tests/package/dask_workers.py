# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A Dask scheduler and workers, begun by hand."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

BEGIN_S = 300  # on a busy machine
WORKER = ("-m", "distributed.cli.dask_worker")


class Dask:
    """A scheduler that runs. file: says where it is. workers: processes, in the order of their beginning."""

    def __init__(self, folder: Path, environment: Mapping[str, str] | None, threads: int) -> None:
        self.folder, self.environment, self.file = folder, environment, folder / "scheduler.json"
        self.threads = str(threads)
        scheduler = ["-m", "distributed.cli.dask_scheduler", "--port", "0", "--host", "127.0.0.1"]
        self.scheduler = self._begin([*scheduler, "--scheduler-file", str(self.file)])
        self.workers: list[subprocess.Popen[bytes]] = []

    def _begin(self, arguments: Sequence[str]) -> subprocess.Popen[bytes]:
        command = [sys.executable, *arguments, "--no-dashboard"]
        return subprocess.Popen(command, cwd=self.folder, env=self.environment)

    def begin_worker(self, program: Sequence[str] = WORKER) -> None:
        """Begin a worker."""
        self.workers.append(
            self._begin([*program, "--scheduler-file", str(self.file), "--nthreads", self.threads, "--no-nanny"])
        )

    def address(self) -> str:
        """Address of the scheduler, once it is there."""
        give_up = time.monotonic() + BEGIN_S
        while not self.file.exists() and time.monotonic() < give_up:
            time.sleep(0.1)
        return str(json.loads(self.file.read_text())["address"])


@contextmanager
def dask_workers(
    folder: Path, count: int, environment: Mapping[str, str] | None = None, threads: int = 1
) -> Iterator[Dask]:
    """A scheduler with so many workers, which end with the block. folder: that they run in; threads: of each."""
    made = Dask(folder, environment, threads)
    try:
        for _ in range(count):
            made.begin_worker()
        yield made
    finally:
        for process in (*made.workers, made.scheduler):
            process.kill()
            process.wait()
