"""Blocks on a Dask cluster. The files are written here alone, so the workers need no common disk."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.metadata import version
from itertools import islice
from typing import Any

import pyarrow as pa

from .blocks import Block

RETRIES = 3  # of a block that raises; one whose worker dies goes to another by itself
PER_THREAD = 2  # blocks under way for each thread of the cluster: one runs, one waits
PATIENCE = 10  # s, for the scheduler and for a first worker


@contextmanager
def connected(address: str) -> Iterator[Any]:
    """A Dask client. Raises ValueError in one sentence when the cluster cannot be reached or has no worker."""
    try:
        from distributed import Client
        from distributed.comm.addressing import parse_address
        from distributed.comm.registry import get_backend
    except ImportError:
        raise ValueError("--scheduler needs Dask: install it with pip install 'fracgyro[cluster]'") from None
    try:
        get_backend(parse_address(address)[0])  # asked at once: a client with such an address takes a minute to give up
        client = Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        raise ValueError(f"scheduler is {address}: it cannot be reached: {error}") from None
    with client:
        try:
            client.wait_for_workers(1, timeout=PATIENCE)
        except TimeoutError:
            raise ValueError(f"scheduler is {address}: it must have a worker, but has none") from None
        yield client


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
