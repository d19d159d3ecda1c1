"""Page one of `fracgyro rate`: from a scenario to the figures of merit of the rate sensor that it is.

    ladder of constant rates -> scale factor, non-linearity, zero-rate output, full scale, turn-on time
    long record at rest      -> Allan deviation: angle random walk, bias instability, rate random walk
    sinusoidal rates         -> bandwidth, phase lag
    wrong couplings          -> quadrature residual

All of it is measured only on the output, as on a rate table; the words are those of IEEE Std 528, 952 and 1431.
"""

from __future__ import annotations

import json
import os

from ..files import whole_folder
from ..scenario import Scenario
from .measure import Progress, measure
from .report import write_report
from .results import Result, results


def characterise(
    scenario: Scenario,
    out: str | os.PathLike[str],
    *,
    quick: bool = False,
    progress: Progress | None = None,
) -> list[Result]:
    """Measures `scenario` as a rate sensor and writes `out`/report.html and `out`/rate.json.

    Rates are set from outside, plant.angular_rate notwithstanding; the rest is as the scenario says. `quick`: 2 seeds
    instead of 8, for a look. Raises ValueError in one sentence: a scenario without an estimate, an `out` that is there
    already, a run that diverges within the range.
    """
    with whole_folder(out) as folder:
        measured = measure(scenario, seeds=2 if quick else 8, progress=progress)
        found = results(measured)
        content = {"scenario": scenario.to_toml(), "figures": [result.plain() for result in found]}
        text = json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False)
        (folder / "rate.json").write_text(text + "\n", encoding="utf-8")
        write_report(folder / "report.html", measured, found)
    return found
