# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Work side by side: in processes of this machine, or on the workers of a Dask scheduler."""

from __future__ import annotations

import multiprocessing
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Collection, Iterator, Sequence
from concurrent.futures import CancelledError, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import cache, partial
from importlib import import_module
from pathlib import Path
from typing import Any, Protocol, TypeVar

from fluxlock.base.interrupts import begin_worker, hold_interrupts, release_interrupts
from fluxlock.base.paths import BUILD, PACKAGE, ROOT, SHARE, content_hash
from fluxlock.config.errors import ConfigError, Problem, ToolsMissing

Item = TypeVar("Item")
Result = TypeVar("Result")
ANSWER_S = 10  # a scheduler that has not answered by then is not there
LOOK_S = 0.2
DESERTED_S = 60  # a scheduler whose last worker has gone gets a new one by then, or not at all
LOST = (
    "a worker process ended before its result: the machine has run out of memory, or a script asks for jobs > 1 "
    'outside of `if __name__ == "__main__":`'
)
NO_FLUXLOCK = "a worker has no Fluxlock, or another version: install the same one there, or use its checkout"
EXTRA = "`make setup` in a checkout, else pip install 'fluxlock[sweep]'"


class Cluster(Protocol):
    """What one of Dask's deployers has made."""

    @property
    def scheduler_address(self) -> str:
        """Address of its scheduler."""


_SCHEDULER: ContextVar[str | Cluster | None] = ContextVar("scheduler", default=None)


class WorkerLost(RuntimeError):
    """A process of the pool ended without a word."""


class OtherVersion(RuntimeError):
    """A worker has another Fluxlock than the one that asks it, no tools, or another folder where both must have one."""


@cache
def sources(package: str = "fluxlock") -> str:
    """Hash of everything that a result depends on: Python, RTL, firmware. Equal ones give equal bits.

    It is the same wherever the folders lie, as in a wheel. package: "fluxverify" reads tests and shipped files of the
    checkout too.
    """
    folders = [PACKAGE, ROOT / "rtl", ROOT / "sw", ROOT / "sim" / "native"]
    if package != PACKAGE.name:
        folders += [PACKAGE.with_name(package), *(ROOT / x for x in ("scenarios", "motors", "inverters"))]
        folders.append(ROOT / "cocotb_tests")
    kinds = (".py", ".sv", ".svh", ".f", ".rdl", ".c", ".h", ".S", ".ld", ".toml", ".cpp", ".vlt")
    found = [[p for p in folder.rglob("*") if p.suffix in kinds and p.is_file()] for folder in folders]
    found[0] = [p for p in found[0] if not p.is_relative_to(SHARE)]
    return content_hash([], *map(content_hash, found))


@cache
def versions() -> dict[str, str]:
    """Versions of what a result depends on besides the sources: packages, and Python, whose "3.12" has one bytecode."""
    from fluxlock.results.result import package_versions

    return {"Python": f"{sys.version_info.major}.{sys.version_info.minor}", **package_versions()}


@contextmanager
def on_scheduler(scheduler: str | Cluster | None) -> Iterator[None]:
    """Within, `side_by_side` hands its items to the workers of a Dask scheduler; None: to processes, as without.

    scheduler: its address, or a cluster. ConfigError names a worker with another version or another folder.
    """
    before = _SCHEDULER.set(scheduler)
    try:
        yield
    except OtherVersion as error:
        if scheduler is None:
            raise
        raise ConfigError([Problem("--scheduler", _address(scheduler), str(error))]) from None
    finally:
        _SCHEDULER.reset(before)


def _address(scheduler: str | Cluster) -> str:
    return str(getattr(scheduler, "scheduler_address", scheduler))


def side_by_side(
    work: Callable[[Item], Result],
    items: Sequence[Item],
    jobs: int,
    done: Callable[[Item, Result], None],
    look: Callable[[], None] | None = None,
    shares_build: bool = False,
) -> None:
    """Call work(item) for all items; done: called with every result as it comes, in this process.

    jobs: processes of this machine; 1: this one alone. Within `on_scheduler` the workers of Dask take their place; one
    that is lost costs its item's run, which another one repeats. look: called a few times a second meanwhile, in
    a thread of this process, for items that leave files as they go on. shares_build: items leave results in the folder
    `build`, which a worker must have at the same place. An exception of `work` ends the rest and is raised. WorkerLost:
    a process ended. ConfigError: no scheduler answers, or its last worker has gone. OtherVersion: a worker has other
    sources, another folder, or no tools for a build.
    """
    scheduler = _SCHEDULER.get()
    with _looking(look):
        if scheduler is not None:
            _on_dask(work, items, scheduler, done, shares_build)
        elif jobs > 1:
            _in_processes(work, items, jobs, done)
        else:
            for item in items:
                done(item, work(item))


