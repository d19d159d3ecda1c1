"""Entry point of `fracgyro rate`: from a scenario to the figures of merit of its rate sensor.

    ladder of constant rates -> scale factor, non-linearity, zero-rate output, full scale, turn-on time
    long record at rest      -> Allan deviation: angle random walk, bias instability, rate random walk
    sinusoidal rates         -> bandwidth, phase lag
    wrong couplings          -> quadrature residual

All figures are measured only on the output, as on a rate table; terms are those of IEEE Std 528, 952 and 1431.
"""

from __future__ import annotations

import json
import os
from pathlib import Path

from ..arguments import number, short
from ..files import whole_folder
from ..scenario import Scenario, check_scenario
from ..simulation.user_controller import ControllerLike, controller_words
from .imu import FILES, Imu, imu_file, of_simulation
from .in_volts import angle_drift, angle_figures, ripple_figures, volts_figures
from .measure import Characterization, measure
from .report import write_report
from .results import Result, results
from .runs import Progress, run_all
from .sensor import Sensor


def characterise(
    scenario: Scenario,
    out: str | os.PathLike[str],
    *,
    controller: ControllerLike | None = None,
    quick: bool = False,
    rest: float | None = None,
    imu: Imu | None = None,
    progress: Progress | None = None,
) -> list[Result]:
    """Characterizes `scenario` as a rate sensor; writes `out`/report.html and `out`/rate.json.

    Returns the figures of merit in the order of the report. rate.json has the scenario, the figures, and the response
    to sinusoidal rates: frequency in Hz, gain relative to the scale factor, lag in rad.

    A device in volts has figures of its own: voltages, noise of the readout, the share of each noise, bias by
    feedthrough and by phase; like one with springs common to both axes, it has the ripple at the difference of the
    resonances. A whole-angle gyroscope has its drift against the angle, lock-in, resolution of the angle, and gain.

    The measurement sets the angular rate instead of plant.angular_rate; everything else is as in the scenario.

    `controller`: replaces the scenario's controller, as in `fracgyro.simulate`; it must report rate_estimate. Before
    each run the reset method of a callable receives the scenario with the rate to be sensed. `quick`: 2 seeds instead
    of 8. `rest`: device time of the static test in s; by default two million steps, or half a million if the switching
    gain has no known bound. Bias instability and rate random walk need minutes to hours. `imu`: also writes the noise
    for that navigation simulation, as imu.yaml, gnss_ins_sim.py or kf_gins.yaml. `progress`: called with (done, total,
    current measurement).

    Raises ValueError for a scenario or a controller without a rate estimate, an existing `out`, a `rest` with too few
    outputs or too many steps, and a run that diverges within the range; also the errors that `simulate` raises for a
    controller.

    >>> short = fg.Scenario.paper().replace({"run.duration": 4.0})
    >>> figures = fg.rate.characterise(short, "sensor", quick=True, rest=0.01)
    >>> [figure.name for figure in figures][:2]
    ['Scale factor error', 'Non-linearity']
    """
    check_scenario(scenario)
    if rest is not None:
        rest = number("rest", rest, above=0.0)
    if imu is not None and imu not in FILES:
        raise ValueError(f"imu is {short(imu)}: it must be one of {', '.join(FILES)}")
    with whole_folder(out) as folder:
        sensor = Sensor.of(scenario, 2 if quick else 8, controller)
        runs = run_all(sensor, rest=rest, progress=progress)
        measured = measure(sensor, runs, rest=rest)
        drift = angle_drift(sensor)
        figures = [*results(measured), *volts_figures(sensor), *ripple_figures(sensor), *angle_figures(drift)]
        _write_json(folder / "rate.json", measured, figures)
        if imu is not None:
            name, words = imu_file(imu, [of_simulation(measured)])
            (folder / name).write_text(words, encoding="utf-8")
        write_report(folder / "report.html", measured, figures, drift)
    return figures


def _write_json(path: Path, measured: Characterization, figures: list[Result]) -> None:
    content: dict[str, object] = {"scenario": measured.scenario.to_toml()}
    if measured.controller is not None:
        content["controller"] = controller_words(measured.controller)
    content["figures"] = [figure.plain() for figure in figures]
    content["response"] = {name: getattr(measured.response, name).tolist() for name in ("frequency", "gain", "lag")}
    text = json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False)
    path.write_text(text + "\n", encoding="utf-8")
