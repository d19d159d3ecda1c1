"""Procedures of IEEE Std 1431, part II, beyond those of `runs.py`: their rows and all their points.

A procedure whose effect the scenario lacks gives a row with a note, never a zero.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from ..analysis.confidence import Mean, mean_interval
from ..scenario import Scenario
from ..scenario.volts_core import plant_at_bias
from ..simulation.simulate import simulate
from .runs import RANGE, RATES, Runs
from .sensor import Output, Sensor
from .units import DEG_PER_H, DEG_PER_S, PPM, Unit

Array = NDArray[np.float64]

MISSING = "not in the scenario"
CYCLES, FEW_CYCLES = 16, 6  # power cycles
FREE_RATE = DEG_PER_S.to_si(100.0)  # at which an undriven pattern turns
MAX_SPLIT = 0.25  # split over that rate, up to which the pattern turns
FREE_TIMES = 1.0  # length of the undriven run, in ring-down times
FREE_SAMPLES = 4_000
PER_PERIOD = 8  # least samples of it in a period


@dataclass(frozen=True)
class Row:
    """One row of the datasheet: numbers in `unit`, NaN with a reason in `note` if there is none.

    >>> fg.rate.Row("12.7", "polarity", "Polarity", "rates about z", "1", 1.0).plain()["clause"]
    '12.7'
    """

    clause: str  #: number of a clause of IEEE Std 1431
    key: str
    name: str
    varied: str  #: quantities that were varied, or applied
    unit: str
    value: float = math.nan
    low: float = math.nan  #: end of the 95 % interval
    high: float = math.nan
    note: str = ""

    def plain(self) -> dict[str, Any]:
        """The row as JSON; null for numbers that are not finite."""
        numbers = {name: getattr(self, name) for name in ("value", "low", "high")}
        finite = {name: number if math.isfinite(number) else None for name, number in numbers.items()}
        words = {name: getattr(self, name) for name in ("clause", "key", "name", "varied", "unit")}
        return {**words, **finite, "note": self.note}


@dataclass(frozen=True)
class Point:
    """One measured point: the output, or another quantity, of one run at one value of what was varied."""

    clause: str
    procedure: str
    varied: str  # name and unit
    at: float
    run: int
    measured: str  # name and unit
    value: float


@dataclass
class Sheet:
    """Rows and points, in the order in which they were found."""

    rows: list[Row] = field(default_factory=list)
    points: list[Point] = field(default_factory=list)

    def missing(self, clause: str, key: str, name: str, varied: str, unit: str, why: str = "") -> None:
        self.rows.append(Row(clause, key, name, varied, unit, note=f"{MISSING}{f': {why}' if why else ''}"))

    def mean(self, clause: str, key: str, name: str, varied: str, unit: Unit, values: Mean, note: str = "") -> None:
        value, low, high = (unit.of(number) for number in values)
        if low <= 0.0 <= high:
            note = note or "not observed: its interval includes 0"
        self.rows.append(Row(clause, key, name, varied, unit.name, value, low, high, note))

    def outputs(self, clause: str, procedure: str, varied: str, at: float, means: Array) -> None:
        for run, value in enumerate(means):
            self.points.append(Point(clause, procedure, varied, at, run, "output (deg/s)", DEG_PER_S.of(float(value))))


def mean_of(output: Output) -> Array:
    """Mean steady output of each run, rad/s: (runs,)."""
    return np.asarray(output.settled().rate.mean(axis=1), dtype=float)


# -- From the runs of `fracgyro rate` ----------------------------------------------------------------------------------


def of_rates(sheet: Sheet, runs: Runs) -> None:
    """Clauses 12.7 and 12.9: polarity and asymmetry, from the outputs at constant rates."""
    outputs = np.array([mean_of(output) for output in runs.constant])
    for rate, means in zip(RATES, outputs, strict=True):
        sheet.outputs("12.9", "constant rates", "rate about z (deg/s)", DEG_PER_S.of(float(rate)), means)
    signs = polarity(outputs)
    sheet.rows.append(
        Row(
            "12.7",
            "polarity",
            "Polarity",
            "rates about z from −300 to 300 deg/s",
            "1",
            signs,
            note="" if signs else "not observed: the outputs at ±300 deg/s do not differ in every run",
        )
    )
    words = "scale factor at positive less that at negative rates, over their mean; rates from 10 to 300 deg/s"
    sheet.mean("12.9", "asymmetry", "Scale factor asymmetry", words, PPM, mean_interval(asymmetry(outputs)))


def polarity(outputs: Array) -> float:
    """1 if a positive rate raises the output in every run, -1 if it lowers it, 0 otherwise; (rates, runs)."""
    change = outputs[-1] - outputs[0]
    return float(np.sign(change[0])) if (np.sign(change) == np.sign(change[0])).all() else 0.0


def asymmetry(outputs: Array) -> Array:
    """Slope at positive rates less that at negative ones over their mean, of each run; `outputs` (rates, runs)."""
    middle = len(RATES) // 2
    slopes = [np.polyfit(RATES[part], outputs[part], 1)[0] for part in (slice(middle, None), slice(0, middle + 1))]
    return np.asarray(2 * (slopes[0] - slopes[1]) / (slopes[0] + slopes[1]))


# -- Runs of their own -------------------------------------------------------------------------------------------------


def power_cycles(sheet: Sheet, sensor: Sensor, cycles: int) -> None:
    """Clause 12.11: the zero-rate output of runs that start at random phases, each with its own noise."""
    generator = np.random.default_rng(sensor.scenario.disturbance.seed)
    found, varied = [], "start phase (deg)"
    for cycle, phase in enumerate(generator.uniform(0.0, math.tau, cycles)):
        own = replace(sensor, seeds=range(sensor.seeds[0] + cycle, sensor.seeds[0] + cycle + 1))
        (mean,) = mean_of(own.output(0.0, changes=turned(sensor.scenario, float(phase))))
        value = DEG_PER_S.of(float(mean))
        sheet.points.append(Point("12.11", "power cycles", varied, math.degrees(phase), cycle, "output (deg/s)", value))
        found.append(mean)
    deviation = float(np.std(found, ddof=1))
    spread = [math.sqrt((cycles - 1) / chi2.ppf(share, cycles - 1)) * deviation for share in (0.975, 0.025)]
    sheet.mean(
        "12.11",
        "repeatability",
        "Repeatability of the zero-rate output",
        f"{cycles} power cycles: noise and the phase at the start; standard deviation of the means of steady halves",
        DEG_PER_H,
        Mean(deviation, *spread),
    )


def turned(scenario: Scenario, phase: float) -> dict[str, object]:
    """Changes with which motion and reference start `phase` rad later; the reference's other kinds do not turn."""
    run, reference = scenario.run, scenario.reference
    k = plant_at_bias(scenario).stiffness.entries()
    own = [math.sqrt(k[i] / scenario.plant.mass) * scenario.plant.scales.time for i in (0, 2)]
    kinds = reference.kinds
    position, velocity, phases = [], [], []
    for i in (0, 1):
        frequency = reference.frequency[i] if kinds[i] == "sine" else own[i]
        q, v = run.initial_position[i], run.initial_velocity[i] / frequency
        position.append(q * math.cos(phase) + v * math.sin(phase))
        velocity.append((v * math.cos(phase) - q * math.sin(phase)) * frequency)
        phases.append(reference.phase[i] + (phase if kinds[i] == "sine" else 0.0))
    return {
        "run.initial_position": tuple(position),
        "run.initial_velocity": tuple(velocity),
        "reference.phase": tuple(phases),
    }


