"""Blocks on a Dask cluster. The files are written only here, so the workers need no common disk."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from importlib.metadata import version
from itertools import islice
from typing import Any

import pyarrow as pa

from ...files import reason
from ...scenario.table import shown
from .blocks import Block

RETRIES = 3  # of a block that raises; one whose worker dies goes to another by itself
PER_THREAD = 2  # blocks under way for each thread of the cluster: one runs, one waits
PATIENCE = 6  # s, for an answer, for the scheduler and for a first worker


@contextmanager
def connected(address: str) -> Iterator[Any]:
    """A Dask client. Raises ValueError in one sentence when the cluster cannot be reached or has no worker."""
    try:
        from distributed import Client
    except ImportError:
        raise ValueError("--scheduler needs Dask: install it with pip install 'fracgyro[cluster]'") from None
    place = f"scheduler is {shown(address)}"
    try:
        with ThreadPoolExecutor(1) as thread:  # where no event loop runs
            answer = thread.submit(asyncio.run, _asked(address)).result()
        if answer != "Scheduler":
            raise ValueError("no scheduler of Dask answers")
        client = Client(address, timeout=PATIENCE, set_as_default=False)
    except Exception as error:  # of any kind, from what listens at the address
        why = reason(error) if isinstance(error, OSError) else str(error)
        raise ValueError(f"{place}: it cannot be reached: {why.partition(chr(10))[0] or 'no answer'}") from None
    with client:
        try:
            client.wait_for_workers(1, timeout=PATIENCE)
        except TimeoutError:
            raise ValueError(f"{place}: it must have a worker, but has none") from None
        yield client


async def _asked(address: str) -> Any:
    """What the address says that it is. A Client would wait for minutes, in silence, for what is not a scheduler."""
    from distributed import Security
    from distributed.comm.core import connect

    async with asyncio.timeout(PATIENCE):
        comm = await connect(address, timeout=PATIENCE, **Security().get_connection_args("client"))
        try:
            await comm.write({"op": "identity", "reply": True})
            return (await comm.read()).get("type")
        finally:
            comm.abort()


def measured_there(
    client: Any, work: list[Block], progress: Callable[[int], object]
) -> Iterator[tuple[Block, pa.Table]]:
    """Each block with its table, in the order in which they are finished.

    A worker uses all processors of its machine for a block: start one per machine, with one thread.
    Raises ValueError in one sentence when a block fails time and again.
    """
    from distributed import as_completed

    waiting = iter(work)

    def submit(block: Block) -> Any:
        return client.submit(_measure, block, version("fracgyro"), retries=RETRIES, pure=False)

    running = {submit(block): block for block in islice(waiting, PER_THREAD * sum(client.nthreads().values()))}
    finished = as_completed(list(running), loop=client.loop)
    for future in finished:
        block = running.pop(future)
        try:
            table = future.result()
        except Exception as error:
            text = " ".join(str(error).split())
            raise ValueError(f"block {block.number} failed on the cluster: {text}; --resume goes on") from None
        for following in islice(waiting, 1):
            new = submit(following)
            running[new] = following
            finished.add(new)
        progress(block.runs)
        yield block, table


def _measure(block: Block, wanted: str) -> pa.Table:
    if version("fracgyro") != wanted:
        raise ValueError(f"the worker has fracgyro {version('fracgyro')}, not {wanted}")
    return block.measure()
