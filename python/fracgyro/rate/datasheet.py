"""`fg.datasheet`: the figures of `fracgyro rate` and the procedures of IEEE Std 1431, by clause."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from importlib.metadata import version
from pathlib import Path

from ..analysis.html import csv_text, page
from ..arguments import number
from ..files import whole_folder
from ..scenario import Scenario, check_scenario
from ..simulation.user_controller import ControllerLike, controller_words
from . import plots
from .accelerations import accelerations
from .in_volts import AngleDrift, angle_drift, angle_figures, ripple_figures, volts_figures
from .measure import Characterization, measure
from .procedures import (
    CYCLES,
    FEW_CYCLES,
    MISSING,
    OF_RATE,
    Row,
    Sheet,
    axes,
    clauses,
    of_rates,
    power_cycles,
    undriven,
)
from .report import interval_of, value_of
from .results import Result, results
from .runs import Progress, run_all
from .sensor import Sensor
from .thermal import temperature, warm_up

DRIFT, LIMITS = "12.11", "12.10"  # clauses of what a device in volts adds
POINTS = ("clause", "procedure", "varied", "at", "run", "measured", "value")
TITLES = {
    "12.5": "Turn-on",
    "12.6": "Warm-up",
    "12.7": "Polarity",
    "12.8": "Temperature",
    "12.9": "Scale factor",
    "12.10": "Input limits",
    "12.11": "Drift",
    "12.12": "Axis alignment",
    "12.13": "Angle storage",
    "12.14": "Run-down",
    "12.15": "Transfer function",
    "12.17": "Vibration",
}


def datasheet(
    scenario: Scenario,
    out: str | os.PathLike[str],
    *,
    controller: ControllerLike | None = None,
    quick: bool = False,
    rest: float | None = None,
    progress: Progress | None = None,
) -> list[Row]:
    """Measures `scenario` by the clauses of IEEE Std 1431; writes `out`/datasheet.html, datasheet.json and points.csv.

    Returns the rows in the order of the clauses: the figures of `fg.rate.characterise`; polarity and asymmetry; bias
    and scale factor over the temperature, hysteresis and warm-up; repeatability over power cycles; rates about x and y;
    bias by accelerations, vibrations and shocks; angle storage and run-down of the undriven vibration; for a device in
    volts its voltages, readout, noise shares and biases. A row whose effect the scenario lacks has no value and the
    note "not in the scenario". points.csv has every point of these procedures.

    `controller`: replaces the scenario's controller, as in `fracgyro.simulate`; it must report rate_estimate. `quick`:
    2 noise seeds instead of 8, and 6 power cycles instead of 16. `rest`: device time of the static test in s, as in
    `fg.rate.characterise`. `progress`: called with (done, total, current measurement).

    Raises ValueError for a scenario or a controller without a rate estimate, an existing `out`, a `rest` with too few
    outputs or too many steps, and a run that diverges within the range.

    >>> short = fg.Scenario.paper().replace({"run.duration": 4.0})
    >>> rows = fg.datasheet(short, "sheet", quick=True, rest=0.01)
    >>> [row.name for row in rows if row.clause == "12.7"]
    ['Polarity']
    """
    check_scenario(scenario)
    if rest is not None:
        rest = number("rest", rest, above=0.0)
    show = progress or (lambda done, total, doing: None)
    with whole_folder(out) as folder:
        sensor = Sensor.of(scenario, 2 if quick else 8, controller)
        runs = run_all(sensor, rest=rest, progress=progress)
        measured = measure(sensor, runs, rest=rest)
        sheet = Sheet()
        of_rates(sheet, runs)
        own = list(_steps(sheet, sensor, quick))
        for done, (doing, procedure) in enumerate(own):
            show(done, len(own) + 1, doing)
            procedure()
        show(len(own), len(own) + 1, "electrodes")
        drift = angle_drift(sensor)
        rows = clauses([*_of_results(results(measured), sensor, drift), *sheet.rows])
        show(1, 1, "writing")
        _write(folder, measured, rows, sheet, drift)
    return rows


def _steps(sheet: Sheet, sensor: Sensor, quick: bool) -> Iterator[tuple[str, Callable[[], object]]]:
    """The procedures with runs of their own: their names, and themselves."""
    few = sensor.first(2)
    yield "temperature", lambda: temperature(sheet, few)
    yield "warm-up", lambda: warm_up(sheet, few)
    yield "power cycles", lambda: power_cycles(sheet, sensor, FEW_CYCLES if quick else CYCLES)
    yield "axis alignment", lambda: axes(sheet, few)
    yield "accelerations", lambda: accelerations(sheet, sensor)
    yield "run-down", lambda: undriven(sheet, sensor.scenario)


def _of_results(found: list[Result], sensor: Sensor, drift: AngleDrift | None) -> list[Row]:
    """Figures of `fracgyro rate` as rows; those of volts that the scenario lacks as missing."""
    rows = [_row(*OF_RATE[each.key], each) for each in found]
    volts = volts_figures(sensor)
    rows += [_row(*_place(each), each) for each in volts]
    if not any(each.key.startswith("voltage") for each in volts):
        note = f"{MISSING}: [[electrodes]] of role force"
        rows.append(Row(LIMITS, "voltage", "Voltage of the drivers", "rates of 0 and 300 deg/s", "V", note=note))
    for key, name, why in (
        ("feedthrough", "Bias by feedthrough", "electronics.feedthrough is zeros"),
        ("phase", "Bias by phase, times the quadrature", "electronics.pole and the delays are off"),
    ):
        if not any(each.key == f"bias_by_{key}" for each in volts):
            rows.append(Row(DRIFT, f"bias_by_{key}", name, "with and without it", "deg/h", note=f"{MISSING}: {why}"))
    if not any(each.key.startswith("readout") for each in volts):
        note = f"{MISSING}: [electronics] without noise, or no [[electrodes]] of role pickoff"
        rows.append(Row(DRIFT, "readout", "Readout noise", "none: from the electrodes", "m/sqrt(Hz)", note=note))
    ripple = ripple_figures(sensor)
    rows += [_row(DRIFT, "none: at rest", each) for each in ripple]
    if not ripple:
        note = f"{MISSING}: no electrodes or electronics, and device.cubic_coupling and cubic_skew are 0"
        rows.append(Row(DRIFT, "ripple", "Ripple at the split", "none: at rest", "deg/s", note=note))
    angle = angle_figures(drift)
    rows += [_row(DRIFT, "the angle of the line, by a rate of 300 deg/s", each) for each in angle]
    if not angle:
        note = f"{MISSING}: controller.kind is not whole_angle"
        rows.append(Row(DRIFT, "angle_drift", "Drift against the angle", "angle of the line", "deg/h", note=note))
    return rows


def _place(figure: Result) -> tuple[str, str]:
    """Clause of a figure in volts, and what was varied."""
    if figure.key.startswith("voltage"):
        return LIMITS, f"a rate of {300 if 'range' in figure.key else 0} deg/s about z"
    if figure.key.startswith("bias_by"):
        return DRIFT, "with and without it"
    return DRIFT, "none: from the electrodes" if figure.key.startswith("readout") else "one noise at a time"


def _row(clause: str, varied: str, figure: Result) -> Row:
    return Row(clause, figure.key, figure.name, varied, figure.unit, figure.value, figure.low, figure.high, figure.note)


def _write(folder: Path, measured: Characterization, rows: list[Row], sheet: Sheet, drift: AngleDrift | None) -> None:
    scenario = measured.scenario.to_toml()
    content: dict[str, object] = {"scenario": scenario}
    if measured.controller is not None:
        content["controller"] = controller_words(measured.controller)
    content |= {"standard": "IEEE Std 1431", "seeds": measured.seeds, "rows": [row.plain() for row in rows]}
    text = json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False)
    (folder / "datasheet.json").write_text(text + "\n", encoding="utf-8")
    points = csv_text(POINTS, ([getattr(point, name) for name in POINTS] for point in sheet.points))
    (folder / "points.csv").write_text(points, encoding="utf-8")
    html = page(
        "fracgyro.rate",
        "datasheet.html.jinja",
        version=version("fracgyro"),
        measured=measured,
        user_controller=controller_words(measured.controller),
        groups=[
            (clause, title, [(row, shown(row), interval_of(as_result(row))) for row in rows if row.clause == clause])
            for clause, title in TITLES.items()
        ],
        points=points,
        scenario=scenario,
        allan=plots.allan_chart(measured),
        ladder=plots.ladder_chart(measured),
        start=plots.turn_on_chart(measured),
        response=plots.response_chart(measured),
        temperature=plots.temperature_chart(sheet.points),
        angle=plots.angle_chart(drift) if drift else None,
    )
    (folder / "datasheet.html").write_text(html, encoding="utf-8", newline="\n")


def as_result(row: Row) -> Result:
    """The numbers of a row as a figure, whose texts `report.py` makes."""
    return Result(row.key, row.name, row.varied, row.unit, row.value, row.low, row.high)


def shown(row: Row) -> str:
    """The value as text: with < or ≥ for a limit, a dash without a number."""
    return value_of(as_result(row))
