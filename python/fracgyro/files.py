"""Writing files whole: a reader, a crash or an interrupt never meets half a file."""

from __future__ import annotations

import os
import re
import shutil
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


def reason(error: OSError) -> str:
    """In the system's few words; libraries put whole paragraphs into strerror."""
    return os.strerror(error.errno) if error.errno else str(error)


@contextmanager
def whole_file(path: str | os.PathLike[str]) -> Iterator[Path]:
    """A scratch path beside `path`, moved there when the block ends without an error and removed otherwise.

    Raises ValueError in one sentence when it cannot be written.
    """
    target = Path(os.path.realpath(path))
    if target.exists() and not target.is_file():
        raise ValueError(f"{path} cannot be written: it is not a regular file")
    scratch = target.with_name(f".{uuid.uuid4().hex}{target.suffix}")
    try:
        yield scratch
        os.replace(scratch, target)
    except OSError as error:
        raise ValueError(f"{path} cannot be written: {reason(error)}") from None
    finally:
        scratch.unlink(missing_ok=True)


def remove_scratch(folder: Path) -> None:
    """Removes what `whole_file` left behind where it was killed."""
    for path in folder.glob(".*"):
        if re.fullmatch(r"\.[0-9a-f]{32}(\.\w+)?", path.name):
            path.unlink(missing_ok=True)


def writable_folder(path: str | os.PathLike[str]) -> Path:
    """The folder, made if need be. Raises ValueError in one sentence when it cannot be written to."""
    folder = Path(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / f".{uuid.uuid4().hex}"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise ValueError(f"{path} cannot be made: {reason(error)}") from None
    return folder


@contextmanager
def whole_folder(path: str | os.PathLike[str]) -> Iterator[Path]:
    """A scratch folder beside `path`, moved there when the block ends without an error and removed otherwise.

    Raises ValueError in one sentence when it cannot be written, or when `path` is there already and not empty.
    """
    target = Path(os.path.realpath(path))
    scratch = target.with_name(f".{uuid.uuid4().hex}")
    try:
        if target.exists() and (not target.is_dir() or any(target.iterdir())):
            raise ValueError(f"{path} cannot be written: it is there already; name an empty or a new folder")
        target.parent.mkdir(parents=True, exist_ok=True)
        scratch.mkdir()
        yield scratch
        os.replace(scratch, target)
    except OSError as error:
        raise ValueError(f"{path} cannot be written: {reason(error)}") from None
    finally:
        shutil.rmtree(scratch, ignore_errors=True)
