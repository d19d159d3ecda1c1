"""What is finished, on disk: one file for each tuning and each judging."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from ..files import whole_file, writable_folder
from ..scenario import ScenarioError
from .judging import Judging
from .tuning import Tuning

Piece = Tuning | Judging


class Finished:
    """The results in a folder, by the names of the work. Raises ScenarioError for one that is damaged."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._folders = {Tuning: writable_folder(folder / "tunings"), Judging: writable_folder(folder / "judgings")}

    def has(self, piece: Piece) -> bool:
        return self._path(piece).is_file()

    def write(self, piece: Piece, result: dict[str, Any]) -> None:
        with whole_file(self._path(piece)) as scratch:
            scratch.write_text(json.dumps(result, allow_nan=False), encoding="utf-8")

    def read(self, piece: Piece) -> dict[str, Any]:
        path = self._path(piece)
        wanted = (
            {"best", "error", "trials"} if isinstance(piece, Tuning) else {"metrics", "error", "others", "diverged"}
        )
        try:
            found = json.loads(path.read_text(encoding="utf-8"))
            if isinstance(found, dict) and set(found) == wanted:
                return found
        except (OSError, ValueError, RecursionError):
            pass
        raise ScenarioError(f"{path} is damaged: remove it, and --resume makes it again")

    def _path(self, piece: Piece) -> Path:
        return self._folders[type(piece)] / f"{piece.name}.json"
