"""Entry point of `fracgyro allan`: from a gyroscope's record to its noise terms.

file -> columns of numbers (tables.py) -> rates and interval (record.py, times.py) -> events (inspection.py)
     -> Allan deviation, N, B, K, Q (allan.py) -> allan.json, allan.svg, series.svg, report.html; imu.yaml and others
"""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..arguments import short
from ..files import whole_folder
from .allan import allan
from .imu import FILES, Imu, imu_file
from .record import Options, read_record
from .results import Result, noise_terms
from .series import Series, noise_of
from .units import DEG_PER_H


def analyze_record(
    path: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
    out: str | os.PathLike[str] | None = None,
    *,
    column: str | Sequence[str] | None = None,
    rate: float | None = None,
    unit: str | None = None,
    time: str | None = None,
    time_unit: str | None = None,
    begin: float | None = None,
    end: float | None = None,
    scale: float = 1.0,
    increments: bool = False,
    skip_empty: bool = False,
    imu: Imu | None = None,
) -> tuple[list[Result], dict[str, Any]]:
    """Noise terms Q, N, B and K of one or more records at rest.

    Returns the figures of the first column, and the content of allan.json, which has all columns under `series`. With
    `out`, writes allan.json, pictures and report.html into that new folder.

    `column`: a name, a number such as `#3`, or several; optional if the file has only one column and the time.
    `rate`: sampling rate in Hz; optional if a column has the times. `time`: name of that column, if it is not
    recognized; `time_unit`: its unit, s, ms, us or ns. `unit`: unit of the rates, deg/s, rad/s, deg/h, mdeg/s or
    mrad/s; by default the unit in the file, or deg/s. `begin`, `end`: part of the record, s. `scale`: factor that
    converts the numbers to `unit`. `increments`: the numbers are angle increments. `skip_empty`: ignores rows without a
    value. `imu`: also writes the noise for that navigation filter. docs/record.md describes the formats.

    Raises ValueError for a file that is not a record of evenly spaced, finite numbers, for an invalid option, and for
    an existing `out`.

    >>> np.savetxt("record.csv", np.random.default_rng(0).normal(size=(2000, 2)), header="x,y", delimiter=",")
    >>> figures, content = fg.rate.analyze_record("record.csv", column="x", rate=100.0)
    >>> content["samples"]
    2000
    """
    paths = [path] if isinstance(path, str | os.PathLike) else list(path)
    columns = () if column is None else (column,) if isinstance(column, str) else tuple(column)
    options = Options(
        columns, rate, unit, time, time_unit, begin, end, scale, increments, skip_empty
    )  # fmt: skip
    series, content = analyze_series(paths, out, options, imu)
    return series[0].figures, content


def analyze_series(
    paths: Sequence[str | os.PathLike[str]],
    out: str | os.PathLike[str] | None,
    options: Options,
    imu: Imu | None = None,
) -> tuple[list[Series], dict[str, Any]]:
    """All columns of all records, and the content of allan.json; raises what `analyze_record` raises."""
    dashes = options.dashes
    if imu is not None and imu not in FILES:
        raise ValueError(f"{dashes}imu is {short(imu)}: it must be one of {', '.join(FILES)}")
    if imu is not None and out is None:
        raise ValueError(f"{dashes}imu requires {dashes}out, the folder for its file")
    if out is None:
        series = [each for one in paths for each in _analyzed(one, options)]
        return series, _content_of(series)
    with whole_folder(out) as folder:
        series = [each for one in paths for each in _analyzed(one, options)]
        content = _content_of(series)
        text = json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False)
        (folder / "allan.json").write_text(text + "\n", encoding="utf-8")
        if imu is not None:
            name, words = imu_file(imu, [noise_of(each) for each in series])
            (folder / name).write_text(words, encoding="utf-8")
        _draw(series, folder)
    return series, content


def _analyzed(path: str | os.PathLike[str], options: Options) -> list[Series]:
    record = read_record(path, options)
    found = [allan(values, record.interval) for values in record.values]
    return [Series(os.fspath(path), record, i, each, noise_terms(each)) for i, each in enumerate(found)]


def _content_of(series: Sequence[Series]) -> dict[str, Any]:
    contents = [_content(each) for each in series]
    return contents[0] if len(contents) == 1 else {"series": contents}


def _content(series: Series) -> dict[str, Any]:
    record, found = series.record, series.found
    curve = {name: DEG_PER_H.per_si * getattr(found, name) for name in ("deviation", "low", "high")}
    return {
        "record": series.path,
        "column": series.name,
        "unit": record.unit,
        "samples": record.values.shape[1],
        "rate_hz": 1 / record.interval,
        "notes": series.notes,
        "events": [
            {
                "kind": event.kind,
                "time": event.time,
                "end": event.end,
                "sentence": event.sentence,
                "spoils": event.spoils,
            }
            for event in found.events
        ],
        "figures": [result.plain() for result in series.figures],
        "response_time_s": found.response_time or None,
        "fitted_s": found.fitted,
        "averaging_time_s": found.tau.tolist(),
        **{f"{name}_deg_per_h": values.tolist() for name, values in curve.items()},
    }


def _draw(series: Sequence[Series], folder: Path) -> None:
    from .record_report import write_record_report

    write_record_report(folder, series)
