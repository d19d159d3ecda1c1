"""Commands in separate processes, stopped at a defined point of their work and not after a given time."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

PATIENCE = 900  # s, for commands that take seconds: a limit for hangs, not for a slow machine

# `fracgyro WORDS`, whose process group gets SIGNAL, as from Ctrl-C, when FUNCTION of MODULE first reports a progress
# for which PLACE, an expression in `done` and `doing`, is true.
STOPPED = """
import importlib, os, sys

module, function, place, number, *words = sys.argv[1:]
there = importlib.import_module(module)
work = getattr(there, function)

def stopped(*arguments, progress, **options):
    def show(done, total, doing=None):
        global place
        if place and eval(place):
            place = None
            os.killpg(0, int(number))
        progress(done, total, doing)

    return work(*arguments, progress=show, **options)

setattr(there, function, stopped)
sys.argv[1:] = words

from fracgyro.cli import main

main()
"""


def run_until(
    place: str, number: signal.Signals, module: str, function: str, *words: str | Path
) -> subprocess.CompletedProcess[str]:
    arguments = [module, function, place, str(int(number)), *map(str, words)]
    # Runs in a separate session, or the signal would also reach the tests.
    return subprocess.run(
        [sys.executable, "-c", STOPPED, *arguments],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        start_new_session=True,
    )
