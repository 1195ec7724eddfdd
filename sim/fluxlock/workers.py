# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Work side by side: in processes of this machine, or on the workers of a Dask scheduler."""

from __future__ import annotations

import multiprocessing
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from importlib import import_module
from typing import Any, TypeVar

from fluxlock.base.interrupts import begin_worker, hold_interrupts, release_interrupts
from fluxlock.config.errors import ConfigError, Problem

Item = TypeVar("Item")
Result = TypeVar("Result")
ANSWER_S = 10  # a scheduler that has not answered by then is not there
LOOK_S = 0.2
LOST = (
    "a worker process ended before its result: the machine has run out of memory, or a script asks for jobs > 1 "
    'outside of `if __name__ == "__main__":`'
)
EXTRA = "`make setup` in a checkout, else pip install 'fluxlock[sweep]'"


class WorkerLost(RuntimeError):
    """A process of the pool ended without a word."""


def side_by_side(
    work: Callable[[Item], Result],
    items: Sequence[Item],
    jobs: int,
    done: Callable[[Item, Result], None],
    scheduler: str | None = None,
    look: Callable[[], None] | None = None,
) -> None:
    """Call work(item) for all items; done: called with every result as it comes, in this process.

    jobs: processes of this machine; 1: this one alone. scheduler: address of a Dask scheduler, in place of them; a
    worker that is lost costs its item's run, which another one repeats. look: called a few times a second meanwhile, in
    a thread of this process, for items that leave files as they go on. An exception of `work` ends the rest and is
    raised. WorkerLost: a process ended. ConfigError: no scheduler answers.
    """
    with _looking(look):
        if scheduler is not None:
            _on_dask(work, items, scheduler, done)
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


def _on_dask(
    work: Callable[[Item], Result], items: Sequence[Item], scheduler: str, done: Callable[[Item, Result], None]
) -> None:
    try:
        distributed: Any = import_module("distributed")  # without types
    except ImportError:
        raise ConfigError([Problem("--scheduler", scheduler, f"needs Dask: {EXTRA}")]) from None
    try:
        client = distributed.Client(scheduler, timeout=ANSWER_S)
    except (OSError, ValueError) as error:
        text = f"no scheduler answers there ({error}); start one with `dask scheduler`, workers with `dask worker`"
        raise ConfigError([Problem("--scheduler", scheduler, text)]) from None
    with client:
        # pure: an equal item is not taken from the scheduler's memory, the store of results is ours.
        pending = {client.submit(work, item, pure=False): item for item in items}
        for future in distributed.as_completed(pending):
            done(pending[future], future.result())
