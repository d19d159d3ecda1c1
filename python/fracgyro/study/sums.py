"""Hashes of a study's finished files, in the format of `sha256sum --check`."""

from __future__ import annotations

import hashlib
import re
from pathlib import Path

from ..files import whole_file


class Sums:
    """The hashes in the file `path`, by file names relative to its folder."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._found = {name: found for name, found in self._recorded().items() if (path.parent / name).is_file()}
        self.record()

    def hold(self, name: str, data: bytes) -> bool:
        """Returns True if the file was finished with these bytes."""
        return self._found.get(name) == hashlib.sha256(data).hexdigest()

    def add(self, name: str, data: bytes) -> None:
        """Adds a hash. Call it before the file is created, so that every file has its hash even after a kill."""
        self._found[name] = hashlib.sha256(data).hexdigest()
        with open(self._path, "a", encoding="utf-8", errors="surrogateescape", newline="\n") as sums:
            sums.write(_line(name, self._found[name]))

    def record(self) -> None:
        """Writes the hashes in the order of the names, one line each."""
        with whole_file(self._path) as scratch:
            text = "".join(_line(name, found) for name, found in sorted(self._found.items()))
            scratch.write_text(text, encoding="utf-8", errors="surrogateescape", newline="\n")

    def _recorded(self) -> dict[str, str]:
        """Hashes by file name; the last line of a file counts, and damaged lines are ignored."""
        try:
            text = self._path.read_text(encoding="utf-8", errors="surrogateescape")
        except OSError:
            return {}
        lines = re.findall(r"^([0-9a-f]{64})  (.+)$", text, re.MULTILINE)
        return {name: found for found, name in lines}


def _line(name: str, found: str) -> str:
    return f"{found}  {name}\n"
