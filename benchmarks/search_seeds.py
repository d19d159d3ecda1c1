"""How much an optimum of the comparison depends on the seeds that its search uses; writes search_seeds.md.

A contender is tuned with the 2 training seeds of `fracgyro compare track` and, from its optimum on, with all 8.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any

from fracgyro_lab.comparison.plan import planned
from fracgyro_lab.comparison.tuning import Tuning
from machine import command, machine, on_one_core, write
from words import short

DEPENDS_ON = ["pid", "sliding_mode", "internal_model"]
CONTENDERS = ("pid", "paper_no_adaptation", "internal_model")
PLACES = (("F", 0.0035), ("P", 0.05))
NOISE = 1e-13  # m/sqrt(Hz)


def rows() -> list[list[str]]:
    found = []
    for information, ceiling in PLACES:
        plan = planned(
            "track",
            scenarios=(),
            only=CONTENDERS,
            classes=(information,),
            noise=(NOISE,),
            controller=None,
            trials=None,
            quick=False,
            storage=None,
        )
        for row in plan.rows:
            if row.cell.scenario == "paper" and row.cell.ceiling == ceiling:
                found.append([f"`{row.contender.name}`", information, short(ceiling), *gains(plan.tuning(row, {}))])
    return found


def gains(tuning: Tuning) -> list[str]:
    """Trials and error of the search with few seeds, the error of one with all that starts there, and their ratio."""
    few = tuning.measure()
    best = min((each for each in few["samplers"] if each["error"] is not None), key=lambda each: float(each["error"]))
    start: dict[str, Any] = best["best"]
    whole = dataclasses.replace(tuning, starts=(start,), few=len(tuning.seeds), samplers=1, trials=400)
    after = whole.measure()["samplers"][0]["error"]
    return [
        str(few["trials"]),
        short(math.exp(best["error"]), 4),
        short(math.exp(after), 4),
        short(math.exp(after - best["error"]), 3),
    ]


def main() -> None:
    lines = ["# Seeds of a search", ""]
    lines += [f"Made by `{command()}`. Machine: {machine('cmaes')}.", ""]
    heads = ["contender", "class", "ceiling", "trials", "error, tuned on 2 seeds", "tuned on 8", "ratio"]
    lines += [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
    lines += [f"| {' | '.join(row)} |" for row in rows()]
    lines += ["", "Errors are those on all 8 training seeds, with noise of 1e-13 m/√Hz."]
    write("search_seeds", lines)


if __name__ == "__main__":
    on_one_core()
    main()
