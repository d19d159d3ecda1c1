"""Vibrations and shocks of the frame, of force rebalance and of the joint filter; writes accelerations.md.

    python benchmarks/accelerations.py

The shipped devices at rest with their noise, under an acceleration of which a share drives one mode. A run
without the acceleration and with the same noise is subtracted from the outputs, of the second half of the run.
"""

from __future__ import annotations

import math
from typing import Any

import fracgyro as fg
import numpy as np
from fracgyro.rate.units import DEG_PER_H, DEG_PER_S
from machine import command, machine, write
from volts import REBALANCE

DEPENDS_ON = ["conventional", "sliding_mode", "joint", "benchmarks/volts.py"]

GRAVITY = 9.80665
AVERAGED = 1e-3  # s, of which each output is the mean
JOINT: dict[str, Any] = {"run.record_every": 10}
LAWS = {"force rebalance": {**REBALANCE, "adaptation.initial_rate": 0.0}, "joint": JOINT}
# Device, law, share, axis, entry of the disturbance; frequencies in Hz or, below 2, over that of the x mode.
CASES: list[tuple[str, str, float, str, dict[str, Any]]] = [
    *(
        ("dual_mass", law, share, axis, {"kind": "sine", "frequency": frequency})
        for share, frequency in ((1e-3, 0.97), (1e-3, 0.99), (1.0, 20.0), (1.0, 500.0))
        for axis in "xy"
        for law in LAWS
    ),
    *(
        (device, "joint", share, axis, {"kind": "sine", "frequency": frequency})
        for device in ("tuned_in_air", "disc")
        for share, frequency in ((1e-3, 0.97), (1e-3, 1.001), (1.0, 500.0))
        for axis in "xy"
    ),
    *((device, "joint", share, "x", {"kind": "step"}) for device in ("dual_mass", "disc") for share in (1e-3, 1.0)),
]


def scenario(device: str, law: str) -> fg.Scenario:
    return fg.Scenario.shipped(device).replace({"plant.angular_rate": 0.0, **LAWS[law]})


def measured(base: fg.Scenario, share: float, axis: str, entry: dict[str, Any]) -> dict[str, np.ndarray]:
    """Output, stated deviation and trust in the second half of a run."""
    scales = base.plant.scales
    size = GRAVITY / scales.acceleration
    changes: dict[str, Any] = {"device.acceleration_share": (share, share)}
    own = dict(entry)
    if "frequency" in own:
        at = own["frequency"] * (1.0 if own["frequency"] < 2 else math.tau * scales.time)
        own["frequency"] = (at, at)
    tables = [base.disturbance.model_dump(exclude_unset=True, exclude={"added"})]
    if entry:
        amplitude = (size, 0.0) if axis == "x" else (0.0, size)
        tables.append({"quantity": "acceleration", "amplitude": amplitude, **own})
    run = fg.simulate(base.replace({**changes, "disturbance": tables, "run.units": "nondimensional"}))
    half = run.isel(time=slice(run.sizes["time"] // 2, None))
    names = ("rate_estimate", "rate_deviation", "rate_trusted")
    return {name: half[name].values * (scales.rate if name != names[2] else 1.0) for name in names if name in half}


def row(case: tuple[str, str, float, str, dict[str, Any]]) -> str:
    device, law, share, axis, entry = case
    base = scenario(device, law)
    without, found = measured(base, share, axis, {}), measured(base, share, axis, entry)
    samples = max(round(AVERAGED / (base.run.step * base.run.record_every * base.plant.scales.time)), 1)
    change = found["rate_estimate"] - without["rate_estimate"]
    change = change[: len(change) // samples * samples].reshape(-1, samples).mean(axis=1)
    what = (
        "constant"
        if entry["kind"] == "step"
        else f"{entry['frequency']:g}{' f_x' if entry['frequency'] < 2 else ' Hz'}"
    )
    cells = [device, law, f"{share:g}", axis, what, f"{DEG_PER_S.of(float(change.std())):.3g}"]
    cells.append(f"{DEG_PER_H.of(float(change.mean())):.3g}")
    if "rate_trusted" not in found:
        return f"| {' | '.join([*cells, '–', '–', '–'])} |"
    trusted, deviation = found["rate_trusted"] > 0.5, found["rate_deviation"]
    wrong = trusted & (abs(found["rate_estimate"]) > 4 * deviation)
    share_wrong = 100 * wrong.sum() / trusted.sum() if trusted.any() else 0.0
    cells += [f"{DEG_PER_S.of(float(deviation.mean())):.3g}", f"{100 * trusted.mean():.1f}", f"{share_wrong:.2f}"]
    return f"| {' | '.join(cells)} |"


def main() -> None:
    lines = [
        "# Accelerations of the frame",
        "",
        f"Made by `{command()}`. Machine: {machine()}.",
        "",
        "The shipped devices at rest, with their noise. 1 g acts on one axis, of which the share drives the mode. RMS "
        "and mean are of what it changes, in means over 1 ms in the second half of the run; wrong is an error beyond "
        "four stated deviations. Near the mode the share a acts like a rate of up to a/(2 A ω), 2.3 deg/s for the dual "
        "mass and a thousandth of 1 g.",
        "",
        "| device | law | share | axis | 1 g at | RMS, deg/s | mean, deg/h | stated deviation, deg/s | trusted, % | "
        "wrong while trusted, % |",
        "|---" * 10 + "|",
    ]
    for case in CASES:
        lines.append(row(case))
        print(lines[-1], flush=True)
    write("accelerations", lines)


if __name__ == "__main__":
    main()
