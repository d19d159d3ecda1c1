"""Many inputs through one property, each in a process that may crash or hang without ending the run.

    python tests/fuzz/fuzz_x.py --seconds 60 --seed 1      as often as time allows
    python tests/fuzz/fuzz_x.py --known                    past failures, in this process
    python tests/fuzz/fuzz_x.py --known NAME ...           some of it

A fuzzer is a script with one or more targets. Each has `make`, which makes the bytes of an input from a random
generator, and `check`, which tries them in an empty folder and returns "worked" or "refused", or raises. Input n
depends only on the seed and n. Failed inputs are added to tests/fuzz/corpus/<x>.jsonl, one per line, with which every
run begins.
"""

from __future__ import annotations

import argparse
import base64
import contextlib
import io
import itertools
import json
import math
import multiprocessing
import os
import random
import resource
import shutil
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from multiprocessing.connection import Connection
from pathlib import Path

import fracgyro

Make = Callable[[random.Random], bytes]
Check = Callable[[bytes, Path], str]

HANG = 20.0  # s for one input, of CPU or waiting time, so that a busy machine does not cause a hang
MEMORY = 6 * 2**30  # bytes of address space
MAX_SENTENCE = 1000
PACKAGE = str(Path(fracgyro.__file__).parent)
CORPUS = Path(__file__).resolve().parent / "corpus"


@dataclass(frozen=True)
class Face:
    make: Make
    check: Check
    prepare: Callable[[], object] | None = None  # before the first input, however long it takes
    memory: int = MEMORY  # sanitizers and virtual machines want resource.RLIM_INFINITY


def refused(error: Exception) -> str:
    """ "refused", when the error is one sentence of the package's own; otherwise raises it."""
    frames = traceback.extract_tb(error.__traceback__)
    own = isinstance(error, ValueError) and frames[-1].filename.startswith(PACKAGE) and raised(frames[-1])
    if not own or not is_sentence(str(error)):
        raise error
    return "refused"


def raised(frame: traceback.FrameSummary) -> bool:
    """True if raised by a statement there, not by a function of the standard library."""
    return (frame.line or "").startswith("raise ")


def is_sentence(text: str) -> bool:
    return len(text.splitlines()) == 1 and text.isprintable() and len(text) <= MAX_SENTENCE


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """Treat warnings and any output as errors."""
    said = io.StringIO()
    with warnings.catch_warnings(), contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        warnings.simplefilter("error")
        yield
    assert not said.getvalue(), said.getvalue()


def attempt(check: Check, case: bytes) -> str:
    """One input in a folder of its own, which is also the current one."""
    here = os.getcwd()
    folder = Path(tempfile.mkdtemp(prefix="fuzz-", dir="/dev/shm" if os.access("/dev/shm", os.W_OK) else None))
    try:
        os.chdir(folder)
        return check(case, folder)
    finally:
        os.chdir(here)
        shutil.rmtree(folder)


def _outcome(check: Check, case: bytes) -> str:
    try:
        return attempt(check, case)
    except BaseException:
        return traceback.format_exc()


def _work(pipe: Connection, face: Face, known: Sequence[bytes], seed: int, first: int, folder: str) -> None:
    """Send every input before it is tried, and then its outcome."""
    tempfile.tempdir = folder
    resource.setrlimit(resource.RLIMIT_AS, (face.memory, face.memory))
    if face.prepare:
        face.prepare()
    for number in itertools.count(first):
        made = number - len(known)
        case = known[number] if made < 0 else face.make(random.Random(f"{seed}/{made}"))
        pipe.send(case)
        pipe.send(_outcome(face.check, case))


