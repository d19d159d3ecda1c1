"""Every law of the zoo with a disturbance observer around it; writes benchmarks/results/compensation.md.

python benchmarks/compensation.py [--quick]
"""

from __future__ import annotations

import argparse
import math

import fracgyro as fg
import numpy as np
from fracgyro_lab.zoo.laws import LOW, NOISE, cell, laws, sensed_base, with_gains
from machine import command, machine, write

DEPENDS_ON = [
    "sliding_mode",
    "pid",
    "lqg",
    "fixed_time",
    "network",
    "dynamic_sliding",
    "prescribed",
    "lab/fracgyro_lab/zoo/*.json",
]

BANDWIDTHS = (20.0, 60.0, 150.0)  # L
SEEDS = 8
LASTING = (200.0, -100.0)  # the force that is added


def found(scenarios: list[fg.Scenario], seeds: int) -> tuple[np.ndarray, np.ndarray]:
    """Geometric means of the steady error over seeds and axes, means of the larger axis's chattering; (scenarios,)."""
    measured = fg.measure_many(scenarios, seeds=range(1000, 1000 + seeds), transient=2.0)
    shape = (len(scenarios), seeds)
    error = measured["rmse"].sel(window="steady").transpose("run", "axis").values.reshape(*shape, 2)
    chattering = measured["chattering"].max("axis").values.reshape(shape)
    lost = np.isfinite(measured["diverged_at"].values).reshape(shape).any(axis=1)
    return np.where(lost, math.inf, np.exp(np.log(error).mean(axis=(1, 2)))), chattering.mean(axis=1)


def row(name: str, seeds: int) -> tuple[list[str], float | None]:
    """Errors over those without the observer, in noise and with a lasting force as well; the least of those in noise.

    None for a law that refuses the observer.
    """
    law = with_gains(laws()[name], "noise")
    setting = cell(law.classes[0], NOISE, LOW)
    plain = law.scenario(sensed_base(setting))
    noise = plain.disturbance
    pushed = {"disturbance": [noise.model_dump(), {"kind": "step", "amplitude": LASTING}]}
    cells = []
    try:
        scenarios = [
            each.replace({"controller.compensation_bandwidth": bandwidth})
            for each in (plain, plain.replace(pushed))
            for bandwidth in (0.0, *BANDWIDTHS)
        ]
    except fg.ScenarioError:  # it estimates the plant itself
        return [f"`{name}`, {setting.information}", *["refused"] * (2 + 2 * len(BANDWIDTHS))], None
    errors, chattering = found(scenarios, seeds)
    count = 1 + len(BANDWIDTHS)
    cells.append(f"{errors[0]:.3g}")
    cells += [_ratio(errors[i] / errors[0], chattering[i] / chattering[0]) for i in range(1, count)]
    cells.append(f"{errors[count] / errors[0]:.3g}")
    cells += [_ratio(errors[count + i] / errors[0]) for i in range(1, count)]
    return [f"`{name}`, {setting.information}", *cells], float(min(errors[1:count]) / errors[0])


def _ratio(error: float, chattering: float | None = None) -> str:
    if not math.isfinite(error):
        return "diverges"
    return f"{error:.2g}" + ("" if chattering is None else f" ({chattering:.2g})")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="three laws, two seeds; not written")
    quick = parser.parse_args().quick
    names = ["pid", "linear", "lqg"] if quick else sorted(laws())
    heads = ["law", "error, q0", *(f"L = {each:g}" for each in BANDWIDTHS)]
    heads += ["with a lasting force", *(f"and L = {each:g}" for each in BANDWIDTHS)]
    lines = [
        "# A disturbance observer around every law",
        "",
        f"Made with `{command()}`.",
        "",
        f"Machine: {machine()}.",
        "",
        f"The laws of the zoo with its gains, tuned for a chattering of at most {LOW:g} without the observer; {SEEDS} "
        f"seeds, positions with {NOISE:g} m/sqrt(Hz). Errors are geometric means of the steady RMS errors of both "
        "axes. From the third column on they are over the error in the second; in parentheses, the chattering over "
        f"that without the observer. The lasting force is {LASTING[0]:g}, {LASTING[1]:g} m omega0^2 q0. L is "
        "`controller.compensation_bandwidth`.",
        "",
        f"| {' | '.join(heads)} |",
        "|" + "---|" * len(heads),
    ]
    ratios: list[float] = []
    for name in names:
        cells, least = row(name, 2 if quick else SEEDS)
        lines.append(f"| {' | '.join(cells)} |")
        ratios += [] if least is None else [least]
        print(lines[-1], flush=True)
    better = sum(ratio < 1.0 for ratio in ratios)
    lines += [
        "",
        f"Of {len(ratios)} laws that take it, {better} have a smaller error in noise with one of the three L.",
    ]
    write("compensation", lines, keep=not quick)


if __name__ == "__main__":
    main()
