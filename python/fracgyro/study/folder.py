"""The folder of a study, identified by study.json; a folder with anything else is refused."""

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
    """The hash of everything that the results of a study depend on."""
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Locks the folder of a study, which is created if needed, for the duration of the block.

    Raises ScenarioError if another process has locked it.
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
            with suppress(OSError):  # not empty
                path.rmdir()


def _opened(path: Path) -> int | None:
    """File descriptor of the folder; None if it cannot be opened, for which `claim` reports the reason."""
    try:
        path.mkdir(parents=True, exist_ok=True)
        return os.open(path, os.O_RDONLY)
    except OSError:
        return None


def _lock(path: Path, folder: int) -> None:
    try:
        fcntl.flock(folder, fcntl.LOCK_EX | fcntl.LOCK_NB)  # released when the process ends
    except BlockingIOError:
        raise ScenarioError(
            f"{path} is in use by a study in another process: wait until it ends, or name another folder with --out"
        ) from None
    except OSError:
        pass  # a file system without locks, as some network drives are


def claim(path: Path, parts: dict[str, Any], about: dict[str, Any], *, resume: bool) -> Path:
    """The folder: new, empty or, with `resume`, that of the study with the same `parts`; `about`: more of study.json.

    Raises ValueError if it has other contents or cannot be written to.
    """
    manifest = path / MANIFEST
    parts = json.loads(json.dumps(parts))
    if resume and parts.get("controller", {"code": ""})["code"] is None:
        raise ScenarioError(
            f"controller is {parts['controller']['name']}, whose code cannot be read and compared: it must start in a "
            "new folder, without resume"
        )
    if _in_use(path):
        if not manifest.is_file():
            raise ScenarioError(f"{path} is not empty and has no study: --out must be an empty or new folder")
        if not resume:
            raise ScenarioError(
                f"{path} already has a study: finish it with --resume, or name another folder with --out"
            )
        there = _parts(manifest)
        changed = [name for name in (parts | there) if name not in parts or there.get(name) != parts[name]]
        if changed:
            raise ScenarioError(
                f"{path} has another study, which differs in {' and '.join(changed)}: "
                "a changed study must have its own folder"
            )
    folder = writable_folder(path)
    remove_scratch(folder)
    with whole_file(manifest) as scratch:
        text = json.dumps({"hash": digest(parts), **about, "parts": parts}, indent=1)
        scratch.write_text(text, encoding="utf-8")
    return folder


@contextmanager
def free_if_nothing_came(folder: Path, *, resume: bool) -> Iterator[None]:
    """Empties the folder if a new study fails before its first result, for example in its controller."""
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
    raise ScenarioError(f"{manifest} is damaged: start the study again in another folder")
