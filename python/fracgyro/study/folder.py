"""A study's folder: study.json says what it is, runs/block-*.parquet hold the rows. Files are complete or absent."""

from __future__ import annotations

import hashlib
import json
import os
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from ..files import reason, remove_scratch, whole_file, writable_folder
from ..scenario import ScenarioError
from .blocks import Block
from .design import Plan

MANIFEST, RUNS = "study.json", "runs"
LABEL = b"fracgyro.study"  # in the metadata of every block: the hash of its study


class Folder:
    """Opened for one study, the blocks of which it takes and gives back."""

    def __init__(self, path: str | os.PathLike[str], plan: Plan, work: list[Block], *, resume: bool) -> None:
        """Raises ScenarioError in one sentence when the folder is not free, or holds another study."""
        self.path, parts = Path(path), _parts(plan, work)
        self.hash = hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()
        if self._in_use():
            self._check(parts, resume)
        self.runs = writable_folder(writable_folder(path) / RUNS)
        remove_scratch(self.path)
        remove_scratch(self.runs)
        manifest = {"hash": self.hash, "runs": plan.runs, "blocks": len(work), "parts": parts, "study": plan.text}
        with whole_file(self.path / MANIFEST) as scratch:
            scratch.write_text(json.dumps(manifest, indent=1), encoding="utf-8")

    def finished(self, block: Block) -> bool:
        """Whether the block lies here, whole and of this study."""
        try:
            table = pq.read_table(self._file(block), page_checksum_verification=True, partitioning=None)
        except (OSError, pa.ArrowException):
            return False
        keys = block.keys()
        mine = (table.schema.metadata or {}).get(LABEL) == self.hash.encode()
        return mine and table.num_rows == block.runs and table.select(keys.column_names).equals(keys)

    def write(self, block: Block, table: pa.Table) -> None:
        with whole_file(self._file(block)) as scratch:
            labelled = table.replace_schema_metadata({LABEL: self.hash.encode()})
            pq.write_table(labelled, scratch, compression="zstd", write_page_checksum=True)

    def read(self, work: list[Block]) -> pa.Table:
        """The rows of these blocks, in order."""
        return pa.concat_tables([pq.read_table(self._file(block), partitioning=None) for block in work])

    def _file(self, block: Block) -> Path:
        return self.runs / f"block-{block.number:06d}.parquet"

    def _in_use(self) -> bool:
        try:
            return any(not entry.name.startswith(".") for entry in self.path.iterdir())
        except FileNotFoundError:
            return False
        except OSError as error:
            raise ScenarioError(f"{self.path} cannot be read: {reason(error)}") from None

    def _check(self, parts: dict[str, Any], resume: bool) -> None:
        manifest = self.path / MANIFEST
        if not manifest.is_file():
            raise ScenarioError(f"{self.path} is not empty and holds no study: --out must name an empty or new folder")
        if not resume:
            raise ScenarioError(
                f"{self.path} holds a study already: --out must name another folder, or --resume be given to finish it"
            )
        try:
            there = json.loads(manifest.read_text(encoding="utf-8"))["parts"]
        except (OSError, ValueError, KeyError, TypeError):
            raise ScenarioError(f"{manifest} is damaged: the study must start anew in another folder") from None
        changed = [name for name, part in parts.items() if there.get(name) != part]
        if changed:
            raise ScenarioError(
                f"{self.path} holds another study, which differs in {' and '.join(changed)}: "
                "a changed study must have a folder of its own"
            )


def _parts(plan: Plan, work: list[Block]) -> dict[str, Any]:
    """Everything that the rows depend on, under the words that the study file has for it."""
    points = json.dumps(plan.points).encode()
    return {
        "the version of fracgyro": version("fracgyro"),
        "scenario or fixed": plan.base.to_toml(),
        "seeds": plan.seeds,
        "vary or design": [plan.fields, len(plan.points), hashlib.sha256(points).hexdigest()],
        "metrics": plan.study.metrics.model_dump(),
        "the size of blocks": [work[0].runs, len(work)],
    }
