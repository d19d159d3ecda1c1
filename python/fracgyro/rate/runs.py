"""All runs of a characterization: constant rates, sinusoidal rates, a record at rest, wrong couplings."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ..scenario import Scenario
from ..scenario.volts_core import plant_at_bias
from .sensor import Output, Sensor
from .units import DEG_PER_S

Array = NDArray[np.float64]
Progress = Callable[[float, float, str], object]
Value = TypeVar("Value")

RANGE = DEG_PER_S.to_si(300.0)  # input range, +-, of the line fit
WITHIN = np.array([1 / 30, 0.1, 1 / 3, 2 / 3, 1.0]) * RANGE  # 10, 30, 100, 200, 300 deg/s; both signs, and 0
BEYOND = np.array([2.0, 4.0, 8.0, 16.0, 32.0]) * RANGE
RATES = np.concatenate([-WITHIN[::-1], [0.0], WITHIN])
RATES_BEYOND = np.concatenate([-BEYOND[::-1], BEYOND])
SIZES = np.concatenate([WITHIN, BEYOND])  # all constant rates, increasing
SINE = RANGE / 3  # amplitude of the sinusoidal rates
FREQUENCIES = 12  # sinusoidal rates; the lowest has two periods in the steady half
FEW_SEEDS = 2  # runs at rates beyond the range, and at sinusoidal rates
COUPLING = 0.1  # damping deviation that is tried, as a fraction of sqrt(dxx dyy)


@dataclass(frozen=True)
class Runs:
    """Outputs of the sensor, rad/s, in the order of the runs."""

    constant: list[Output]  # at RATES
    beyond: list[Output | None]  # at RATES_BEYOND; None if a run diverges
    within_limits: float  # largest of these rates, rad/s, with either sign within the limits of force and sensors
    frequencies: Array  # Hz
    sinusoidal: list[Output]  # at `frequencies`
    rest: Output
    # With a coupling error of either sign: the rate that causes an equal force, rad/s, and the outputs at rest.
    stiffness: tuple[float, Output, Output]
    damping: tuple[float, Output, Output]


def run_all(sensor: Sensor, *, rest: float | None = None, progress: Progress | None = None) -> Runs:
    """All runs, one after the other.

    `rest`: device time of the static test, s. `progress`: called with (done, total, current measurement). Raises
    ValueError for a `rest` with too few outputs or too many steps, before any run, and for a run that diverges.
    """
    sensor.steps_at_rest(rest)
    few, couplings = sensor.first(FEW_SEEDS), _couplings(sensor.scenario)
    show = progress or (lambda done, total, doing: None)
    total = len(RATES) + len(RATES_BEYOND) + 1 + FREQUENCIES + 1 + 2 * len(couplings)
    done = 0

    def each(doing: str, values: Iterable[Value]) -> Iterator[Value]:
        nonlocal done
        for value in values:
            show(done, total, doing)
            done += 1
            yield value

    constant = [sensor.output(float(rate)) for rate in each("constant rates", RATES)]
    beyond = [_output_or_none(few, float(rate)) for rate in each("full scale", RATES_BEYOND)]
    (within_limits,) = [_within_limits(sensor, sizes) for sizes in each("full scale", [SIZES])]
    frequencies = _frequencies(constant[0])
    sinusoidal = [_sinusoidal(few, float(frequency)) for frequency in each("sinusoidal rates", frequencies)]
    (at_rest,) = [sensor.at_rest(seconds) for seconds in each("record at rest", [rest])]
    signed = [(field, sign * deviation) for field, deviation, _ in couplings for sign in (-1.0, 1.0)]
    coupled = [_coupled(sensor, field, deviation) for field, deviation in each("quadrature", signed)]
    stiffness, damping = [
        (offered, negative, positive)
        for (_, _, offered), negative, positive in zip(couplings, coupled[::2], coupled[1::2], strict=True)
    ]
    show(total, total, "writing")
    return Runs(constant, beyond, within_limits, frequencies, sinusoidal, at_rest, stiffness, damping)


def _output_or_none(sensor: Sensor, rate: float) -> Output | None:
    """Output at a rate beyond the range; None if a run diverges."""
    try:
        return sensor.output(rate)
    except ValueError:
        return None


def _within_limits(sensor: Sensor, sizes: Array) -> float:
    """The largest of these rates, rad/s, at which the device keeps its limits; 0: none of them."""
    kept = (size for size in sizes[::-1] if all(sensor.keeps_its_limits(sign * size) for sign in (1.0, -1.0)))
    return float(next(kept, 0.0))


def _frequencies(output: Output) -> Array:
    """Test frequencies, Hz: from two periods in the steady half to a quarter of the output rate."""
    lowest = 4.0 / output.time[-1]
    return np.geomspace(lowest, 0.25 / output.interval, FREQUENCIES)


def _sinusoidal(sensor: Sensor, frequency: float) -> Output:
    """Output at a sinusoidal rate; frequency in Hz."""
    rate = {"rate.kind": "sine", "rate.amplitude": SINE, "rate.frequency": 2 * math.pi * frequency}
    return sensor.output(0.0, changes=rate)


def _coupled(sensor: Sensor, field: str, deviation: float) -> Output:
    """Output at rest with this deviation of a coupling, in SI."""
    return sensor.output(0.0, changes={field: {"xx": 0.0, "xy": deviation, "yy": 0.0}})


def _couplings(scenario: Scenario) -> list[tuple[str, float, float]]:
    """Field, deviation in SI, and the rate that causes an equal force: k/(2 m omega), c/(2 m).

    The stiffness deviation makes the quadrature force as large as the Coriolis force at the end of the range.
    """
    plant = plant_at_bias(scenario)
    omega = math.sqrt(plant.stiffness.xx / plant.mass)
    stiffness = 2 * plant.mass * omega * RANGE
    damping = COUPLING * math.sqrt(plant.damping.xx * plant.damping.yy)
    return [
        ("plant.stiffness_deviation", stiffness, RANGE),
        ("plant.damping_deviation", damping, damping / (2 * plant.mass)),
    ]
