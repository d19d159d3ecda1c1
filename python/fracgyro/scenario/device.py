"""The tables [rate] and [device] of a scenario: a rate that moves, and what a real device adds. All off by default."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping
from itertools import pairwise
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import BeforeValidator, Field, WithJsonSchema, model_validator
from pydantic_core import PydanticCustomError

from ..files import read_input, reason
from .table import MAX_STEPS, NonNegative, Table, as_tuple, field, sentence, toml_value

MAX_POINTS = 100_000
Points = tuple[tuple[float, float], ...]


def _points(value: Any) -> Points | None:
    """Rising times and their values."""
    if value is None:
        return None
    rule = f"it must be a list of 1 to {MAX_POINTS} pairs [time, value] of finite numbers whose times rise"
    problem = PydanticCustomError("rule", "{rule}", {"rule": rule})
    if not isinstance(value, list | tuple) or not 1 <= len(value) <= MAX_POINTS:
        raise problem
    for pair in value:
        if not isinstance(pair, list | tuple) or len(pair) != 2:
            raise problem
        for number in pair:
            if isinstance(number, bool) or not isinstance(number, int | float) or not math.isfinite(number):
                raise problem
    if any(not after[0] > before[0] for before, after in pairwise(value)):
        raise problem
    return tuple((float(time), float(number)) for time, number in value)


PAIR = {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2}
OptionalPoints = Annotated[
    Points | None,
    BeforeValidator(_points),
    WithJsonSchema({"type": "array", "items": PAIR, "minItems": 1, "maxItems": MAX_POINTS}),
]
ForEachAxis = Annotated[tuple[float, float], as_tuple("x y", expand=True)]
Reach = Annotated[float, Field(gt=0, allow_inf_nan=True)]
Range = Annotated[tuple[Reach, Reach], as_tuple("x y", expand=True)]
Share = Annotated[float, Field(gt=-1)]
GainError = Annotated[tuple[Share, Share], as_tuple("x y", expand=True)]


def _read_file(values: Any, table: str, field: str, points: str, column: str) -> Any:
    """The table with the points that its file holds in place of the file: a scenario depends on nothing outside it."""
    if not isinstance(values, Mapping) or not isinstance(values.get(field), str):
        return values
    if values.get(points) is not None:
        raise sentence(f"{table}.{field} and {table}.{points} are both given: at most one of the two can be")
    read = read_points(values[field], f"{table}.{field}", column)
    return {**values, field: None, points: read}


def read_points(path: str, name: str, column: str) -> list[list[float]]:
    """Rows of a CSV file whose header is `time,<column>`. Raises, in one sentence, when it is not one.

    The sentence shows nothing of the file: a scenario from elsewhere may name any.
    """
    place = f"{name} is {toml_value(path)}"
    try:
        text = io.StringIO(read_input(path).decode("utf-8-sig"), newline="")
        header, *rows = [[cell.strip() for cell in row] for row in csv.reader(text) if row] or [[]]
    except UnicodeDecodeError:
        raise sentence(f"{place}: it cannot be read: it is not UTF-8") from None
    except OSError as error:
        raise sentence(f"{place}: it cannot be read: {reason(error)}") from None
    except (ValueError, csv.Error) as error:
        raise sentence(f"{place}: it cannot be read: {error}") from None
    if header != ["time", column]:
        raise sentence(f"{place}: its first line must be 'time,{column}'")
    found: list[list[float]] = []
    for line, row in enumerate(rows, start=2):
        try:
            time, number = map(float, row)
            if not (math.isfinite(time) and math.isfinite(number)):
                raise ValueError
        except ValueError:
            raise sentence(f"{place}: row {line} must be two finite numbers") from None
        if found and not time > found[-1][0]:
            raise sentence(f"{place}: row {line}: times must rise from row to row")
        found.append([time, number])
    return found


class Rate(Table):
    """The angular rate over time. In SI units."""

    kind: Literal["constant", "step", "staircase", "sine", "chirp", "noise", "table"] = field(
        "constant",
        "plant.angular_rate, plus: a step or a staircase up; sine; chirp, a sine whose frequency rises linearly until "
        "the end of the run; Gaussian noise with a flat spectrum up to frequency. table: only points. constant: off.",
    )
    amplitude: float = field(
        0.0,
        "rad/s: height of the step or of each level, peak of sine and chirp, standard deviation of the noise.",
        unit="rad/s",
    )
    start: NonNegative = field(0.0, "s, whole steps: until then the rate is plant.angular_rate. 0.0: off.", unit="s")
    hold: float | None = field(None, "s, whole steps: time on each level of the staircase.", gt=0, unit="s")
    levels: int = field(1, "How many levels the staircase climbs; it stays on the last one.", ge=1, le=MAX_STEPS)
    frequency: NonNegative = field(
        0.0,
        "rad/s: of the sine, where the chirp begins, where the band of the noise ends. At most pi over the step.",
        unit="rad/s",
    )
    final_frequency: NonNegative = field(0.0, "rad/s: where the chirp ends. At most pi over the step.", unit="rad/s")
    seed: int = field(0, "Of the noise: same seed, same rate; 0 to 2^63 - 1.", ge=0, le=2**63 - 1)
    file: str | None = field(
        None,
        "A CSV file with the header time,rate, in s and rad/s, next to the scenario: read at once and kept as points.",
    )
    points: OptionalPoints = field(
        None,
        "Of the table: [[time in s, rate in rad/s], ...], linear in between and constant beyond the ends. This is the "
        "rate itself: plant.angular_rate is then only what the estimate starts from.",
        unit="s, rad/s",
    )

    @model_validator(mode="before")
    @classmethod
    def _file(cls, values: Any) -> Any:
        return _read_file(values, "rate", "file", "points", "rate")

    @model_validator(mode="after")
    def _check(self) -> Self:
        if (self.kind == "table") != (self.points is not None):
            given = "missing" if self.points is None else "given"
            raise sentence(
                f"rate.kind is {toml_value(self.kind)} and rate.points is {given}: a table, and nothing else, "
                "must have points, or a file of them"
            )
        if self.kind == "staircase" and self.hold is None:
            raise sentence("rate.hold is missing: a staircase must have a time on each level")
        if self.kind != "staircase" and self.hold is not None:
            raise sentence(
                f"rate.hold is {toml_value(self.hold)}: it must be left out when rate.kind is {toml_value(self.kind)}, "
                "as only a staircase has a time on each level"
            )
        if self.kind in ("sine", "noise") and self.frequency == 0:
            raise sentence(
                f"rate.frequency is 0.0: it must be greater than 0 when rate.kind is {toml_value(self.kind)}"
            )
        return self


class Device(Table):
    """What the device is not ideal in. In SI units."""

    sensing: Literal["full", "position"] = field(
        "full",
        "What is measured: position and velocity, or only the position, from which an observer of bandwidth "
        "controller.observer_bandwidth finds the velocity. full: off.",
    )
    position_noise: NonNegative = field(
        0.0, "m: standard deviation of the measured position, drawn again for every sample. 0.0: off.", unit="m"
    )
    position_noise_density: NonNegative = field(
        0.0,
        "m/sqrt(Hz), one-sided: instead, white noise up to half the sampling frequency. 0.0: off.",
        unit="m/sqrt(Hz)",
    )
    position_noise_corner: NonNegative = field(
        0.0,
        "Hz, at most half the sampling frequency: adds flicker noise, whose density goes as 1/f and equals that of the "
        "white noise at this frequency. 0.0: off.",
        unit="Hz",
    )
    velocity_noise: NonNegative = field(0.0, "m/s: of the measured velocity. 0.0: off.", unit="m/s")
    velocity_noise_density: NonNegative = field(
        0.0, "(m/s)/sqrt(Hz), one-sided: instead. 0.0: off.", unit="(m/s)/sqrt(Hz)"
    )
    velocity_noise_corner: NonNegative = field(0.0, "Hz: as position_noise_corner. 0.0: off.", unit="Hz")
    pickoff_gain_error: GainError = field(
        (0.0, 0.0),
        "[x, y], > -1: position and velocity are measured 1 plus this times as large as they are. Zeros: off.",
    )
    pickoff_misalignment: float = field(
        0.0, "rad: angle from the axes of [plant] to those of the pick-offs, from x towards y. 0.0: off.", unit="rad"
    )
    position_range: Range = field(
        (math.inf, math.inf),
        "m, > 0, [x, y]: the measured position clips at plus and minus this. inf: off.",
        unit="m",
    )
    position_bits: int = field(
        0, "Bits of the converter: it has 2^bits levels over the range, at most 32 bits. 0: off.", ge=0, le=32
    )
    velocity_range: Range = field(
        (math.inf, math.inf),
        "m/s, > 0, [x, y]: the measured velocity clips at plus and minus this. inf: off.",
        unit="m/s",
    )
    velocity_bits: int = field(0, "As position_bits. 0: off.", ge=0, le=32)
    actuator_limit: float = field(
        math.inf,
        "N, > 0: largest force of the actuator per axis; the controller does not know of it, as it does of "
        "controller.force_limit. inf: off.",
        gt=0,
        allow_inf_nan=True,
        unit="N",
    )
    actuator_bits: int = field(0, "Of the force's converter, over plus and minus the limit. 0: off.", ge=0, le=32)
    force_gain_error: GainError = field(
        (0.0, 0.0),
        "[x, y], > -1: the force that acts is 1 plus this times that of the actuator's converter. Zeros: off.",
    )
    force_misalignment: float = field(
        0.0, "rad: angle from the axes of [plant] to those of the actuators, from x towards y. 0.0: off.", unit="rad"
    )
    delay: int = field(
        0,
        "Steps between a measurement and the force that answers it, beyond none, at most 1000. 0: off.",
        ge=0,
        le=1000,
        unit="h",
    )
    cubic_stiffness: ForEachAxis = field(
        (0.0, 0.0),
        "kappa [x, y], N/m^3: each spring pulls with kappa q^3 more; negative softens. Zeros: off.",
        unit="N/m^3",
    )
    stiffness_drift: float = field(
        0.0,
        "ppm/K: of K and Delta K, by the temperature below. It is twice the temperature coefficient of the frequency "
        "(TCF) in a data sheet. 0.0: off.",
        unit="ppm/K",
    )
    damping_drift: float = field(
        0.0,
        "ppm/K: of D and Delta D, by the same. A quality factor that goes as T^-g is 1e6 g/300 at 300 K: 1700 to 10000 "
        "for g from 0.5 to 3. 0.0: off.",
        unit="ppm/K",
    )
    temperature_ramp: float = field(0.0, "K/s: the temperature rises at this rate from t = 0 on. 0.0: off.", unit="K/s")
    temperature_file: str | None = field(
        None, "Instead: a CSV file with the header time,temperature, in s and K, read at once and kept as points."
    )
    temperature_points: OptionalPoints = field(
        None,
        "[[time in s, change of temperature in K], ...], linear in between and constant beyond the ends.",
        unit="s, K",
    )
    bias_instability: NonNegative = field(
        0.0,
        "B of IEEE Std 952, rad/s; 1 deg/h is 4.848e-6. Error torques that act as flicker noise of the rate would, but "
        "are not part of the true rate; their Allan deviation is 0.664 B. 0.0: off.",
        unit="rad/s",
    )
    rate_random_walk: NonNegative = field(
        0.0,
        "K of IEEE Std 952, rad/s/sqrt(s); 1 deg/h/sqrt(h) is 8.080e-8. The same of a random walk of the rate that "
        "starts at 0; its Allan deviation is K sqrt(tau/3). 0.0: off.",
        unit="rad/s/sqrt(s)",
    )

    @model_validator(mode="before")
    @classmethod
    def _file(cls, values: Any) -> Any:
        return _read_file(values, "device", "temperature_file", "temperature_points", "temperature")

    @model_validator(mode="after")
    def _check(self) -> Self:
        for quantity, limit in {"position": "range", "velocity": "range", "actuator": "limit"}.items():
            bits, span = getattr(self, f"{quantity}_bits"), getattr(self, f"{quantity}_{limit}")
            if bits and not np.isfinite(span).all():
                raise sentence(
                    f"device.{quantity}_bits is {bits} and device.{quantity}_{limit} is {toml_value(span)}: "
                    "a converter must have a finite range"
                )
        for quantity in ("position", "velocity"):
            noise, density = getattr(self, f"{quantity}_noise"), getattr(self, f"{quantity}_noise_density")
            if noise and density:
                raise sentence(
                    f"device.{quantity}_noise is {noise} and device.{quantity}_noise_density is {density}: "
                    "at most one of the two can be given"
                )
            corner = getattr(self, f"{quantity}_noise_corner")
            if corner and not (noise or density):
                raise sentence(
                    f"device.{quantity}_noise_corner is {corner} without white noise: device.{quantity}_noise "
                    f"or device.{quantity}_noise_density must be greater than 0"
                )
        if self.temperature_ramp and self.temperature_points is not None:
            raise sentence(
                f"device.temperature_ramp is {self.temperature_ramp} and device.temperature_points is given: "
                "at most one of the two can be"
            )
        return self

    def temperature(self, end: float) -> Points:
        """Change of temperature, K, at times in s; `end`: that of the run."""
        if self.temperature_points is not None:
            return self.temperature_points
        return ((0.0, 0.0), (end, self.temperature_ramp * end))
