"""Entry point of `fracgyro identify`: from records of a bench to a device.

files -> columns (reading.py) -> segments without faults (faults.py)
      -> K, C, B as the pick-offs see them, by maximum likelihood (first_stage.py, sweep.py)
      -> the device (second_stage.py) -> device.toml, identify.json, report.html (found.py)
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..arguments import number, short
from ..extras import needs
from .decays import decay_tests
from .diagnostics import Test, tests
from .faults import check_motion, prepared
from .first_stage import Fitted, fit_segments
from .found import Found
from .json_schema import schema
from .quantity import NORMAL, Quantity, modal, pooled
from .records import Decay, Given, Record, Response, Segment, State, Sweep, described, finite_pair, of_arrays
from .results import Condition
from .second_stage import Known, fit_device
from .springs import spring_quantities, spring_tests
from .structure import Group
from .sweep import SweepFit, fit_sweep, sweep_tests
from .sweep_faults import direction_tests, jump_test, lean_test, runs
from .thermal import gain_of_pickoff
from .trends import Trend, line

Result = Found  # the class below has the same name among its own


class Identify:
    """Identifies a device from records of its bench: `fg.identify(records, ...)` returns a `Found`.

    `records`: files, (file, settings), or `Record`, `Decay` and `Sweep`; decays, forced records and sweeps together.
    `mass`: kg; without it stiffness and damping are per mass. `pickoff`: m of motion per unit of the x pick-off, needed
    for forces in N. `pickoff_ratio`: gain of the y pick-off over that of x, if known: a number, or (value, deviation).
    `assume`: other quantities that are known, by name, such as {"dxy": 0.0}: numbers, or (value, deviation), in the
    unit in which they are reported. docs/identify.md describes records and results.

    Raises ValueError, in one sentence, for a record that shows no mode, for an invalid file or number, and TypeError
    for anything else.

    >>> time = np.arange(20000) / 50e3
    >>> x = np.exp(-2 * time) * np.cos(2 * np.pi * 4000 * time)
    >>> y = 0.8 * np.exp(-3 * time) * np.cos(2 * np.pi * 4050 * time)
    >>> noise = 1e-3 * np.random.default_rng(0).normal(size=(2, 20000))
    >>> found = fg.identify(fg.identify.Record(x + noise[0], y + noise[1], interval=2e-5), mass=1e-6)
    >>> round(found["frequency_1"].value, 2), found["frequency_1"].unit
    (4000.0, 'Hz')
    >>> found["pickoff_ratio"].determined, found.scenario().plant.mass
    (False, 1e-06)
    """

    Record = Record
    Decay = Decay
    Sweep = Sweep
    Quantity = Quantity
    Found = Found
    schema = staticmethod(schema)

    def __call__(
        self,
        records: Given | Sequence[Given],
        *,
        mass: float | None = None,
        pickoff: float | None = None,
        pickoff_ratio: float | tuple[float, float] | None = None,
        assume: Mapping[str, float | tuple[float, float]] | None = None,
    ) -> Result:
        known = _known(mass, pickoff, pickoff_ratio, assume)
        segments: list[Segment] = []
        sweeps: list[Response] = []
        notes: list[str] = []
        files: dict[str, str] = {}
        for each in described(records):
            one, more = _read(each)
            notes += more
            if isinstance(one, Response):
                sweeps += runs(one)
                files[one.name] = one.digest
            else:
                if one[0].name in files:
                    one = [replace(part, name=f"{part.name} ({len(files) + 1})") for part in one]
                for segment in one:
                    ready, more = prepared(segment)
                    segments.append(ready)
                    notes += more
                    files[segment.name] = segment.digest
        if known.pickoff is None and segments and segments[0].units[0] == "m":
            known = Known(known.mass, 1.0, known.ratio, known.assumed)
        try:
            return _identified(segments, sweeps, known, notes, files)
        except np.linalg.LinAlgError:
            raise ValueError(
                f"{', '.join(sorted(files)) or 'the record'}: no fit converges: the records must contain the decay or "
                "the response of such a device; is a part too short, clipped, or unevenly sampled?"
            ) from None


identify = Identify()


def _known(
    mass: float | None,
    pickoff: float | None,
    ratio: float | tuple[float, float] | None,
    assume: Mapping[str, float | tuple[float, float]] | None,
) -> Known:
    if mass is not None:
        mass = number("mass", mass, above=0.0)
    if pickoff is not None:
        pickoff = number("pickoff", pickoff, above=0.0)
    pair = None if ratio is None else finite_pair("pickoff_ratio", ratio)
    if pair is not None and pair[0] <= 0:
        raise ValueError(f"pickoff_ratio is {pair[0]:g}: it must be greater than 0")
    if assume is not None and not isinstance(assume, Mapping):
        raise TypeError(f"assume is {short(assume)}: it must be a dict of quantities to numbers")
    return Known(
        mass, pickoff, pair, {name: finite_pair(f"assume {name}", each) for name, each in (assume or {}).items()}
    )


def _read(each: Record | Decay | Sweep) -> tuple[list[Segment] | Response, list[str]]:
    if isinstance(each, Record):
        return [of_arrays(each)], []
    with needs("identify"):
        from .reading import read
    return read(each)


def _identified(
    segments: Sequence[Segment], sweeps: Sequence[Response], known: Known, notes: list[str], files: dict[str, str]
) -> Found:
    found_states = [each.state for each in segments] + [each.state for each in sweeps]
    states = dict.fromkeys(State(None, each.bias, each.temperature) for each in found_states)
    unit: float | None = None
    conditions: list[Condition] = []
    checks: list[Test] = []
    for state in states:
        mine = [each for each in segments if _is_at(each.state, state)]
        fits: list[tuple[State, Fitted | SweepFit]] = []
        for rate, axes, drives in sorted({_kind(each) for each in mine}, key=str):
            group = [each for each in mine if _kind(each) == (rate, axes, drives)]
            check_motion(group)
            found = fit_segments(group, unit)
            fits.append((group[0].state, found))
            checks += tests(found.fit, found.spectra, found.segments) + spring_tests(found)
            checks += decay_tests(found)
            unit = unit or found.unit
        for response in sorted((each for each in sweeps if _is_at(each.state, state)), key=lambda each: each.digest):
            swept = fit_sweep(response)
            fits.append((response.state, swept))
            checks += [*sweep_tests(swept), lean_test(swept), *jump_test(response)]
        checks += direction_tests([fit for _, fit in fits if isinstance(fit, SweepFit)])
        conditions.append(_condition(state, fits, known, notes))
        if conditions[-1].device is not None:
            checks += conditions[-1].device.tests
    if sum(rate is None for rate in {each.name: each.state.rate for each in segments}.values()) > 1:
        notes.append("records without a stated rate are taken at one common rate")
    if known.mass is None:
        notes.append("no mass was given: stiffness and damping are per mass")
    if known.pickoff is None:
        notes.append("no gain of the pick-off was given: the scenario's amplitude and noise are not from these records")
    trends = _trends(conditions)
    return Found(
        tuple(conditions), tuple(checks), tuple(dict.fromkeys(notes)), known, dict(sorted(files.items())), trends
    )


def _is_at(state: State, condition: State) -> bool:
    return (state.bias, state.temperature) == (condition.bias, condition.temperature)


def _kind(segment: Segment) -> tuple[float | None, tuple[str, ...], tuple[str, ...]]:
    return segment.state.rate, segment.axes, segment.drives


def _condition(state: State, fits: list[tuple[State, Fitted | SweepFit]], known: Known, notes: list[str]) -> Condition:
    """Quantities of the device from the fits of one bias and temperature."""
    both = [(each, fit) for each, fit in fits if fit.shape.axes == 2]
    rate, first = both[0] if both else fits[0]
    alike = [fit for each, fit in fits if each.rate == rate.rate and _axes(fit) == _axes(first)]
    found = pooled([modal(each.shape, each.fit.parameters, each.fit.covariance, each.unit) for each in alike])
    device = None
    if both:
        unit = first.unit
        device = fit_device([_group(each, fit, unit) for each, fit in both], unit, known)
        found |= device.quantities
        notes += device.notes
    else:
        if _axes(first) == ("y",):
            notes.append("only the y pick-off was recorded: its axis is called x here and in the scenario")
        notes.append(
            "only one pick-off was recorded: coupling, rate and the other axis are not known; stiffness and damping "
            "are those of the mode, and the other axis of the scenario is supposed: its rate figures are not measured"
        )
        found |= pooled([_one_axis(each, known) for each in alike])
    timed = [fit for _, fit in fits if isinstance(fit, Fitted)]
    found |= spring_quantities(timed, known, found.get("pickoff_ratio"), found.get("stiffness_axis"))
    found |= _delay(fits) | _thermal_gain(state, fits, known)
    swept = next((fit for _, fit in fits if isinstance(fit, SweepFit)), None)
    if swept is not None:
        size, deviation = float(abs(swept.feedthrough[0, 0])), float(swept.feedthrough_deviation[0, 0])
        words = "of the response"
        found["feedthrough"] = Quantity(
            "feedthrough", size, (size - NORMAL * deviation, size + NORMAL * deviation), words, relative=True
        )
    return Condition(state, tuple(fits), device, found)


def _axes(fit: Fitted | SweepFit) -> tuple[str, ...]:
    return fit.response.axes if isinstance(fit, SweepFit) else fit.segments[0].axes


def _drives(fit: Fitted | SweepFit) -> tuple[str, ...]:
    return fit.response.drives if isinstance(fit, SweepFit) else fit.segments[0].drives


def _delay(fits: list[tuple[State, Fitted | SweepFit]]) -> dict[str, Quantity]:
    """The delay of the force of the first forced record."""
    for _, fit in fits:
        if isinstance(fit, Fitted) and fit.delay is not None and math.isfinite(fit.delay.deviation):
            value, half = fit.delay.seconds, NORMAL * fit.delay.deviation * fit.delay.interval
            words = f"{fit.delay.samples + fit.delay.fraction:.4g} samples"
            if value + half < 0:
                words += ": each force stands in the row of the motion after it"
            return {"delay": Quantity("delay", value, (value - half, value + half), "s", note=words)}
    return {}


def _thermal_gain(state: State, fits: list[tuple[State, Fitted | SweepFit]], known: Known) -> dict[str, Quantity]:
    """The gain of the x pick-off from thermal motion, if mass and temperature are known."""
    if known.mass is None or state.temperature is None:
        return {}
    name = "thermal_pickoff"
    for _, fit in fits:
        if isinstance(fit, Fitted) and fit.segments[0].axes[0] == "x":
            damping = float(fit.fit.parameters[fit.shape.axes**2])
            gain = gain_of_pickoff(fit.fit.thermal, damping, fit.unit, known.mass, state.temperature)
            if gain is not None:
                unit = f"m/{fit.segments[0].units[0]}" if fit.segments[0].units[0] else "m"
                note = "if nothing but its temperature moves the device"
                return {name: Quantity(name, gain[0], gain[1], unit, note=note)}
    return {}


def _group(state: State, fit: Fitted | SweepFit, unit: float) -> Group:
    """A fit as a group of the second stage, in units of a common omega0."""
    turn = fit.unit / unit
    n = fit.shape.axes**2
    powers = [turn**2] * n + [turn] * n + [turn**2] * (fit.shape.axes * fit.shape.drives)
    scale = [float(each) for each in powers]
    parameters = fit.fit.parameters * scale
    covariance = fit.fit.covariance * [[a * b for b in scale] for a in scale]
    return Group(parameters, covariance, state.rate, _drives(fit))


def _one_axis(fit: Fitted | SweepFit, known: Known) -> dict[str, Quantity]:
    """Stiffness and damping of the only axis."""
    mass = known.mass or 1.0
    sd = fit.fit.covariance.diagonal() ** 0.5
    found = {}
    for i, name, factor, unit in (
        (0, "kxx", fit.unit**2 * mass, "N/m" if known.mass else "1/s^2"),
        (1, "dxx", fit.unit * mass, "N s/m" if known.mass else "1/s"),
    ):
        value, half = factor * float(fit.fit.parameters[i]), factor * NORMAL * float(sd[i])
        found[name] = Quantity(name, value, (value - half, value + half), unit, relative=known.mass is None)
    return found


def _trends(conditions: Sequence[Condition]) -> tuple[Trend, ...]:
    """Lines of each mode's frequency over bias and temperature, if there are three different values."""
    found: list[Trend] = []
    modes = ("frequency_1", "frequency_2")
    biases = [each for each in conditions if each.state.bias is not None]
    warm = [each for each in conditions if each.state.temperature is not None]
    for name in modes:
        if len({each.state.bias for each in biases}) >= 3 and all(name in each.quantities for each in biases):
            values = [each.quantities[name] for each in biases]
            squared = [each.value**2 for each in values]
            deviation = [2 * each.value * each.half / NORMAL for each in values]
            at = [float(each.state.bias or 0.0) ** 2 for each in biases]
            found.append(line(f"{name}^2", "V^2", "Hz^2/V^2", at, squared, deviation))
        if len({each.state.temperature for each in warm}) >= 3 and all(name in each.quantities for each in warm):
            values = [each.quantities[name] for each in warm]
            at = [float(each.state.temperature or 0.0) for each in warm]
            spread = [each.half / NORMAL for each in values]
            found.append(line(name, "T", "Hz/K", at, [each.value for each in values], spread))
    return tuple(found)
