"""Every key of the study files, and every metric, as a page: docs/study_files.md.

Nothing is written here that the files' models do not say. `python -m fracgyro.study.reference` prints the page again.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from typing import Any

from pydantic_core import PydanticUndefined

from ..analysis.metric_names import ALL_METRICS
from ..scenario.reference import escaped, range_of, rows_of, sentences_of, unit_of
from ..scenario.table import Table, toml_value
from .file import Thresholds
from .space import Range
from .sweep.design import Design, Study
from .tune.criteria import Constraint, Objective
from .tune.plan import Tune, TuningFile

HEAD = """# Study files

Every key of the files of sweeps and tunings, with its range and default. [Studies and tuning](studies.md) shows how to
use them; [examples](../examples) has complete ones. Fields of a scenario are in [their own reference](reference.md).
Made by `python -m fracgyro.study.reference > docs/study_files.md` from the models that read the files.
"""
KEYS = ("key", "unit", "range", "default", "meaning")


def page() -> str:
    return "\n".join(
        [
            HEAD,
            *_table("A sweep", Study),
            *_table("[design]", Design),
            *_table("A tuning", TuningFile),
            *_table("[tune]", Tune),
            *_table("[[objective]]", Objective),
            *_table("[[constraint]]", Constraint),
            *_table("Ranges in [vary]", Range),
            *_table("[metrics]", Thresholds),
            *_metrics(),
        ]
    )


def _table(title: str, model: type[Table]) -> Iterator[str]:
    yield from [f"## {title}", "", sentences_of(model), ""]
    said = model.model_json_schema()["properties"]
    described = ((name, said[name]) for name in model.model_fields if "description" in said[name])
    yield from rows_of(KEYS, (_key(name, schema, model) for name, schema in described))


def _key(name: str, said: dict[str, Any], model: type[Table]) -> Sequence[str]:
    default = model.model_fields[name].default
    nothing = default is None or default is PydanticUndefined or default in ("", {}, [])
    return (
        f"`{name}`",
        unit_of(said.get("unit", "1")),
        "name" if said.get("enum") == list(ALL_METRICS) else range_of(said, default),
        "–" if nothing else f"`{toml_value(default)}`",
        escaped(said["description"]),
    )


def _metrics() -> Iterator[str]:
    yield from ["## Names of metrics", "", "Of `show`, objectives and constraints, for nondimensional runs.", ""]
    rows = ((f"`{name}`", unit or "–", escaped(words)) for name, (words, unit) in ALL_METRICS.items())
    yield from rows_of(("metric", "unit", "meaning"), rows)


if __name__ == "__main__":
    sys.stdout.buffer.write(page().encode())  # the same bytes on every system
