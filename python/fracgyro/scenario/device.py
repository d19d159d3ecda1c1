"""The tables [rate] and [device] of a scenario: a dynamic rate, and imperfections. All off by default."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, create_model, model_validator

from .kinds import si_table_fields
from .points import OptionalPoints, OptionalTriples, Points
from .table import NonNegative, Pair, Table, as_tuple, field, message_error, of_other_kinds, toml_value

Array = NDArray[np.float64]
_Above0 = Annotated[float, Field(gt=0)]
_Limit = Annotated[float, Field(gt=0, allow_inf_nan=True)]
# Drifts with the temperature, in ppm/K, in addition to the common ones of stiffness and damping.
MATRIX_DRIFTS = ("spring_drift", "quadrature_drift", "damper_drift", "damping_axis_drift")
GAIN_DRIFTS = ("pickoff_gain_drift", "force_gain_drift")
CUBIC = ("cubic_stiffness", "cubic_coupling", "cubic_skew")  # forces that grow with the cube of the motion

if TYPE_CHECKING:

    class _OfCore(Table):
        """Fields that the core lists (kinds.py)."""

        def __init__(self, **fields: Any) -> None: ...

        def __getattr__(self, name: str) -> Any: ...

    class _Rate(_OfCore): ...

    class _Device(_OfCore): ...

else:
    START = field(0.0, "s, whole steps: until then the rate is plant.angular_rate. 0.0: off.", unit="s")
    HOLD = field(None, "s, whole steps: time on each level of the staircase.", gt=0, unit="s")
    _Rate = create_model(
        "_Rate",
        __base__=Table,
        kind=(
            Literal["constant", "step", "staircase", "sine", "chirp", "noise", "table"],
            field(
                "constant",
                "plant.angular_rate, plus: a step or a staircase up; sine; chirp, a sine whose frequency rises "
                "linearly until the end of the run; Gaussian noise with a flat spectrum up to frequency. table: only "
                "points. constant: off.",
            ),
        ),
        **si_table_fields(
            "rate",
            instead={"start_steps": {"start": (NonNegative, START)}, "hold_steps": {"hold": (float | None, HOLD)}},
            unset=("amplitude",),
        ),
    )
    DENSITY = "one-sided: instead, white noise up to half the sampling frequency. 0.0: off."
    CORNER = (
        "Hz, at most half the sampling frequency: adds flicker noise, whose density goes as 1/f and equals that of the "
        "white noise at this frequency. 0.0: off."
    )
    WALK = (
        "rad/s/sqrt(s): K of IEEE Std 952; 1 deg/h/sqrt(h) is 8.080e-8. The same of a random walk of the rate that "
        "starts at 0; its Allan deviation is K sqrt(tau/3). 0.0: off."
    )

    def _white(name, unit):
        return {
            f"{name}_noise_density": (NonNegative, field(0.0, f"{unit}, {DENSITY}", unit=unit)),
            f"{name}_noise_corner": (NonNegative, field(0.0, CORNER, unit="Hz")),
        }

    _Device = create_model(
        "_Device",
        __base__=Table,
        sensing=(
            Literal["full", "position"],
            field(
                "full",
                "Measured quantities: position and velocity, or only the position, from which an observer of bandwidth "
                "controller.observer_bandwidth finds the velocity. full: off.",
            ),
        ),
        **si_table_fields(
            "device",
            instead={
                "position_flicker": _white("position", "m/sqrt(Hz)"),
                "velocity_flicker": _white("velocity", "(m/s)/sqrt(Hz)"),
                "rate_walk_step": {"rate_random_walk": (NonNegative, field(0.0, WALK, unit="rad/s/sqrt(s)"))},
            },
        ),
    )


class Rate(_Rate):
    """The angular rate over time. In SI units."""

    file: str | None = field(
        None,
        "A CSV file with the header time,rate, in s and rad/s, next to the scenario: read at once and kept as points.",
    )
    points: OptionalPoints = field(
        None,
        "Points of the table: [[time in s, rate in rad/s], ...], linear in between and constant beyond the ends. This "
        "is the rate itself: plant.angular_rate is then only what the estimate starts from.",
        unit="s, rad/s",
    )
    transverse_points: OptionalTriples = field(
        None,
        "[[time in s, Omega_x, Omega_y in rad/s], ...]: the rates about x and y, linear in between and constant beyond "
        "the ends, instead of plant.transverse_rate. They need plant.centrifugal. Not set: off.",
        unit="s, rad/s",
    )

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.kind == "table" and self.points is None:
            raise message_error("rate.points is missing: a table must have points, or a file of them")
        for name in ("points", "file"):
            if self.kind != "table" and (value := getattr(self, name)) is not None:
                raise of_other_kinds(f"rate.{name}", value, ("table",), self.kind)
        if self.kind not in ("constant", "table") and self.amplitude is None:
            raise message_error(f"rate.amplitude is missing: rate.kind {self.kind} must have one; 0.0 is allowed")
        if self.kind == "staircase" and self.hold is None:
            raise message_error("rate.hold is missing: a staircase must have a time on each level")
        if self.kind != "staircase" and self.hold is not None:
            raise of_other_kinds("rate.hold", self.hold, ("staircase",), self.kind)
        if self.kind in ("sine", "noise") and self.frequency == 0:
            raise message_error(
                f"rate.frequency is 0.0: it must be greater than 0 when rate.kind is {toml_value(self.kind)}"
            )
        return self


class Device(_Device):
    """Sensor and actuator imperfections. In SI units."""

    frequency_temperature_coefficient: float = field(
        0.0,
        "ppm/K: TCF of a data sheet, the drift of both resonance frequencies. Instead of stiffness_drift, which is "
        "twice as large. 0.0: off.",
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
    warm_up_rise: float = field(
        0.0,
        "K: the device also warms by this much after power on, at t = 0; approached exponentially. 0.0: off.",
        unit="K",
    )
    warm_up_time: float = field(60.0, "s: time constant of the warm-up.", gt=0, unit="s")
    acceleration_share: Pair | None = field(
        None,
        "[x, y]: how much of an acceleration of the frame drives each mode, by which entries of [disturbance] with "
        "quantity acceleration are multiplied. A single mass: ones; balanced masses: their imbalance. Not set: off, "
        "ones.",
        unit="1",
    )
    common_mode_frequency: Annotated[tuple[_Limit, _Limit], as_tuple("x y")] = field(
        (math.inf, math.inf),
        "[x, y], Hz, > 0: resonance at which an acceleration of the frame moves all masses alike, which shifts the "
        "gaps of [[electrodes]]. inf: off.",
        unit="Hz",
    )
    common_mode_quality: Annotated[tuple[_Above0, _Above0], as_tuple("x y")] = field(
        (10.0, 10.0), "[x, y]: quality factors of these resonances, > 0."
    )
    hysteresis: NonNegative = field(
        0.0,
        "K: what drifts with temperature follows it only beyond this much of backlash, to either side. 0.0: off.",
        unit="K",
    )

    @model_validator(mode="after")
    def _check(self) -> Self:
        for quantity, limit in {"position": "range", "velocity": "range", "actuator": "limit"}.items():
            bits, span = getattr(self, f"{quantity}_bits"), getattr(self, f"{quantity}_{limit}")
            if bits and not np.isfinite(span).all():
                raise message_error(
                    f"device.{quantity}_bits is {bits} and device.{quantity}_{limit} is {toml_value(span)}: "
                    "a converter must have a finite range"
                )
        for quantity in ("position", "velocity"):
            noise, density = getattr(self, f"{quantity}_noise"), getattr(self, f"{quantity}_noise_density")
            if noise and density:
                raise message_error(
                    f"device.{quantity}_noise is {toml_value(noise)} and device.{quantity}_noise_density is "
                    f"{toml_value(density)}: at most one of the two can be given"
                )
            corner = getattr(self, f"{quantity}_noise_corner")
            if corner and not (noise or density):
                raise message_error(
                    f"device.{quantity}_noise_corner is {toml_value(corner)} without white noise: "
                    f"device.{quantity}_noise or device.{quantity}_noise_density must be greater than 0"
                )
        if self.stiffness_drift and self.frequency_temperature_coefficient:
            raise message_error(
                f"device.stiffness_drift is {toml_value(self.stiffness_drift)} and "
                "device.frequency_temperature_coefficient is "
                f"{toml_value(self.frequency_temperature_coefficient)}: at most one of the two can be given"
            )
        if self.temperature_ramp and self.temperature_points is not None:
            raise message_error(
                f"device.temperature_ramp is {toml_value(self.temperature_ramp)} and device.temperature_points is "
                "given: at most one of the two can be"
            )
        return self

    @property
    def has_common_mode(self) -> bool:
        return any(map(math.isfinite, self.common_mode_frequency))

    @property
    def stiffness_coefficient(self) -> float:
        """Relative change of the stiffness, ppm/K, as either of its two fields states it."""
        return float(self.stiffness_drift or 2 * self.frequency_temperature_coefficient)

    def drifts(self, damping: Array, stiffness: Array) -> tuple[Array, Array]:
        """Changes of D and K per kelvin, of which these are the entries [xx, xy, yy], beyond the common growth."""
        (kx, ky), (dx, dy), turn = self.spring_drift, self.damper_drift, self.damping_axis_drift
        (d_xx, d_xy, d_yy), (k_xx, _, k_yy) = damping, stiffness
        of_damping = [dx * d_xx - 2 * turn * d_xy, turn * (d_xx - d_yy), dy * d_yy + 2 * turn * d_xy]
        of_stiffness = [kx * k_xx, self.quadrature_drift * np.sqrt(abs(k_xx * k_yy)), ky * k_yy]
        return 1e-6 * np.array(of_damping), 1e-6 * np.array(of_stiffness)

    def temperature(self, end: float) -> Points:
        """Change of temperature, K, at times in s, warm-up and hysteresis included; `end`: that of the run."""
        points = self.temperature_points or ((0.0, 0.0), (end, self.temperature_ramp * end))
        if self.warm_up_rise:
            points = _warmed(points, self.warm_up_rise, self.warm_up_time, end)
        return _lagging(points, self.hysteresis) if self.hysteresis else points


def _warmed(points: Points, rise: float, constant: float, end: float) -> Points:
    """The points with rise (1 - exp(-t/constant)), by lines that are off by 2e-5 of the rise at most."""
    times = np.union1d(
        [time for time, _ in points], np.append(np.arange(0.0, min(end, 12 * constant), constant / 80), end)
    )
    own = np.interp(times, *np.transpose(points))
    warm = own - rise * np.expm1(-np.maximum(times, 0.0) / constant)
    return tuple(zip(times.tolist(), warm.tolist(), strict=True))


def _lagging(points: Points, width: float) -> Points:
    """The play of `width` to either side between what drives it and its answer, which starts in the middle."""
    answer = points[0][1]
    found = [points[0]]
    for (begin, before), (end, after) in pairwise(points):
        held = min(max(answer, after - width), after + width)
        if held != answer:
            edge = answer + width if held > answer else answer - width  # here the answer begins to move
            part = (edge - before) / (after - before)
            if 0.0 < part < 1.0:
                found.append((begin + part * (end - begin), answer))
            answer = held
        found.append((end, answer))
    return tuple(found)
