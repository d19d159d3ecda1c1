"""Page one of `fracgyro allan`: from a gyroscope's record to its angle random walk, bias instability, rate random walk.

CSV file -> rates and interval (record.py) -> Allan deviation, N, B, K (allan.py) -> allan.json, allan.svg
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from ..files import whole_folder
from .allan import Allan, allan
from .record import Record, read_record
from .results import Result, noise_terms
from .units import DEG_PER_H


def analyse_record(
    path: str | os.PathLike[str],
    out: str | os.PathLike[str] | None = None,
    *,
    column: str | None = None,
    rate: float | None = None,
    unit: str = "deg/s",
    dashes: str = "",
) -> tuple[list[Result], dict[str, Any]]:
    """N, B and K of a record in a CSV file, and all of it as JSON has it; into `out`/allan.json and allan.svg if given.

    `column`: its name, or its number where there are no names; need not be given where there is only one but the time.
    `rate`: in Hz; need not be given where a column has the times. `unit`: deg/s, rad/s, deg/h or mdeg/s. `dashes`: what
    sentences write before the name of an argument, for a command line. docs/record.md has the format.

    Raises ValueError in one sentence for what is not a record of evenly spaced, finite numbers, or an `out` that is
    there.

    >>> np.savetxt("record.csv", np.random.default_rng(0).normal(size=(2000, 2)), header="x,y", delimiter=",")
    >>> figures, content = fg.rate.analyse_record("record.csv", column="x", rate=100.0)
    >>> content["samples"]
    2000
    """
    if out is None:
        return _analysed(path, read_record(path, column, rate, unit, dashes=dashes), unit)[:2]
    with whole_folder(out) as folder:
        results, content, found = _analysed(path, read_record(path, column, rate, unit, dashes=dashes), unit)
        text = json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False)
        (folder / "allan.json").write_text(text + "\n", encoding="utf-8")
        _draw(found, folder / "allan.svg")
    return results, content


def _analysed(path: str | os.PathLike[str], record: Record, unit: str) -> tuple[list[Result], dict[str, Any], Allan]:
    found = allan(record.values, record.interval)
    results = noise_terms(found)
    curve = {name: DEG_PER_H.per_si * getattr(found, name) for name in ("deviation", "low", "high")}
    content = {
        "record": os.fspath(path),
        "column": record.column,
        "unit": unit,
        "samples": len(record.values),
        "rate_hz": 1 / record.interval,
        "note": record.note,
        "figures": [result.plain() for result in results],
        "response_time_s": found.response_time or None,
        "fitted_s": found.fitted,
        "averaging_time_s": found.tau.tolist(),
        **{f"{name}_deg_per_h": values.tolist() for name, values in curve.items()},
    }
    return results, content, found


def _draw(found: Allan, path: Path) -> None:
    from ..analysis.style import own_style, svg
    from .plots import allan_figure

    with own_style():
        path.write_text(svg(allan_figure(found), "Allan deviation"), encoding="utf-8", newline="\n")
