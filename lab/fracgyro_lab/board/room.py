"""The process of a law, from outside: an empty folder, a time limit, and one answer.

inside.py sets the other limits. A law is Python code in the process that simulates it, so this stops mistakes and
plain cheating; only the person who reads the file can stop a law that forges the answer of its process.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from fracgyro.scenario import ScenarioError

MIB = 2**20
Progress = Callable[[float, float, str], object]


@dataclass(frozen=True)
class Limits:
    """Limits of the process."""

    seconds: float = 120.0  # on the clock
    memory: int = 4096 * MIB  # bytes of address space; not enforced by macOS


LIMITS = Limits()


def run(
    job: dict[str, Any], law: str, text: str | None, limits: Limits = LIMITS, progress: Progress | None = None
) -> dict[str, Any]:
    """The result of a job, a dict that JSON has, in a process of its own.

    `law`: its name in messages; `text`: the contents of its file. Raises ScenarioError, in one sentence, if the law
    raises an exception, exceeds a limit, does something that is not allowed or leaves a file.
    """
    with tempfile.TemporaryDirectory(prefix="fracgyro-", ignore_cleanup_errors=True) as folder:
        held, empty = Path(folder) / "law", Path(folder) / "empty"
        held.mkdir()
        empty.mkdir()
        place = ""
        if text is not None:
            file, _, name = law.partition(":")
            (held / file).write_text(text, encoding="utf-8")
            place = f"{held / file}:{name}"
        answer = _answer({**job, "law": place or law, "limits": asdict(limits)}, empty, limits, progress)
        left = sorted(path.name for path in empty.iterdir())
        if left and "result" in answer:
            answer = {"refused": f"it left {left[0]} in its folder; a law must not write files"}
    if "result" not in answer:
        words = str(answer["refused"]).replace(f"{held}{os.sep}", "").replace(f"{empty}{os.sep}", "")
        raise ScenarioError(f"{law} is refused: {words}")
    found: dict[str, Any] = answer["result"]
    return found


def _answer(job: dict[str, Any], folder: Path, limits: Limits, progress: Progress | None) -> dict[str, Any]:
    """`result` or `refused`, the last line of the process."""
    late = threading.Event()
    # -I: neither the environment nor the folder changes the imports; -B: no bytecode is written.
    command = [sys.executable, "-I", "-B", "-m", "fracgyro_lab.board.inside"]
    with subprocess.Popen(
        command,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        cwd=folder,
        env=_environment(folder),
        start_new_session=True,
        text=True,
        encoding="utf-8",
    ) as process:

        def stop() -> None:
            late.set()
            _end(process)

        timer = threading.Timer(limits.seconds, stop)
        timer.start()
        try:
            answer = _last(process, job, progress)
        finally:
            timer.cancel()
            _end(process)
    if "result" in answer or "refused" in answer:
        return answer
    if late.is_set():
        return {"refused": f"it did not end within {limits.seconds:g} s"}
    code = process.returncode
    if code == -signal.SIGXCPU:
        return {"refused": f"it took more than {limits.seconds:g} s of two processors"}
    return {"refused": f"it ended its process, with {signal.Signals(-code).name if code < 0 else f'code {code}'}"}


def _last(process: subprocess.Popen[str], job: dict[str, Any], progress: Progress | None) -> dict[str, Any]:
    """The last line that the process prints for this job; empty if it prints no line."""
    assert process.stdin is not None
    assert process.stdout is not None
    with suppress(BrokenPipeError):
        json.dump(job, process.stdin)
        process.stdin.close()
    answer: dict[str, Any] = {}
    try:
        for line in process.stdout:
            answer = json.loads(line)
            if progress and "done" in answer:
                progress(answer["done"], answer["total"], answer["doing"])
    except ValueError:
        return {"refused": "it wrote into the answer of its process; a law must not write files"}
    process.wait()
    return answer


def _end(process: subprocess.Popen[str]) -> None:
    """Kills the process and all that it started."""
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)


def _environment(folder: Path) -> dict[str, str]:
    """Nothing of the user's environment, which may hold passwords; one thread for each library."""
    threads = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
    return {"PATH": os.environ.get("PATH", os.defpath), "HOME": str(folder), "LC_ALL": "C.UTF-8"} | dict.fromkeys(
        threads, "1"
    )
