"""One entry of the zoo: its published runs, or its law simulated on the plants of the literature."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from fracgyro.analysis.html import csv_text
from fracgyro.files import whole_file, writable_folder
from fracgyro.scenario import Scenario, ScenarioError
from fracgyro.scenario.table import format_value
from fracgyro.simulation.own_file import ControllerFile
from fracgyro.simulation.simulate import DivergedError, simulate

from ..comparison.plan import FIRST_HELD_OUT
from ..comparison.track import CHATTERING, Track
from .extra import parts
from .facts import Facts, plants
from .laws import SCENARIO, cell, contender_of, on_plant, sensed_base, tuned_gains, with_gains
from .page import blocks
from .printed import integrated
from .run import SETTINGS, Progress, figures_of, printed_run

SEEDS = 4
THEIRS = "theirs"


def published(name: str, facts: Facts, variant: str, out: Path | None, show: Progress) -> list[dict[str, Any]]:
    """The runs that a code has published, from the numbers of the entry, a row each; curves as CSV into `out`.

    Raises ScenarioError if the entry has no such runs.
    """
    if not facts.run:
        raise ScenarioError(f"{name} has no published runs: --{variant} needs an entry with some, as 2023_prescribed")
    rows = []
    for run in facts.run:
        curves = integrated(printed_run(facts, run.name, variant), progress=show)
        figures = figures_of(curves)
        rows.append(
            {
                "run": run.name,
                "RMS of e after t = 5, x and y": figures["rms"],
                "largest |e|/bound": figures["share"],
                "leaves it at": figures["leaves"],
                "from": run.source,
            }
        )
        columns = np.column_stack([curves.time, curves.error, curves.bound])
        _write(out, f"{name}_{run.name}_{variant}", ("t", "e_x", "e_y", "bound"), columns)
    return rows


def simulated(
    name: str, facts: Facts, plant: str | None, out: Path | None, controller: str | None
) -> list[dict[str, Any]]:
    """The law in noise and without, on the plants: errors, chattering and a trace, a row each; curves into `out`.

    `plant`: a name of plants.toml, or "theirs"; both plants by default. `controller`: FILE.py:NAME instead of the law.
    Raises ScenarioError for an unknown plant, a law that makes no scenario, or a controller that cannot be used.
    """
    law = contender_of(name, facts)
    if plant is not None and plant not in (THEIRS, *plants()):
        raise ScenarioError(f"--plant is {format_value(plant)}: it must be {THEIRS} or {' or '.join(plants())}")
    wanted = (SCENARIO, facts.plant) if plant is None else (facts.plant if plant == THEIRS else plant,)
    own = None if controller is None else ControllerFile.read(controller)
    rows = []
    for place in dict.fromkeys(wanted):
        for setting, noise in SETTINGS.items():
            base = on_plant(sensed_base(cell(facts.information, noise)), place)
            scenario = base if own else with_gains(law, setting).scenario(base)
            tuned = not own and place == SCENARIO and law.name in tuned_gains().get(setting, {})
            row = _measured(scenario, own)
            marks = {"plant": place, "noise, m/sqrt(Hz)": noise, "gains": "of the log" if tuned else "not tuned here"}
            rows.append({**marks, **row})
            try:
                curves = _curves(scenario, own)
            except DivergedError:
                rows[-1]["|e_x|, 1e-6 to 1"] = "diverged"
                continue
            rows[-1]["|e_x|, 1e-6 to 1"] = blocks(parts(curves[:, 1]))
            _write(out, f"{name}_{place}_{setting}", ("t", "e_x", "e_y"), curves)
    return rows


def _measured(scenario: Scenario, own: ControllerFile | None) -> dict[str, Any]:
    task = Track()
    seeds = range(FIRST_HELD_OUT, FIRST_HELD_OUT + SEEDS)
    (found,) = task.measure([scenario], seeds, scenario, own.controller() if own else None)
    error = task.error(found)
    lost = int(found.diverged.sum())
    chattering = max(float(np.mean(found.metrics[axis])) for axis in CHATTERING)
    return {
        "error, q0": None if lost else float(np.exp(error.mean())),
        "chattering": None if lost else chattering,
        "diverged": f"{lost}/{SEEDS}",
    }


def _curves(scenario: Scenario, own: ControllerFile | None) -> Any:
    seeded = scenario.replace({"disturbance.seed": FIRST_HELD_OUT})
    run = simulate(seeded, controller=own.controller() if own else None)
    return np.column_stack([run["time"].values, run["error"].transpose("time", "axis").values])


def _write(out: Path | None, name: str, heads: tuple[str, ...], columns: Any) -> None:
    if out is None:
        return
    with whole_file(writable_folder(out) / f"{name}.csv") as scratch:
        scratch.write_text(csv_text(heads, columns.tolist()), encoding="utf-8", newline="\n")
