"""Distinction between errors for the user and bugs."""

from __future__ import annotations

import dis
import traceback

import click

from ..extras import is_ours

BUG = 1
REPORT = (
    "fracgyro: this is a bug. Please report it with the lines above, the command and the output of `fracgyro selfcheck`"
    " at https://github.com/fracgyro/fracgyro/issues"
)


def foreseen(error: ValueError) -> bool:
    """Return whether an error is a sentence for the user: our packages have its class or the statement that raised it.

    An error that NumPy, pandas or Python raises inside a call is a bug of the caller.
    """
    if is_ours(type(error).__module__):
        return True
    place = error.__traceback__
    if place is None:
        return False
    while place.tb_next is not None:
        place = place.tb_next
    frame = place.tb_frame
    raised = dis.opname[frame.f_code.co_code[place.tb_lasti]] == "RAISE_VARARGS"  # not a call of a library in C
    return raised and is_ours(frame.f_globals["__name__"])


def bug(error: Exception) -> int:
    """Prints the traceback and where to report it. Returns the exit code."""
    click.echo("".join(traceback.format_exception(error)) + REPORT, err=True)
    return BUG
