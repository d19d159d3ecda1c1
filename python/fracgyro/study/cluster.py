"""Work on a Dask cluster. Only this process writes files, so the workers need no shared disk."""

from __future__ import annotations

import asyncio
import time
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from importlib.metadata import version
from typing import Any, Generic, Protocol, TypeVar

from ..extras import needs
from ..files import reason
from ..scenario.table import format_value

Result = TypeVar("Result", covariant=True)


class Work(Protocol, Generic[Result]):
    """A unit of work that can be sent to another machine: a block of runs, a tuning."""

    @property
    def name(self) -> str: ...
    @property
    def runs(self) -> int: ...
    def measure(self) -> Result: ...


W = TypeVar("W", bound=Work[Any])

RETRIES = 3  # after an exception; Dask itself reassigns the work of a worker that dies
PER_THREAD = 2  # submitted tasks per thread of the cluster: one runs, one waits
TASK = 2.0  # s that a task lasts at least, if there is work for it: the scheduler starts some 500 a second
PATIENCE = 6  # timeout, s: for an answer, for the scheduler and for the first worker


@contextmanager
def connected(address: str) -> Iterator[Any]:
    """A Dask client. Raises ValueError if the cluster cannot be reached or has no worker."""
    with needs("cluster"):
        from distributed import Client
    place = f"scheduler is {format_value(address)}"
    try:
        with ThreadPoolExecutor(1) as thread:  # a thread without an event loop
            answer = thread.submit(asyncio.run, _asked(address)).result()
        if answer != "Scheduler":
            raise ValueError("no scheduler of Dask answers")
        client = Client(address, timeout=PATIENCE, set_as_default=False)
    except Exception as error:  # anything may listen at the address
        why = reason(error) if isinstance(error, OSError) else str(error)
        raise ValueError(f"{place}: it cannot be reached: {why.partition(chr(10))[0] or 'no answer'}") from None
    with client:
        try:
            client.wait_for_workers(1, timeout=PATIENCE)
        except TimeoutError:
            raise ValueError(f"{place}: it must have a worker, but has none") from None
        yield client


async def _asked(address: str) -> Any:
    """Identity of the server at the address. A Client would wait silently for minutes if it is not a scheduler."""
    from distributed import Security
    from distributed.comm.core import connect

    async with asyncio.timeout(PATIENCE):
        comm = await connect(address, timeout=PATIENCE, **Security().get_connection_args("client"))
        try:
            await comm.write({"op": "identity", "reply": True})
            return (await comm.read()).get("type")
        finally:
            comm.abort()


def measured_there(client: Any, work: list[W], progress: Callable[[int], object]) -> Iterator[tuple[W, Any]]:
    """Each unit of work with its result, in order of completion.

    A worker uses all processors of its machine for a block: start one per machine, with one thread. Short units share a
    task, so that the scheduler keeps up with many machines.
    Raises ValueError if a unit of work fails repeatedly.
    """
    from distributed import as_completed

    waiting = deque(work)
    threads = sum(client.nthreads().values())
    running: dict[Any, list[W]] = {}

    def submit(count: int) -> Any:
        pieces = [waiting.popleft() for _ in range(count)]
        future = client.submit(_measure, pieces, version("fracgyro"), retries=RETRIES, pure=False)
        running[future] = pieces
        return future

    finished = as_completed([submit(1) for _ in range(min(PER_THREAD * threads, len(waiting)))], loop=client.loop)
    for future in finished:
        pieces = running.pop(future)
        try:
            results, seconds = future.result()
        except Exception as error:
            name, text = error.args if isinstance(error, UnitFailed) else (pieces[0].name, str(error))
            text = " ".join(text.split())
            raise ValueError(f"{name} failed on the cluster: {text}; run again with --resume") from None
        if waiting:
            finished.add(submit(together(len(waiting), threads, seconds / len(pieces))))
        for piece, result in zip(pieces, results, strict=True):
            progress(piece.runs)
            yield piece, result


def together(left: int, threads: int, seconds: float) -> int:
    """Number of units of work in the next task, of `left` that take `seconds` each."""
    return max(1, min(int(TASK / max(seconds, 1e-9)), left // (PER_THREAD * threads)))


class UnitFailed(Exception):
    """Name of a unit of work, and why it failed."""


def _measure(pieces: list[Work[Result]], wanted: str) -> tuple[list[Result], float]:
    """The results, and the seconds that they took."""
    begin, results = time.perf_counter(), []
    for piece in pieces:
        try:
            if version("fracgyro") != wanted:
                raise ValueError(f"the worker has fracgyro {version('fracgyro')}, not {wanted}")
            results.append(piece.measure())
        except Exception as error:
            raise UnitFailed(piece.name, str(error)) from error
    return results, time.perf_counter() - begin
