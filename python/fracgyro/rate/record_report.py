"""The report of a record: one self-contained HTML file, and its pictures as files."""

from __future__ import annotations

import math
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from ..analysis.html import csv_text, embedded, page
from ..analysis.style import own_style, save_svg
from .grades import GRADES
from .imu import FILES, imu_file
from .plots import allan_figure, series_figure
from .report import grade_of, interval_of, si_of, value_of
from .series import Series, left_out, noise_of
from .units import DEG_PER_H, DEG_PER_S

NAMES = {"kalibr": "Kalibr", "gnss-ins-sim": "gnss-ins-sim", "kf-gins": "KF-GINS"}


def write_record_report(folder: Path, series: Sequence[Series]) -> None:
    """Writes report.html, and allan.svg and series.svg for each column, numbered if there are several."""
    shown = []
    for i, one in enumerate(series):
        number = "" if len(series) == 1 else f"-{i + 1}"
        record, found = one.record, one.found
        values = record.values[one.column]
        with own_style():
            deviation = allan_figure(found, label=one.name if len(one.name) < 30 else "record")
            over_time = series_figure(values, record.interval, found.events)
            save_svg(deviation, folder / f"allan{number}.svg", "Allan deviation")
            save_svg(over_time, folder / f"series{number}.svg", "Rate over time")
            pictures = embedded(over_time, "Rate over time"), embedded(deviation, "Allan deviation")
        shown.append(
            {
                "name": one.name,
                "path": Path(one.path).name,
                "events": found.events,
                "notes": one.notes,
                "figures": [(r, value_of(r), interval_of(r), grade_of(r), si_of(r)) for r in one.figures],
                "series": pictures[0],
                "allan": pictures[1],
                "data": _data(one),
                "span": span_of(one),
                "left_out": left_out(one),
            }
        )
    noises = [noise_of(one) for one in series]
    first = series[0].record
    text = page(
        "fracgyro.rate",
        "record.html.jinja",
        version=version("fracgyro"),
        shown=shown,
        samples=f"{first.values.shape[1]:,}",
        length=_duration(first.values.shape[1] * first.interval),
        rate=f"{1 / first.interval:.6g}",
        navigation=[(NAMES[kind], kind, *imu_file(kind, noises)) for kind in FILES],
        grades=GRADES,
    )
    (folder / "report.html").write_text(text, encoding="utf-8", newline="\n")


def span_of(series: Series) -> dict[str, Any]:
    """Mean, standard deviation and range of the record, deg/s, as text."""
    values = series.record.values[series.column]
    return {
        "mean": f"{DEG_PER_S.of(float(values.mean())):.3g}",
        "deviation": f"{DEG_PER_S.of(float(values.std())):.3g}",
        "low": f"{DEG_PER_S.of(float(values.min())):.3g}",
        "high": f"{DEG_PER_S.of(float(values.max())):.3g}",
    }


def _data(series: Series) -> str:
    found, unit = series.found, DEG_PER_H.per_si
    first, last = found.fitted or (math.inf, 0.0)
    fitted = (found.tau > 0.99 * first) & (found.tau < 1.01 * last)
    columns = {
        "averaging time (s)": found.tau,
        "Allan deviation (deg/h)": found.deviation * unit,
        "low end of the 95 % interval (deg/h)": found.low * unit,
        "high end (deg/h)": found.high * unit,
        "fitted": np.where(fitted, "yes", "no"),
    }
    return csv_text(columns, zip(*(column.tolist() for column in columns.values()), strict=True))


def _duration(seconds: float) -> str:
    if seconds < 120:
        return f"{seconds:.3g} s"
    return f"{seconds / 60:.3g} min" if seconds < 7200 else f"{seconds / 3600:.3g} h"