def axes(sheet: Sheet, sensor: Sensor) -> None:
    """Clause 12.12: rates about x and y."""
    names = (("x", (1.0, 0.0)), ("y", (0.0, 1.0)), ("x and y at once", (1.0, 1.0)))
    for name, rates in names:
        varied = f"a rate of 300 deg/s about {name}"
        key, title = (
            f"rate_about_{name.partition(' ')[0] if sum(rates) < 2 else 'both'}",
            f"Output by rates about {name}",
        )
        if not sensor.scenario.plant.centrifugal:
            sheet.missing("12.12", key, title, varied, "deg/h", "plant.centrifugal is false, eq. (2)")
            continue
        across = tuple(RANGE * each for each in rates)
        still = mean_of(sensor.output(0.0, changes={"plant.transverse_rate": (0.0, 0.0)}))
        moved = mean_of(sensor.output(0.0, changes={"plant.transverse_rate": across}))
        sheet.outputs("12.12", "axis alignment", f"rate about {name} (deg/s)", 0.0, still)
        sheet.outputs("12.12", "axis alignment", f"rate about {name} (deg/s)", 300.0, moved)
        sheet.mean("12.12", key, title, varied, DEG_PER_H, mean_interval(moved - still))


def undriven(sheet: Sheet, scenario: Scenario) -> None:
    """Clauses 12.13 and 12.14: the vibration after its forces are turned off, and the angle that it then keeps."""
    plant = plant_at_bias(scenario)
    omega = [math.sqrt(k / plant.mass) for k in (plant.stiffness.xx, plant.stiffness.yy)]
    time, energy, _ = ring_down(scenario, 0.0)
    for at, value in zip(time[:: len(time) // 50 + 1], energy[:: len(time) // 50 + 1], strict=True):
        share = float(value / energy[0])
        sheet.points.append(Point("12.14", "run-down", "time (s)", float(at), 0, "energy of x over that at 0", share))
    seconds = run_down_time(time, energy)
    sheet.rows.append(
        Row(
            "12.14",
            "run_down_time",
            "Run-down time",
            "no forces but the thermal one: time in which the amplitude of x falls to 1/e",
            "s",
            seconds,
            note=f"Q of x is {0.5 * omega[0] * seconds:.4g}" if seconds > 0 else "not observed: no decay",
        )
    )
    varied = "no forces, 100 deg/s about z: angle that the line of vibration turns, over that of the case"
    split = abs(omega[1] - omega[0])
    if split > MAX_SPLIT * FREE_RATE:
        why = f"a split of {split / math.tau:.3g} Hz holds the line of vibration"
        sheet.missing("12.13", "angle_gain", "Angle gain", varied, "1", why)
        return
    time, _, angle = ring_down(scenario, FREE_RATE)
    for at, value in zip(time[:: len(time) // 50 + 1], angle[:: len(time) // 50 + 1], strict=True):
        words = "angle of the line (deg)"
        sheet.points.append(Point("12.13", "angle storage", "time (s)", float(at), 0, words, math.degrees(value)))
    gain = -float(np.polyfit(time, angle, 1)[0]) / FREE_RATE
    sheet.rows.append(Row("12.13", "angle_gain", "Angle gain", varied, "1", gain))


def ring_down(scenario: Scenario, rate: float) -> tuple[Array, Array, Array]:
    """Times, s, energy of x and angle of the line of vibration, rad, of a run without forces that starts along x.

    Energy in the units of the run; `rate` about z in rad/s.
    """
    plant, run, scales = plant_at_bias(scenario), scenario.run, scenario.plant.scales
    k = [each / plant.mass * scales.time**2 for each in (plant.stiffness.xx, plant.stiffness.yy)]
    ring = 2 * plant.mass / plant.damping.xx / scales.time if plant.damping.xx > 0 else math.inf
    steps = max(min(round(FREE_TIMES * ring / run.step), run.steps), 200)
    every = max(1, min(steps // FREE_SAMPLES, int(math.tau / math.sqrt(k[0]) / PER_PERIOD / run.step)))
    changes = {
        "plant.angular_rate": rate,
        "rate": {"kind": "constant"},
        "run.duration": steps * run.step,
        "run.record_every": every,
        "run.units": "nondimensional",
        "run.initial_position": (0.0, 0.0),
        "run.initial_velocity": (math.sqrt(k[0]) * float(scenario.reference.amplitude[0]), 0.0),
    }
    found = simulate(scenario.replace(changes), _no_force)
    (x, y), (vx, vy) = found["position"].values.T, found["velocity"].values.T
    vx, vy = vx / math.sqrt(k[0]), vy / math.sqrt(k[1])
    whole = max(1, round(math.tau / math.sqrt(k[0]) / (every * run.step)))
    squares, product = _smooth(x * x + vx * vx - y * y - vy * vy, whole), _smooth(2 * (x * y + vx * vy), whole)
    time = _smooth(found["time"].values * scales.time, whole)
    return time, _smooth(x * x + vx * vx, whole), np.asarray(np.unwrap(np.arctan2(product, squares)) / 2)


def _no_force(_: Any) -> tuple[float, float]:
    return 0.0, 0.0


def _smooth(values: Array, samples: int) -> Array:
    """Mean over this many samples: a period."""
    return np.asarray(np.convolve(values, np.full(samples, 1 / samples), "valid"))


def run_down_time(time: Array, energy: Array) -> float:
    """Time, s, in which the amplitude falls to 1/e, from the energy: least squares of its logarithm."""
    slope = float(np.polyfit(time, np.log(energy), 1)[0])
    return -2 / slope if slope < 0 else math.nan


def clauses(rows: Sequence[Row]) -> list[Row]:
    """The rows in the order of the standard; those of a clause as found."""

    def place(row: Row) -> list[int]:
        return [int(part) for part in row.clause.split(".")]

    return sorted(rows, key=place)


OF_RATE: Mapping[str, tuple[str, str]] = {  # clause, and quantities varied, of a figure of `fracgyro rate`
    "turn_on_time": ("12.5", "start at 300 deg/s from an estimate of 0"),
    "scale_factor_error": ("12.9", "rates about z from −300 to 300 deg/s"),
    "nonlinearity": ("12.9", "rates about z from −300 to 300 deg/s"),
    "full_scale": ("12.10", "rates about z, doubled from 300 to 9,600 deg/s"),
    "zero_rate_output": ("12.11", "none: at rest"),
    "zero_rate_rms": ("12.11", "none: at rest"),
    "angle_random_walk": ("12.11", "averaging time, at rest"),
    "bias_instability": ("12.11", "averaging time, at rest"),
    "rate_random_walk": ("12.11", "averaging time, at rest"),
    "quantization": ("12.11", "averaging time, at rest"),
    "quadrature_residual": ("12.11", "stiffness deviation kxy, both signs"),
    "damping_residual": ("12.11", "damping deviation dxy, both signs"),
    "bandwidth": ("12.15", "frequency of a rate of 100 deg/s about z"),
    "phase_lag": ("12.15", "frequency of a rate of 100 deg/s about z"),
}
