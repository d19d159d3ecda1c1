"""The command `fracgyro` and its entry point. Expected errors are one sentence, others are bugs to report."""

from __future__ import annotations

import codecs
import io
import logging
import os
import sys
from typing import TextIO

import click

from ..extras import MissingExtraError
from ..files import one_line, reason
from .bugs import bug, foreseen
from .commands import Commands, help_without_command

BAD_INPUT = 2
INTERRUPTED = 130


# By name: where the command is, and its line in the list of commands.
COMMANDS = {
    "allan": ("rate:allan_command", "Find the noise terms in a record of a gyroscope at rest."),
    "check": ("inspect:check", "Check a scenario without running it."),
    "datasheet": ("rate:datasheet_command", "Measure a scenario by the clauses of IEEE Std 1431."),
    "device": ("sheet:device_command", "Make a scenario from a data sheet."),
    "diff": ("inspect:diff", "Print the fields in which two scenarios differ."),
    "explain": ("inspect:explain", "Explain a field, a metric or a channel."),
    "export": ("export:export", "Export to firmware, FMU, FPGA, MATLAB or WebAssembly."),
    "identify": ("identify:identify_command", "Identify a device from records of its bench."),
    "live": ("live:live_command", "Simulate in the browser, with controls that act at once."),
    "rate": ("rate:rate", "Measure a scenario as a rate sensor."),
    "replay": ("export:replay", "Run a recorded motion on a target and compare bits."),
    "scenario": ("simulate:scenario_command", "Print a scenario, to edit and run."),
    "schema": ("editors:schema_command", "Print the JSON Schema of a file."),
    "selfcheck": ("selfcheck:selfcheck", "Recompute the published parity hashes."),
    "simulate": ("simulate:simulate_command", "Simulate a scenario and print its metrics."),
    "sweep": ("study:sweep", "Run every scenario of a study."),
    "tune": ("study:tune", "Search for the best parameters of a study."),
}


@click.group(
    cls=Commands,
    known=COMMANDS,
    registered="fracgyro.commands",
    context_settings={"help_option_names": ["-h", "--help"]},
    invoke_without_command=True,
)
@click.version_option(package_name="fracgyro")
@click.pass_context
def cli(context: click.Context) -> None:
    """Simulate, study and export a fractional sliding-mode controller for MEMS gyroscopes."""
    help_without_command(context)


def main() -> None:
    """Runs a command. Exit codes: 2 after an expected error, with one sentence; 1 after a bug, with a report."""
    _prepare()
    try:
        code = cli(standalone_mode=False)
        sys.stdout.flush()
    except click.exceptions.Exit as stop:
        code = stop.exit_code
    except click.ClickException as error:
        code = _refused(error.format_message().replace("\n\t", " "))  # a list of choices has several lines
    except (KeyboardInterrupt, click.Abort):
        _refused("interrupted; the files written so far are complete")
        code = INTERRUPTED
    except ValueError as error:
        code = _refused(str(error)) if foreseen(error) else bug(error)
    except MissingExtraError as error:
        code = _refused(str(error))
    except MemoryError:
        code = _refused("there is not enough memory: make run.record_every larger, or record fewer runs")
    except OSError as error:
        code = _refused(f"the output cannot be written: {reason(error)}")
        sys.stdout = None  # otherwise Python tries again and prints an error
    except Exception as error:
        code = bug(error)
    sys.exit(code)


def _prepare() -> None:
    """Makes commands independent of their environment: closed streams, file names, Matplotlib's settings."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:  # closed by the caller
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115
    codecs.register_error("fracgyro", _encoded)
    sys.stdout = _buffered(sys.stdout)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="fracgyro" if stream is sys.stdout else "backslashreplace")
    os.environ |= {"MPLBACKEND": "agg", "MATPLOTLIBRC": os.devnull}
    logging.getLogger("matplotlib").setLevel(logging.ERROR)


def _buffered(stream: TextIO) -> TextIO:
    """The stream with a buffer: with PYTHONUNBUFFERED Python silently drops the rest of a partial write."""
    if not (isinstance(stream, io.TextIOWrapper) and isinstance(stream.buffer, io.RawIOBase)):
        return stream
    encoding = stream.encoding
    return io.TextIOWrapper(io.BufferedWriter(stream.detach()), encoding, line_buffering=True)


def _encoded(error: UnicodeError) -> tuple[str | bytes, int]:
    """Error handler: undecodable file names as bytes, characters that the terminal lacks as escapes."""
    try:
        return codecs.lookup_error("surrogateescape")(error)
    except UnicodeError:
        return codecs.lookup_error("backslashreplace")(error)


def _refused(words: str) -> int:
    """Prints an error on one line; returns the exit code."""
    try:
        click.echo(f"fracgyro: {one_line(words)}", err=True)
        sys.stderr.flush()
    except OSError:
        sys.stderr = None  # otherwise Python tries again and changes the exit code
    return BAD_INPUT
