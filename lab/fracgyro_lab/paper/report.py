"""The self-contained HTML report."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from fracgyro.analysis.html import csv_text, embedded, page
from fracgyro.files import whole_file

from .claims import Claim
from .errata import Erratum
from .runs import ORDERS, PAPER_ORDER, VARIANTS, Study, scenario
from .table import WINDOWS, Row

DEGREES_PER_SECOND = 180.0 / np.pi
UNITS = {"whole": 1e-3, "transient": 1e-3, "steady": 1e-6}  # units of the RMSE in the tables

TABLE_COLUMNS = (
    *("variant", "order alpha", "axis", "window"),
    *("mean RMSE (q0)", "low end of its 95 % interval (q0)", "high end (q0)", "seeds"),
)


def write_report(
    path: Path,
    *,
    claims: list[Claim],
    rows: list[Row],
    errata: list[tuple[Erratum, str]],
    study: Study,
    captions: Mapping[int, str],
    figures: Path,
    version: str,
    seconds: float,
) -> None:
    """Writes `path` from the results and the SVG and CSV files in the folder `figures`, which become part of it."""
    corrected = scenario("corrected", "proposed")
    by_id: dict[str, dict[str, Claim]] = {}
    for claim in claims:
        by_id.setdefault(claim.id, {})[claim.variant] = claim
    steady = study["corrected", "proposed", PAPER_ORDER]["rmse"].sel(window="steady")
    text = page(
        "fracgyro_lab.paper",
        "report.html.jinja",
        version=version,
        seeds=rows[0].seeds,
        minutes=f"computed in {seconds:.0f} s",
        claims=list(by_id.items()),
        tracking=float(steady.mean()),
        sensing=_sensing(study),
        step=f"{corrected.run.step:g}",
        hold=f"{corrected.disturbance.hold:g}",
        tolerance=f"{corrected.run.kernel_tolerance:g}",
        table_figure=embedded((figures / "table1.svg").read_bytes()),
        table_data=csv_text(TABLE_COLUMNS, rows),
        tables=[_table(variant, rows) for variant in VARIANTS],
        errata=errata,
        figures=[
            {
                "number": n,
                "caption": caption,
                "source": embedded((figures / f"figure{n:02d}.svg").read_bytes()),
                "data": (figures / f"figure{n:02d}.csv").read_text(encoding="utf-8"),
            }
            for n, caption in captions.items()
        ],
        scenario=corrected.to_toml(),
    )
    with whole_file(path) as scratch:
        scratch.write_text(text, encoding="utf-8")


def _sensing(study: Study) -> str:
    """The rate estimate in the terms of a gyroscope."""
    plant = scenario("corrected", "proposed").plant
    to_degrees = plant.scales.rate * DEGREES_PER_SECOND
    metrics = study["corrected", "proposed", PAPER_ORDER]
    peak = float(metrics["rate_error_peak"].median())
    late = float(np.sqrt((metrics["rate_error"] ** 2).mean()))
    median = float(abs(metrics["rate_error"]).median())
    truth = plant.angular_rate * DEGREES_PER_SECOND
    damping = float(metrics["damping_error"].median())
    rate = plant.nondimensional()[2]
    return (
        f"With the corrected law the estimate of the angular rate, {truth:.0f} deg/s here, is first thrown off by "
        f"{peak * to_degrees:.2g} deg/s, {peak / rate:.0f} times the rate itself, and at t = 80 is still "
        f"{late * to_degrees:.0f} deg/s off, {late / rate:.0%} of it (RMS over seeds; median {median / rate:.0%}); "
        f"the damping estimate is off by {damping:.0f} times the damping. As printed, the rate estimate never moves at "
        "all. As a gyroscope, neither is of use yet."
    )


def _table(variant: str, rows: list[Row]) -> tuple[str, list[str], list[tuple[float, list[tuple[str, bool]]]]]:
    columns = [(window, axis) for window in WINDOWS for axis in ("x", "y")]
    cells: dict[tuple[float, str, str], Row] = {(r.order, r.window, r.axis): r for r in rows if r.variant == variant}
    body: list[tuple[float, list[tuple[str, bool]]]] = []
    for order in ORDERS:
        line = []
        for window, axis in columns:
            row = cells[order, window, axis]
            least = min(cells[o, window, axis].rmse_mean for o in ORDERS)
            line.append((_plus_minus(row), row.rmse_mean == least))
        body.append((order, line))
    return variant, [f"{axis}, {window} (×{UNITS[window]:.0e})" for window, axis in columns], body


def _plus_minus(row: Row) -> str:
    """Mean ± half the interval in the unit of its window, with two digits of the half."""
    unit = UNITS[row.window]
    half = (row.rmse_mean - row.rmse_ci_low) / unit
    digits = int(np.clip(1 - np.floor(np.log10(half)), 0, 6)) if half > 0 else 2
    return f"{row.rmse_mean / unit:.{digits}f} ± {half:.{digits}f}"