def run(face: Face, corpus: Path, prefix: str, seconds: float, attempts: int, seed: int) -> tuple[Counter[str], float]:
    """Counts of worked, refused, tracebacks, crashes and hangs. Failed inputs are kept in `corpus`."""
    context = multiprocessing.get_context("spawn")
    known = [case for name, case in known_inputs(corpus).items() if name.startswith(prefix)]
    counts: Counter[str] = Counter()
    number, begin = 0, math.inf  # from the first input on: its preparation does not count

    def going() -> bool:
        return number < attempts and time.monotonic() - begin < seconds

    with tempfile.TemporaryDirectory() as folder:
        while going():
            ours, theirs = context.Pipe(duplex=False)
            worker = context.Process(target=_work, args=(theirs, face, known, seed, number, folder), daemon=True)
            worker.start()
            theirs.close()
            failure = ""
            while not failure and going():
                case = ours.recv()
                begin = min(begin, time.monotonic())
                try:
                    outcome = ours.recv() if _answers(ours, worker.pid) else "hang"
                except EOFError:
                    worker.join()
                    outcome = f"crash: exit code {worker.exitcode}"
                kind = outcome.partition(":")[0]
                kind = kind if kind in ("worked", "refused", "hang", "crash") else "traceback"
                counts[kind] += 1
                if kind not in ("worked", "refused"):
                    _keep(corpus, prefix + sha256(case).hexdigest()[:16], case, f"seed {seed}: {outcome}")
                    failure = kind if kind != "traceback" else ""
                number += 1
            worker.kill()
            worker.join()
    return counts, time.monotonic() - begin


def _answers(pipe: Connection, process: int | None) -> bool:
    """True if an answer or the end of the process comes before it has used, or been idle for, HANG s."""
    begin = before = _used(process)
    while not pipe.poll(HANG):
        now = _used(process)
        if now - begin > HANG or now - before < 0.01 * HANG:
            return False
        before = now
    return True


def _used(process: int | None) -> float:
    """CPU time in seconds."""
    user, system = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[11:13]
    return (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")


def known_inputs(corpus: Path) -> dict[str, bytes]:
    """Inputs that failed once, by name."""
    if not corpus.exists():
        return {}
    lines = map(json.loads, corpus.read_text(encoding="utf-8").splitlines())
    return {
        line["name"]: line["text"].encode() if "text" in line else base64.b64decode(line["base64"]) for line in lines
    }


def _keep(corpus: Path, name: str, case: bytes, outcome: str) -> None:
    try:
        content = {"text": case.decode()}
    except UnicodeDecodeError:
        content = {"base64": base64.b64encode(case).decode()}
    if name not in known_inputs(corpus):
        with corpus.open("a", encoding="utf-8") as file:
            file.write(json.dumps({"name": name, **content}) + "\n")
    print(f"{outcome.rstrip()}\nThe input is {name} in {corpus}", file=sys.stderr)


def main(faces: Mapping[str, Face] | Face) -> None:
    """Exit with 1 if an input failed. The names of a named target's inputs begin with its name."""
    script = Path(sys.argv[0]).stem
    named = {"": faces} if isinstance(faces, Face) else faces
    options = argparse.ArgumentParser()
    options.add_argument("--seconds", type=float, default=60.0, help="for each face")
    options.add_argument("--attempts", type=int, default=sys.maxsize, help="for each face, at most")
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--face", choices=named, action="append", help="repeatable; all if left out")
    options.add_argument("--known", nargs="*", metavar="NAME", help="inputs that failed once; all if none is named")
    given = options.parse_args()
    corpus = CORPUS / f"{script.removeprefix('fuzz_')}.jsonl"
    if given.known is not None:
        cases = known_inputs(corpus)
        names = given.known or list(cases)
        faces_of = {each: next(f for name, f in named.items() if each.startswith(name)) for each in names}
        for face in dict.fromkeys(faces_of.values()):
            if face.prepare:
                face.prepare()
        outcomes = {each: _outcome(face.check, cases[each]) for each, face in faces_of.items()}
        for each, outcome in outcomes.items():
            print(f"{each}: {outcome}")
        sys.exit(0 if {*outcomes.values()} <= {"worked", "refused"} else 1)
    failures = 0
    for name in given.face or named:
        prefix = f"{name}-" if name else ""
        counts, took = run(named[name], corpus, prefix, given.seconds, given.attempts, given.seed)
        bad = {kind: counts[kind] for kind in ("traceback", "crash", "hang")}
        failed = ", ".join(f"{count} {kind}{'es' if kind == 'crash' else 's'}" for kind, count in bad.items())
        print(
            f"{name or script}: {counts.total()} inputs in {took:.0f} s, seed {given.seed}: "
            f"{counts['worked']} worked, {counts['refused']} refused; {failed}"
        )
        failures += sum(bad.values())
    sys.exit(1 if failures else 0)
