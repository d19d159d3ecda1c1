"""Table 1: RMSE of x and y by order, for both variants, over many seeds."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import NamedTuple

from ..files import whole_file
from .runs import ORDERS, VARIANTS, Study
from .statistics import mean_interval

WINDOWS = ("whole", "transient", "steady")


class Row(NamedTuple):
    """One cell of Table 1. The window is the whole run, its transient (t < 10) or what follows (steady)."""

    variant: str
    order: float
    axis: str
    window: str
    rmse_mean: float
    rmse_ci_low: float
    rmse_ci_high: float
    seeds: int


def table(study: Study) -> list[Row]:
    """Every cell, in reading order."""
    rows = []
    for variant in VARIANTS:
        for order in ORDERS:
            rmse = study[variant, "proposed", order]["rmse"]
            for axis in ("x", "y"):
                for window in WINDOWS:
                    values = rmse.sel(axis=axis, window=window).values
                    rows.append(Row(variant, order, axis, window, *mean_interval(values), values.size))
    return rows


def write_table(rows: list[Row], path: Path) -> None:
    """As CSV, with the columns of `Row`."""
    with whole_file(path) as scratch, open(scratch, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(Row._fields)
        writer.writerows(rows)