def shares(items: Sequence[Item], most: int) -> list[tuple[Item, ...]]:
    """Items dealt out, at most so many to a share, for work that begins with something which all of a share use.

    >>> shares("abcde", 2)
    [('a', 'd'), ('b', 'e'), ('c',)]
    """
    count = -(-len(items) // most)
    return [tuple(items[k::count]) for k in range(count)]


@contextmanager
def _looking(look: Callable[[], None] | None) -> Iterator[None]:
    stop = threading.Event()

    def watch(seen: Callable[[], None]) -> None:
        while not stop.wait(LOOK_S):
            seen()

    if look is None:
        yield
        return
    watcher = threading.Thread(target=watch, args=(look,), daemon=True)
    watcher.start()
    try:
        yield
    finally:
        stop.set()
        watcher.join()


def _in_processes(
    work: Callable[[Item], Result], items: Sequence[Item], jobs: int, done: Callable[[Item, Result], None]
) -> None:
    module = getattr(work, "func", work).__module__  # of a partial function: that of the function
    with ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn"), begin_worker, (module,)) as pool:
        hold_interrupts()
        try:
            pending = {pool.submit(work, item): item for item in items}  # begins the workers
        finally:
            release_interrupts()
        try:
            for future in as_completed(pending):
                done(pending[future], future.result())
        except BrokenProcessPool:
            raise WorkerLost(LOST) from None
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            # SIGTERM and an error have reached this process alone; the simulators end with the workers.
            for worker in multiprocessing.active_children():
                worker.terminate()
            raise


@dataclass(frozen=True)
class _Asked:
    """What a worker must have in common with the process that asks it. mark: a file of both; "": none is needed."""

    package: str
    made_by: str
    mark: str
    versions: dict[str, str]

    def check(self) -> None:
        """Raise OtherVersion on a worker that has something else."""
        theirs = versions()
        others = [
            f"{k} {theirs.get(k, 'missing')} in place of {v}" for k, v in self.versions.items() if theirs.get(k) != v
        ]
        if others:
            text = f"a worker has {', '.join(others)}: results might differ; install the same ones there"
            raise OtherVersion(text)
        if sources(self.package) != self.made_by:
            text = "a worker has another version of Fluxlock: install the same one there, or use its checkout"
            raise OtherVersion(text)
        if self.mark and not (Path(self.mark).parent == BUILD and Path(self.mark).exists()):
            text = f"a worker does not have the folder {Path(self.mark).parent}, where this command keeps its results: "
            raise OtherVersion(text + "share the checkout, and start the worker from it")

    def call(self, work: Callable[[Item], Result], item: Item) -> Result:
        """Call work(item) on a worker, or raise OtherVersion: one that joins later has not been asked."""
        try:
            self.check()
            return work(item)
        except (OtherVersion, ToolsMissing) as error:
            worker: Any = import_module("distributed").get_worker()
            raise OtherVersion(f"{worker.address}: {error}") from None


def _on_dask(
    work: Callable[[Item], Result],
    items: Sequence[Item],
    scheduler: str | Cluster,
    done: Callable[[Item, Result], None],
    shares_build: bool,
) -> None:
    address = _address(scheduler)
    try:
        distributed: Any = import_module("distributed")  # without types
    except ImportError:
        raise ConfigError([Problem("--scheduler", address, f"needs Dask: {EXTRA}")]) from None
    if getattr(scheduler, "asynchronous", False):  # its loop is the caller's, which would wait for itself
        text = "an asynchronous cluster cannot answer while this call waits; make it without `asynchronous`"
        raise ConfigError([Problem("--scheduler", address, text)])
    try:
        client = distributed.Client(address, timeout=ANSWER_S, security=getattr(scheduler, "security", None))
    except (OSError, ValueError, TypeError, RuntimeError) as error:  # RuntimeError: one of the two wants encryption
        text = f"no scheduler answers there ({error}); start one with `dask scheduler`, workers with `dask worker`"
        raise ConfigError([Problem("--scheduler", address, text)]) from None
    package = str(getattr(work, "func", work).__module__).partition(".")[0]
    BUILD.mkdir(parents=True, exist_ok=True)
    with client, tempfile.NamedTemporaryFile(dir=BUILD, prefix=".asked-") as mark:
        asked = _Asked(package, sources(package), mark.name if shares_build else "", versions())
        for worker, answer in client.run(asked.check, on_error="return").items():
            # A worker without Fluxlock, or with one of long ago, cannot read the question. OSError: it has just ended.
            if isinstance(answer, Exception) and not isinstance(answer, OSError):
                text = str(answer) if isinstance(answer, OtherVersion) else f"{NO_FLUXLOCK} ({answer})"
                raise OtherVersion(f"{worker}: {text}")
        # pure: an equal item is not taken from the scheduler's memory, the store of results is ours.
        pending = {client.submit(partial(asked.call, work), item, pure=False): item for item in items}
        try:
            with _looking(_deserted(lambda: client.scheduler_info()["workers"], lambda: client.cancel(list(pending)))):
                for future in distributed.as_completed(pending):
                    done(pending[future], future.result())
        except CancelledError:
            text = f"has had no worker for {DESERTED_S} s; look at their output, and start one with `dask worker`"
            raise ConfigError([Problem("--scheduler", address, text)]) from None
        except distributed.KilledWorker as error:
            text = f"a run has ended every worker that began it; look at their output ({error})"
            raise ConfigError([Problem("--scheduler", address, text)]) from None


def _deserted(workers: Callable[[], Collection[str]], cancel: Callable[[], None]) -> Callable[[], None]:
    """To be called again and again: cancels once there have long been no workers."""
    seen_s = time.monotonic()

    def look() -> None:
        nonlocal seen_s
        now_s = time.monotonic()
        if workers():
            seen_s = now_s
        elif now_s - seen_s > DESERTED_S:
            cancel()

    return look
