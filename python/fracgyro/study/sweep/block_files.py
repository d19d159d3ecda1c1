"""The rows of a sweep in its folder, in runs/block-*.parquet, with hashes in runs.sha256.

Files are complete or absent. Other files in runs/ are refused, as a reader of runs/*.parquet would include them.
"""

from __future__ import annotations

import hashlib
import json
import os
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from ...analysis.metric_names import ALL_METRICS, METRICS
from ...files import remove_scratch, whole_file, writable_folder
from ...scenario import ScenarioError
from ..controller import recorded
from ..folder import claim, digest
from ..sums import Sums
from .blocks import Block
from .design import Plan
from .point_columns import AT_ONCE, Points
from .totals import Totals, kept

RUNS = "runs"
SUMS = "runs.sha256"
LABEL = b"fracgyro.study"  # key of the study's hash in the metadata of every block
AGGREGATES = b"fracgyro.aggregates"  # key of the block's aggregates there


class BlockFiles:
    """Reads and writes the blocks of one study."""

    def __init__(self, path: str | os.PathLike[str], plan: Plan, work: list[Block], *, resume: bool) -> None:
        """Raises ValueError if the folder is not free, or has another study."""
        self.plan, parts = plan, _parts(plan, work)
        self.hash = digest(parts)
        about = {"runs": plan.runs, "blocks": len(work), "study": plan.text}
        self.path = claim(Path(path), parts, about, resume=resume)
        self.runs = writable_folder(self.path / RUNS)
        remove_scratch(self.runs)
        names = {_name(block) for block in work}
        if foreign := {path.name for path in self.runs.iterdir() if not path.name.startswith(".")} - names:
            raise ScenarioError(f"{self.runs} has {min(foreign)}, which is not part of the study: it must be removed")
        self._sums = Sums(self.path / SUMS)

    def finished(self, block: Block) -> bool:
        """True if the block is complete, unchanged and of this study."""
        try:
            data = (self.runs / _name(block)).read_bytes()
            if not self._sums.hold(f"{RUNS}/{_name(block)}", data):
                return False
            table = pq.read_table(pa.BufferReader(data))
        except (OSError, pa.ArrowException):
            return False
        mine = (table.schema.metadata or {}).get(LABEL) == self.hash.encode()
        return mine and block.complete(table)

    def write(self, block: Block, table: pa.Table) -> None:
        with whole_file(self.runs / _name(block)) as scratch:
            about = {LABEL: self.hash.encode(), AGGREGATES: json.dumps(self._aggregates(block, table)).encode()}
            labelled = table.replace_schema_metadata(about)
            with open(scratch, "wb") as file:  # pyarrow accepts only names in UTF-8
                pq.write_table(labelled, file, compression="zstd", write_page_checksum=True)
            self._sums.add(f"{RUNS}/{_name(block)}", scratch.read_bytes())

    def read(self, work: list[Block], columns: list[str]) -> pa.Table:
        """These columns of all blocks, which must be finished, in order; also sorts the hashes."""
        self._sums.record()
        files = ((self.runs / _name(block)).read_bytes() for block in work)
        return pa.concat_tables([pq.read_table(pa.BufferReader(data), columns=columns) for data in files])

    def totals(self, work: list[Block]) -> Totals:
        """Sums over all blocks, which must be finished, from their metadata; also sorts the hashes."""
        self._sums.record()
        return Totals.over(self.plan, ((block, self._kept(block)) for block in work))

    def _kept(self, block: Block) -> dict[str, Any]:
        """The aggregates of a block, from its rows if it was written for another summary."""
        path = self.runs / _name(block)
        with path.open("rb") as file:
            found: dict[str, Any] = json.loads(pq.read_schema(file).metadata[AGGREGATES])
        if found.get("summary", {}).get("show") == list(dict.fromkeys(self.plan.study.show)):
            return found
        return self._aggregates(block, pq.read_table(pa.BufferReader(path.read_bytes())))

    def _aggregates(self, block: Block, table: pa.Table) -> dict[str, Any]:
        summary = {} if self.plan.study.quantiles else {"summary": kept(self.plan, block, table)}
        return aggregates(table) | summary


def aggregates(table: pa.Table) -> dict[str, Any]:
    """Number of rows, of those that diverged, and for each metric of the others [count, mean, M2, least, greatest].

    M2 is the sum of squared deviations from the mean. A metric that never occurred has only its count, 0.
    """
    gone = table["diverged_at"].is_valid().to_numpy()
    found: dict[str, list[float]] = {}
    known = {*METRICS, *ALL_METRICS}
    for name in (field.name for field in table.schema if field.name in known and field.type == pa.float64()):
        values = table[name].to_numpy()[~gone]
        values = values[~np.isnan(values)]
        count, mean = len(values), float(values.mean()) if len(values) else 0.0
        spread = [mean, float(((values - mean) ** 2).sum()), float(values.min()), float(values.max())] if count else []
        found[name] = [count, *spread]
    return {"rows": table.num_rows, "diverged": int(gone.sum()), "metrics": found}


def _name(block: Block) -> str:
    return f"block-{block.number:06d}.parquet"


def _parts(plan: Plan, work: list[Block]) -> dict[str, Any]:
    """Everything that the rows depend on, by the names of the study file."""
    return {
        "the version of fracgyro": version("fracgyro"),
        "scenario or fixed": plan.base.to_toml(),
        "seeds": plan.seeds,
        "vary or design": [plan.fields, len(plan.points), _hash(plan.points)],
        "metrics": plan.study.metrics.model_dump(),
        "the size of blocks": [work[0].runs, len(work)],
        **({"the tasks of show": plan.tasks} if plan.tasks else {}),
        **recorded(plan.controller, plan.base),
    }


def _hash(points: Points) -> str:
    """SHA-256 of the JSON of all points, of which a part exists at a time."""
    found = hashlib.sha256(b"[")
    for begin in range(0, len(points), AT_ONCE):
        text = json.dumps(list(points[begin : begin + AT_ONCE]))[1:-1]
        found.update((", " * (begin > 0) + text).encode())
    found.update(b"]")
    return found.hexdigest()
