"""Errors of a device in volts, of force rebalance and of two driven axes with the joint filter.

Writes benchmarks/results/volts.md.

Noise-free runs of the dual-mass gyroscope; a row of each run without the effect is subtracted. The combs of the drive
and of the pick-offs are ideal: their gap is a millimeter, so that nothing bends. Not trusted: an effect that is far
above the noise that the joint filter knows makes it refuse samples, and its estimate is of another size; the part of
the samples that it refused and the part in which it trusted its estimate are from the last 30 % of the run.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any

import fracgyro as fg
from fracgyro.scenario.volts_core import at_bias
from machine import command, machine, write

DEPENDS_ON = ["conventional", "sliding_mode", "joint"]

HERTZ = 1 / 3925.0  # over that of the drive
SPLIT = 3978.29 - 3925.0
DRIVE = 3925.0
BASE = fg.Scenario.shipped("dual_mass").replace(
    {"device.position_noise_density": 0.0, "disturbance": {"kind": "none"}, "plant.angular_rate": 0.0}
)
REBALANCE: dict[str, Any] = {
    "controller.kind": "force_rebalance",
    "reference.kind": ["sine", "rest"],
    "controller.pll_bandwidth": 100 * HERTZ,
    "controller.amplitude_bandwidth": 100 * HERTZ,
    "controller.amplitude_integral": 20 * HERTZ,
    "controller.demodulation_bandwidth": 2000 * HERTZ,
    "controller.rebalance_bandwidth": 200 * HERTZ,
    "controller.output_bandwidth": 90 * HERTZ,
    "run.initial_position": [0.0, 0.0],
    "run.record_every": 10,
    "datasheet.lag": 0.0,
}
JOINT: dict[str, Any] = {"run.record_every": 10}
LAWS = {"force rebalance": REBALANCE, "joint": JOINT}
COUPLED = 2 * BASE.plant.mass * BASE.plant.reference_frequency * math.radians(300.0)
QUADRATURE = {"plant.stiffness_deviation": {"xx": 0.0, "xy": COUPLED, "yy": 0.0}}
VOLT, SLOPE, GAIN, GAP = 5.0, 1.17e-6, 4.3e-6, 4e-6  # V, F/m, N/V, m
EPSILON = 8.8541878128e-12


def ideal(role: str) -> list[dict[str, Any]]:
    """Combs with that gain, or that slope of the capacitance, on both axes."""
    wanted = GAIN / VOLT if role == "force" else SLOPE
    own = {"kind": "comb", "count": 1000, "gap": 1e-3, "overlap": 0.0, "bias": VOLT}
    thickness = wanted * own["gap"] / (4 * own["count"] * EPSILON)
    return [{"role": role, "angle": angle, "thickness": thickness, **own} for angle in (0.0, math.pi / 2)]


def plates(role: str, gap: float) -> list[dict[str, Any]]:
    """Pairs of plates with that gain or slope and this gap."""
    wanted = GAIN / VOLT if role == "force" else SLOPE
    area = wanted * gap * gap / (2 * EPSILON)
    return [{"role": role, "angle": angle, "area": area, "gap": gap, "bias": VOLT} for angle in (0.0, math.pi / 2)]


def softened(electrodes: list[dict[str, Any]]) -> dict[str, Any]:
    """The electrodes, with springs that are at bias those of the device."""
    xx, xy, yy = at_bias(BASE.replace({"electrodes": electrodes})).softening.tolist()
    k = BASE.plant.stiffness
    return {"electrodes": electrodes, "plant.stiffness": {"xx": k.xx + xx, "xy": k.xy + xy, "yy": k.yy + yy}}


def output(changes: Mapping[str, Any]) -> float:
    """Mean of the rate over the last whole beats of the split, rad/s."""
    return _output(BASE.replace(dict(changes)))[0]


@cache
def _output(scenario: fg.Scenario) -> tuple[float, float, float]:
    """That mean, and the parts of the last 30 % of the samples that are refused and trusted."""
    run = fg.simulate(scenario)
    rate = run["rate_estimate"].values * BASE.plant.scales.rate
    seconds = float(run["time"].values[-1]) / BASE.plant.reference_frequency
    beats = math.floor(0.3 * seconds * SPLIT)
    last = slice(-round(beats / SPLIT / seconds * (len(rate) - 1)), None)
    parts = (
        float(run[name].values[last].mean()) if name in run else 0.0 for name in ("sample_refused", "rate_trusted")
    )
    return (float(rate[last].mean()), *parts)


def bias(law: str, changes: Mapping[str, Any], without: Mapping[str, Any]) -> float:
    """deg/h that the changes add."""
    return math.degrees(output({**LAWS[law], **changes}) - output({**LAWS[law], **without})) * 3600


def scale(law: str, changes: Mapping[str, Any], without: Mapping[str, Any], per: float, unit: str) -> str:
    """Change of the scale factor at 10 deg/s, in that unit, of which `per` are 1.

    Where the estimate is of another size, the shares of samples that the filter refused and trusted.
    """
    ends = {"plant.angular_rate": math.radians(10.0)}
    found = []
    for each in (changes, without):
        found.append(output({**LAWS[law], **each, **ends}) - output({**LAWS[law], **each}))
    share = found[0] / found[1] - 1
    if abs(share) < 1.0:
        return f"{per * share:,.{1 if unit == 'ppm' else 2}f} {unit}"
    _, refused, trusted = _output(BASE.replace({**LAWS[law], **changes, **ends}))
    return f"not trusted: {100 * refused:.0f} % refused, {100 * trusted:.0f} % trusted"


def angle_row(pole: float) -> list[str]:
    """A pole of the amplifiers, with 300 deg/s of quadrature."""
    closed = 300.0 * 3600 * math.sin(math.atan(DRIVE / pole))
    found = [bias(law, {**QUADRATURE, "electronics.pole": pole}, QUADRATURE) for law in LAWS]
    return [f"pole of {pole / 1e3:g} kHz", f"{closed:,.0f} deg/h", *(f"{each:,.2f} deg/h" for each in found)]


def feedthrough_row(place: int, name: str, closed: str, unit: str) -> list[str]:
    """A femtofarad from one drive to one pick-off."""
    given = softened([*ideal("force"), *ideal("pickoff")])
    farads = [0.0] * 4
    for each in (0, 3) if unit == "ppm" else (place,):
        farads[each] = 1e-15
    through = {**given, "electronics.feedthrough": farads}
    if unit == "ppm":
        return [name, closed, *(scale(law, through, given, 1e6, "ppm") for law in LAWS)]
    return [name, closed, *(f"{bias(law, through, given):,.1f} deg/h" for law in LAWS)]


def gap_row(role: str, share: float, closed: str) -> list[str]:
    """A pair of plates on y, of whose gap the amplitude of y is this share."""
    bent = plates(role, BASE.plant.reference_length / share)[1]
    other = "pickoff" if role == "force" else "force"
    straight = softened([*ideal(role), *ideal(other)])
    given = softened([ideal(role)[0], bent, *ideal(other)])
    found = [scale(law, given, straight, 100.0, "%") for law in LAWS]
    words = "force" if role == "force" else "pick-off"
    return [f"{words} by plates, y/gap = {share:g}", closed, *found]


def rows() -> Iterator[list[str]]:
    for pole in (1e5, 4e5, 1e6, 4e6):
        yield angle_row(pole)
    beta = 1e-15 / (VOLT * SLOPE * GAIN)
    plant = BASE.plant
    amplitude = plant.reference_length
    # u_y of the drive at its resonance: c omega A.
    drives = [
        d * math.sqrt(k / plant.mass) * amplitude
        for d, k in ((plant.damping.xx, plant.stiffness.xx), (plant.damping.yy, plant.stiffness.yy))
    ]
    delta = math.tau * SPLIT
    to_x = math.degrees(0.5 * delta * beta * drives[1] / amplitude) * 3600
    to_y = math.degrees(delta * beta * drives[0] / amplitude) * 3600
    own = 2 * plant.mass * plant.reference_frequency * delta * beta * 1e6
    yield feedthrough_row(1, "1 fF, drive of y to pick-off of x", f"joint {to_x:,.0f} deg/h", "deg/h")
    yield feedthrough_row(2, "1 fF, drive of x to pick-off of y", f"{to_y:,.0f}, joint half deg/h", "deg/h")
    yield feedthrough_row(0, "1 fF, own drive to own pick-off", f"{own:,.0f}, joint half ppm", "ppm")
    for share in (0.12, 0.3):
        yield gap_row("force", share, f"joint {-75 * share**2:.2f} %")
    for share in (0.12, 0.3):
        yield gap_row("pickoff", share, f"joint {-37.5 * share**2:.2f} %")


def main() -> None:
    head = ("effect", "closed form", *LAWS)
    table = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    for row in rows():
        table.append("| " + " | ".join(row) + " |")
        print(table[-1], flush=True)
    about = " ".join((__doc__ or "").split("\n\n")[2].split())
    write("volts", ["# Volts", "", f"`{command()}`, {machine()}", "", about, "", *table])


if __name__ == "__main__":
    main()
