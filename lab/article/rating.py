"""The comparison of controllers as rate sensors: tables and sentences from benchmarks/results/compare-rate.json."""

from __future__ import annotations

import math
from typing import Any

from comparison import NOISE, PAPER, Row, Values, effort, within
from words import concise, short, spelled

# Columns of the tables of `rate`: entry of `metrics`, its heading, its unit and the factor to it.
RATE_COLUMNS = {
    "error": ("ARW", "deg/√h", 1.0),
    "equal_motion": ("ARW at equal motion", "deg/√h", 1.0),
    "over_bound": ("ARW over the bound", "", 1.0),
    "scale_factor_error": ("scale factor", "ppm", 1.0),
    "bias_damping": ("bias by dxy", "deg/h", 1.0),
    "bias_quadrature_hidden": ("bias by quadrature, hidden delay", "deg/h", 1.0),
    "bias_drift": ("bias by drift of K", "deg/h", 1.0),
    "rms_drift": ("RMS by drift of K", "deg/h", 1.0),
    "start_up": ("start-up", "ms", 1.0),
}
MOST_COLUMNS, MOST_TABLES = 9, 2
NOTHING = 0.01  # smaller values, in any of these units, are shown as less than this


def values(data: dict[str, Any]) -> Values:
    rows: list[Row] = data["contenders"]
    columns = _columns(rows)
    cells = sorted({_place(row) for row in rows}, key=lambda of: (of[2] != NOISE, of[1] != "P", of))
    shown = cells[:MOST_TABLES]
    tables = [_rate_table(of, [row for row in rows if _place(row) == of], columns) for of in shown]
    return {
        "effort": effort(data),
        "contenders": spelled(len({row["name"] for row in rows})),
        "heads": [", ".join(filter(None, _of_column(name)[:2])) for name in columns],
        "tables": tables,
        "others": spelled(len(cells) - len(shown), "further setting"),
        "industry": _industry([row for row in rows if row["noise"] == NOISE]),
    }


REBALANCE, FILTER, CLASSICAL = "force_rebalance", "lqg", "park_horowitz"


def _industry(rows: list[Row]) -> Values:
    """Force rebalance, the joint filter and Park and Horowitz's control; `known`: all three keep the limits."""
    by_name = {row["name"]: row for row in rows if row["kept"] and row["class"] == "P"}
    full = next((row for row in rows if row["kept"] and row["class"] == "F" and row["name"] == FILTER), None)
    if not {REBALANCE, FILTER, CLASSICAL} <= by_name.keys():
        return {"known": False}

    def of(name: str, metric: str, digits: int = 2) -> str:
        return short((by_name[name]["metrics"].get(metric) or {}).get("value"), digits)

    ratio = by_name[FILTER]["ratio"]
    return {
        "known": True,
        "ratio": f"{short(ratio['value'])} ({within(ratio)})",
        "paper": PAPER in by_name,
        "full_hidden": _rate_cell(full, "bias_quadrature_hidden") if full else "–",
        **{
            f"{key}_{metric}": of(name, metric)
            for key, name in (("rebalance", REBALANCE), ("filter", FILTER), ("classical", CLASSICAL))
            for metric in RATE_COLUMNS
        },
        "motion": {name: _rate_cell(by_name[name], "equal_motion") for name in (REBALANCE, FILTER)},
        "stiffness": {name: short(by_name[name]["others"]["K +5 %"]["value"]) for name in (FILTER, CLASSICAL)},
    }


def _columns(rows: list[Row]) -> list[str]:
    """The RATE_COLUMNS that any row has; without any, all metrics of the rows."""
    there = list(dict.fromkeys(name for row in rows for name in row["metrics"]))
    if not there:
        raise ValueError("compare-rate.json has no metrics")
    return ([name for name in RATE_COLUMNS if name in there] or there)[:MOST_COLUMNS]


def _place(row: Row) -> tuple[str, str, float, float]:
    return row.get("scenario", ""), row["class"], float(row["noise"] or 0), float(row["ceiling"] or 0)


def _rate_table(of: tuple[str, str, float, float], rows: list[Row], columns: list[str]) -> Values:
    first = columns[0]
    ordered = sorted((row for row in rows if row["kept"]), key=lambda row: _size(row, first))
    return {
        "scenario": of[0].replace("_", " "),
        "class": of[1],
        "noise": short(of[2]) if of[2] else "0",
        "rows": [
            {
                "name": row["name"].replace("_", " "),
                "paper": row["name"].startswith(PAPER),
                "cells": [_rate_cell(row, name) for name in columns],
            }
            for row in ordered
        ],
        "outside": [row["name"].replace("_", " ") for row in rows if not row["kept"]],
    }


def _of_column(name: str) -> tuple[str, str, float]:
    """Words, unit, factor; of what RATE_COLUMNS lacks the name."""
    return RATE_COLUMNS.get(name, (name.replace("_", " "), "", 1.0))


def _rate_cell(row: Row, name: str) -> str:
    if row["diverged"]:
        return f"{row['diverged']} diverged"
    found, factor = row["metrics"].get(name) or {}, _of_column(name)[2]
    if found.get("value") is None:
        return "–"
    if found.get("low") is None or found.get("high") is None:
        return short(factor * found["value"], 3)
    if max(abs(found["low"]), abs(found["high"])) < NOTHING:
        return f"< {NOTHING:g}"
    return concise(factor * found["value"], factor * abs(found["high"] - found["low"]) / 2)


def _size(row: Row, name: str) -> float:
    value = (row["metrics"].get(name) or {}).get("value")
    return math.inf if value is None else abs(value)
