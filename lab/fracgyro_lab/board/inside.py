"""The process of a law, from inside: limits, refusals, and the answer on standard output."""

from __future__ import annotations

import json
import os
import resource
import sys
from typing import Any

from .guard import Guard

NEW_NETWORK, NEW_USER = 0x40000000, 0x10000000  # flags of unshare(2)


def without_network() -> bool:
    """Moves the process to a network namespace of its own, which has no device; False if the system does not let it."""
    if not sys.platform.startswith("linux"):
        return False
    import ctypes

    unshare = ctypes.CDLL(None).unshare
    return any(unshare(flags) == 0 for flags in (NEW_NETWORK, NEW_USER | NEW_NETWORK))


def on_two_processors() -> None:
    """Moves the process to two processors, where the system has a choice: more threads need more address space."""
    if hasattr(os, "sched_setaffinity"):
        mine = sorted(os.sched_getaffinity(0))
        first = os.getpid() % len(mine)  # several such processes share all processors
        os.sched_setaffinity(0, {mine[first], mine[(first + 1) % len(mine)]})


def limited(seconds: float, memory: int) -> None:
    """Sets the limits of the process: processor time of two processors, address space, and no byte in any file."""
    for which, most in (
        (resource.RLIMIT_CPU, int(2 * seconds) + 1),
        (resource.RLIMIT_AS, memory),
        (resource.RLIMIT_FSIZE, 0),
        (resource.RLIMIT_CORE, 0),
    ):
        hard = resource.getrlimit(which)[1]
        most = most if hard == resource.RLIM_INFINITY else min(most, hard)
        try:
            resource.setrlimit(which, (most, most))
        except (ValueError, OSError):  # macOS has no limit of the address space
            continue


def main() -> None:
    out = os.fdopen(os.dup(1), "w", encoding="utf-8")
    null = os.open(os.devnull, os.O_RDWR)
    for number in (1, 2):
        os.dup2(null, number)
    job = json.load(sys.stdin)
    os.dup2(null, 0)
    network = without_network()  # before another thread starts
    on_two_processors()
    limits = job["limits"]

    def send(line: dict[str, Any]) -> None:
        out.write(json.dumps(line) + "\n")
        out.flush()

    from .trial import tried  # before the limits, as libraries may write caches

    limited(limits["seconds"], limits["memory"])
    guard = Guard()
    try:
        result = tried(job, guard, lambda done, total, doing: send({"done": done, "total": total, "doing": doing}))
        answer: dict[str, Any] = {"result": {**result, "own_network": network}}
    except MemoryError:
        answer = {"refused": _too_large(limits["memory"])}
    except ValueError as error:
        full = isinstance(error.__cause__, MemoryError)
        answer = {"refused": _too_large(limits["memory"]) if full else str(error)}
    except BaseException as error:
        answer = {"refused": f"it raised {type(error).__name__}: {error}"}
    guard.disarm()
    if guard.first:
        answer = {"refused": guard.first}
    send(answer)
    os._exit(0)  # nothing that the law registered runs now


def _too_large(memory: int) -> str:
    return f"it needed more than {memory // 2**20} MiB of memory"


if __name__ == "__main__":
    main()
