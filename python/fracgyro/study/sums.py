"""The hashes of a study's finished files, in a file that `sha256sum --check` reads."""

from __future__ import annotations

import hashlib
import re
from pathlib import Path

from ..files import whole_file


class Sums:
    """The hashes in the file `path`, by the names of files relative to its folder."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._found = {name: found for name, found in self._recorded().items() if (path.parent / name).is_file()}
        self.record()

    def hold(self, name: str, data: bytes) -> bool:
        """Return whether the file has been finished with these bytes."""
        return self._found.get(name) == hashlib.sha256(data).hexdigest()

    def add(self, name: str, data: bytes) -> None:
        """To be called before the file is there: wherever a kill strikes, a file that is there has its hash."""
        self._found[name] = hashlib.sha256(data).hexdigest()
        with open(self._path, "a", encoding="utf-8", errors="surrogateescape", newline="\n") as sums:
            sums.write(_line(name, self._found[name]))

    def record(self) -> None:
        """Writes the hashes in the order of the names, one line each."""
        with whole_file(self._path) as scratch:
            text = "".join(_line(name, found) for name, found in sorted(self._found.items()))
            scratch.write_text(text, encoding="utf-8", errors="surrogateescape", newline="\n")

    def _recorded(self) -> dict[str, str]:
        """{name: hash}; of two lines for one file the last, and no line that is damaged."""
        try:
            text = self._path.read_text(encoding="utf-8", errors="surrogateescape")
        except OSError:
            return {}
        lines = re.findall(r"^([0-9a-f]{64})  (.+)$", text, re.MULTILINE)
        return {name: found for found, name in lines}


def _line(name: str, found: str) -> str:
    return f"{found}  {name}\n"
