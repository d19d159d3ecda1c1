"""Safe reading of arbitrary files, and atomic writing: a file is complete or absent, even after a kill.

A power failure may leave an incomplete file: files are not flushed to disk, which would be too slow.
"""

from __future__ import annotations

import errno
import os
import re
import shutil
import stat
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Literal

Replaced = Literal["any", "its kind", "nothing"]  # existing files that may be replaced

MAX_SENTENCE = 900  # characters of a message; file names may be longer
MAX_INPUT = 16 * 2**20  # bytes; a scenario with two tables of 100,000 points has about 10 million


def cut(text: str, most: int = 80) -> str:
    """The text, shortened to `most` characters with three dots."""
    return text if len(text) <= most else text[: most - 3] + "..."


def one_line(text: str) -> str:
    """A message on one line: nonprinting characters as escapes, shortened to MAX_SENTENCE."""
    text = text if text.isprintable() else "".join(map(_printable, text))
    return text if len(text) <= MAX_SENTENCE else f"{text[:400]} ... {text[-400:]}"


def _printable(character: str) -> str:
    return character if character.isprintable() else character.encode("unicode_escape").decode("ascii")


def reason(error: OSError) -> str:
    """The system's text for an error; some libraries put paragraphs into strerror, shutil a list of errors."""
    if error.errno:
        return os.strerror(error.errno)
    first = re.search(r"\[Errno (\d+)\]", str(error))
    return os.strerror(int(first[1])) if first else str(error)


def check_regular(path: str | os.PathLike[str]) -> None:
    """Raises OSError unless `path` is a regular file; a device or a pipe may never end."""
    mode = os.stat(path).st_mode
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    if not stat.S_ISREG(mode):
        raise OSError("it is not a regular file")


def read_input(path: str | os.PathLike[str]) -> bytes:
    """The contents of a regular file of at most MAX_INPUT bytes. Raises OSError, or ValueError for an odd path."""
    check_regular(path)
    with open(path, "rb") as file:
        data = file.read(MAX_INPUT + 1)
    if len(data) > MAX_INPUT:
        raise OSError(f"it is larger than {MAX_INPUT // 2**20} MiB")
    return data


def check_place(path: str | os.PathLike[str], beginning: bytes) -> None:
    """Raises ValueError if `whole_file` could not create the file, or replace one of its kind.

    Call it before long work. `beginning`: first four bytes of such a file.
    """
    with suppress(_NothingWritten), whole_file(path) as scratch:
        scratch.touch()
        _check_kind(path, beginning)
        raise _NothingWritten


class _NothingWritten(Exception):
    """Ends a `whole_file` without a file."""


@contextmanager
def whole_file(path: str | os.PathLike[str], *, replaces: Replaced = "any") -> Iterator[Path]:
    """Context manager: a scratch path next to `path`, moved there at the end or removed after an error.

    `replaces`: existing files that may be replaced; a file of "its kind" starts with the same bytes.
    Raises ValueError if the file cannot be written.
    """
    target = Path(os.path.realpath(path))
    scratch = target.parent / f".{uuid.uuid4().hex}{target.suffix}"
    try:
        there = _exists(path)
        if there and not target.is_file():
            raise ValueError(f"{path} cannot be written: it is not a regular file")
        if there and replaces == "nothing" and target.stat().st_size:
            raise ValueError(f"{path} cannot be written: it already exists; name an empty or a new file")
        yield scratch
        if replaces == "its kind":
            _check_kind(path, _beginning(scratch))
        os.replace(scratch, target)
    except OSError as error:
        raise ValueError(f"{path} cannot be written: {reason(error)}") from None
    finally:
        with suppress(OSError):
            scratch.unlink()


def _exists(path: str | os.PathLike[str]) -> bool:
    """True if the path exists. Raises OSError if that is unknown, as in a loop of links."""
    try:
        os.stat(path)
    except FileNotFoundError:
        return False
    return True


def _check_kind(path: str | os.PathLike[str], beginning: bytes) -> None:
    if _exists(path) and _beginning(path) not in (b"", beginning):
        raise ValueError(f"{path} cannot be written: it is a file of another kind; choose another name")


def _beginning(path: str | os.PathLike[str]) -> bytes:
    with open(path, "rb") as file:
        return file.read(4)


def remove_scratch(folder: Path) -> None:
    """Removes scratch files of `whole_file` after a kill."""
    for path in folder.glob(".*"):
        if re.fullmatch(r"\.[0-9a-f]{32}(\.\w+)?", path.name):
            path.unlink(missing_ok=True)


def writable_folder(path: str | os.PathLike[str]) -> Path:
    """The folder, created if needed. Raises ValueError if it cannot be written to."""
    folder = Path(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / f".{uuid.uuid4().hex}"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise ValueError(f"{path} cannot be created: {reason(error)}") from None
    return folder


@contextmanager
def whole_folder(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Context manager: a scratch folder next to `path`, moved there at the end or removed after an error.

    Raises ValueError if it cannot be written, or `path` exists and is not empty.
    """
    target = Path(os.path.realpath(path))
    scratch = target.parent / f".{uuid.uuid4().hex}"
    try:
        if _exists(path) and (not target.is_dir() or any(target.iterdir())):
            raise ValueError(f"{path} cannot be written: it already exists; name an empty or a new folder")
        target.parent.mkdir(parents=True, exist_ok=True)
        scratch.mkdir()
        yield scratch
        os.replace(scratch, target)
    except OSError as error:
        raise ValueError(f"{path} cannot be written: {reason(error)}") from None
    finally:
        shutil.rmtree(scratch, ignore_errors=True)
