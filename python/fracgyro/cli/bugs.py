"""Distinction between errors for the user and bugs."""

from __future__ import annotations

import dis
import traceback
from pathlib import Path

import click

PACKAGE = Path(__file__).resolve().parents[1]
BUG = 1
REPORT = (
    "fracgyro: this is a bug. Please report it with the lines above, the command and the output of `fracgyro selfcheck`"
    " at https://github.com/fracgyro/fracgyro/issues"
)


def foreseen(error: ValueError) -> bool:
    """Returns True for an error that is meant for the user: this package defines its class or raised it.

    An error that NumPy, pandas or Python raises inside a call is a bug of the caller.
    """
    if type(error).__module__.startswith("fracgyro."):
        return True
    place = error.__traceback__
    if place is None:
        return False
    while place.tb_next is not None:
        place = place.tb_next
    code = place.tb_frame.f_code
    raised = dis.opname[code.co_code[place.tb_lasti]] == "RAISE_VARARGS"  # not a call into a C library
    return raised and Path(code.co_filename).resolve().is_relative_to(PACKAGE)


def bug(error: Exception) -> int:
    """Prints the traceback and where to report it. Returns the exit code."""
    click.echo("".join(traceback.format_exception(error)) + REPORT, err=True)
    return BUG
