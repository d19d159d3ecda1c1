"""Finished work on disk: one file for each tuning and each judging, and their hashes in finished.sha256."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from fracgyro.files import remove_scratch, whole_file, writable_folder
from fracgyro.scenario import ScenarioError
from fracgyro.study.sums import Sums

from .judging import Judging
from .tuning import Tuning

Piece = Tuning | Judging
FOLDERS: dict[type[Piece], str] = {Tuning: "tunings", Judging: "judgings"}
SUMS = "finished.sha256"


class Finished:
    """The results in a folder, by the names of the work."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        for name in FOLDERS.values():
            remove_scratch(writable_folder(folder / name))
        self._sums = Sums(folder / SUMS)

    def has(self, piece: Piece) -> bool:
        """Return whether its file is here, byte for byte as it was written."""
        try:
            return self._sums.hold(_name(piece), (self.folder / _name(piece)).read_bytes())
        except OSError:
            return False

    def write(self, piece: Piece, result: dict[str, Any]) -> None:
        data = json.dumps(result, allow_nan=False).encode()
        with whole_file(self.folder / _name(piece)) as scratch:
            scratch.write_bytes(data)
            self._sums.add(_name(piece), data)

    def read(self, piece: Piece) -> dict[str, Any]:
        """The result. Raises ScenarioError when it has changed since it was written."""
        path = self.folder / _name(piece)
        if not self.has(piece):
            raise ScenarioError(f"{path} was changed during the comparison: --resume runs it again")
        found: dict[str, Any] = json.loads(path.read_bytes())
        return found


def _name(piece: Piece) -> str:
    return f"{FOLDERS[type(piece)]}/{piece.name}.json"
