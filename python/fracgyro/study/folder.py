"""The folder of a study: its own, by what study.json says; never one that holds anything else."""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from ..files import reason, remove_scratch, whole_file, writable_folder
from ..scenario import ScenarioError

MANIFEST = "study.json"


def digest(parts: dict[str, Any]) -> str:
    """The hash of a study, by everything that its results depend on."""
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Keeps other processes out of the folder of a study, which is made if need be, until the block ends.

    Raises ScenarioError when another process works there.
    """
    made = not path.exists()
    folder = _opened(path)
    try:
        if folder is not None:
            _lock(path, folder)
        yield
    finally:
        if folder is not None:
            os.close(folder)
        if made:
            with suppress(OSError):  # it is not empty
                path.rmdir()


def _opened(path: Path) -> int | None:
    """None for a folder that cannot be had: `claim` gives the reason."""
    try:
        path.mkdir(parents=True, exist_ok=True)
        return os.open(path, os.O_RDONLY)
    except OSError:
        return None


def _lock(path: Path, folder: int) -> None:
    try:
        fcntl.flock(folder, fcntl.LOCK_EX | fcntl.LOCK_NB)  # the system ends it with the process
    except BlockingIOError:
        raise ScenarioError(
            f"{path} is in use by another process, which works on a study there: --out must name another folder, or "
            "that process end first"
        ) from None
    except OSError:
        pass  # a file system without locks, as some network drives are


def claim(path: Path, parts: dict[str, Any], about: dict[str, Any], *, resume: bool) -> Path:
    """The folder: new, empty or, with `resume`, of the study of the same `parts`. Its study.json also says `about`.

    Raises ValueError in one sentence when it is another's or cannot be written to.
    """
    manifest = path / MANIFEST
    parts = json.loads(json.dumps(parts))
    if resume and parts.get("controller", {"code": ""})["code"] is None:
        raise ScenarioError(
            f"controller is {parts['controller']['name']}, whose code cannot be read: it must start in a new folder "
            "and without resume, as nobody can say whether it is the one that the study was begun with"
        )
    if _in_use(path):
        if not manifest.is_file():
            raise ScenarioError(f"{path} is not empty and holds no study: --out must name an empty or new folder")
        if not resume:
            raise ScenarioError(
                f"{path} holds a study already: --out must name another folder, or --resume be given to finish it"
            )
        there = _parts(manifest)
        changed = [name for name in (parts | there) if name not in parts or there.get(name) != parts[name]]
        if changed:
            raise ScenarioError(
                f"{path} holds another study, which differs in {' and '.join(changed)}: "
                "a changed study must have a folder of its own"
            )
    folder = writable_folder(path)
    remove_scratch(folder)
    with whole_file(manifest) as scratch:
        text = json.dumps({"hash": digest(parts), **about, "parts": parts}, indent=1)
        scratch.write_text(text, encoding="utf-8")
    return folder


@contextmanager
def free_if_nothing_came(folder: Path, *, resume: bool) -> Iterator[None]:
    """A new study that fails before it has any result, as by an error in its controller, leaves the folder empty."""
    try:
        yield
    except Exception:
        files = [path for path in folder.rglob("*") if path.is_file() and path != folder / MANIFEST]
        if not resume and not any(path.stat().st_size for path in files):
            for entry in folder.iterdir():
                shutil.rmtree(entry) if entry.is_dir() else entry.unlink()
        raise


def _in_use(path: Path) -> bool:
    try:
        return any(not entry.name.startswith(".") for entry in path.iterdir())
    except FileNotFoundError:
        return False
    except OSError as error:
        raise ScenarioError(f"{path} cannot be read: {reason(error)}") from None


def _parts(manifest: Path) -> dict[str, Any]:
    try:
        parts = json.loads(manifest.read_text(encoding="utf-8"))["parts"]
        if isinstance(parts, dict):
            return parts
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        pass
    raise ScenarioError(f"{manifest} is damaged: the study must start again in another folder")
