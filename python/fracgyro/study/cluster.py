"""Work on a Dask cluster. Only this process writes files, so the workers need no shared disk."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from importlib.metadata import version
from itertools import islice
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
PER_THREAD = 2  # submitted units of work per thread of the cluster: one runs, one waits
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

    A worker uses all processors of its machine for a block: start one per machine, with one thread.
    Raises ValueError if a unit of work fails repeatedly.
    """
    from distributed import as_completed

    waiting = iter(work)

    def submit(piece: W) -> Any:
        return client.submit(_measure, piece, version("fracgyro"), retries=RETRIES, pure=False)

    running = {submit(piece): piece for piece in islice(waiting, PER_THREAD * sum(client.nthreads().values()))}
    finished = as_completed(list(running), loop=client.loop)
    for future in finished:
        piece = running.pop(future)
        try:
            result = future.result()
        except Exception as error:
            text = " ".join(str(error).split())
            raise ValueError(f"{piece.name} failed on the cluster: {text}; run again with --resume") from None
        for following in islice(waiting, 1):
            new = submit(following)
            running[new] = following
            finished.add(new)
        progress(piece.runs)
        yield piece, result


def _measure(piece: Work[Result], wanted: str) -> Result:
    if version("fracgyro") != wanted:
        raise ValueError(f"the worker has fracgyro {version('fracgyro')}, not {wanted}")
    return piece.measure()
