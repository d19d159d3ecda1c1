"""Parallel work: in processes of this machine, or on a Dask cluster."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing.connection import wait
from threading import Thread
from typing import Any, TypeVar

from fracgyro.simulation.many import threads_available
from fracgyro.study.cluster import Work, connected, measured_there

W = TypeVar("W", bound=Work[Any])
Progress = Callable[[int], object]
Workers = Callable[[list[W], Progress], Iterator[tuple[W, Any]]]


@contextmanager
def workers(scheduler: str | None) -> Iterator[Workers[Any]]:
    """A function that yields each unit of work with its result, in order of completion.

    Raises ValueError if the cluster cannot be reached, a unit of work fails, or a process dies.
    """
    if scheduler is not None:
        with connected(scheduler) as client:
            yield lambda work, progress: measured_there(client, work, progress)
        return
    count = threads_available()
    context = multiprocessing.get_context("spawn")  # a fork of a process with threads may hang
    pool = ProcessPoolExecutor(count, context, _begin, (context.Value("i", 0),))
    try:
        yield lambda work, progress: _here(pool, work, progress)
    except BaseException:
        for process in list((pool._processes or {}).values()):  # drops their unfinished work
            process.kill()
        raise
    finally:
        pool.shutdown(cancel_futures=True)


def _here(pool: ProcessPoolExecutor, work: Sequence[W], progress: Progress) -> Iterator[tuple[W, Any]]:
    running = {pool.submit(piece.measure): piece for piece in work}
    try:
        for future in as_completed(running):
            piece = running[future]
            result = future.result()
            progress(piece.runs)
            yield piece, result
    except BrokenProcessPool:
        raise ValueError("a worker process died: run again with --resume") from None


def _begin(begun: Any) -> None:
    """Initializes a worker process: one thread, no Ctrl-C, and it ends with its parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with begun.get_lock():
        number = begun.value
        begun.value += 1
    if hasattr(os, "sched_setaffinity"):
        mine = sorted(os.sched_getaffinity(0))
        os.sched_setaffinity(0, {mine[number % len(mine)]})
    parent = multiprocessing.parent_process()
    if parent is not None:
        Thread(target=_end_with, args=(parent.sentinel,), daemon=True).start()


def _end_with(sentinel: int) -> None:
    wait([sentinel])
    os._exit(1)
