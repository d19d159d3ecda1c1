"""Metrics of a task: response to a step, frequency response along a chirp, drive loop of a conventional gyroscope."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..arguments import number
from ..scenario import Scenario
from ..scenario.kinds import AXES, SINE_DRIVES
from ..scenario.scales import si_unit
from .metric_names import TASKS
from .scenarios import one_scenario, scale

Array = NDArray[np.float64]
AT_END = 0.1  # fraction of the plateau over which its end is averaged
TAPERED = 0.05  # fraction of a chirp at each end
SETTLED_AMPLITUDE = 0.01  # fraction of the drive amplitude


def step_response(run: xr.Dataset, tolerance: float = 0.02) -> xr.Dataset:
    """Overshoot, rise time, settling time and final error of each axis whose reference is a step.

    The step lasts from reference.start to reference.end or the end of the run. `overshoot` and `final_error` are
    fractions of its height, the latter the mean over its last tenth; `rise_time` is from 10 to 90 % of the height;
    `settling_time` is the time from the start on after which the position stays within `tolerance` times the height.
    Over `axis`; NaN for an axis without a step, or what was not reached. Times are in the unit of time of the run.

    Raises ValueError if no axis has a step, or for several runs in one Dataset.

    >>> step = {"reference.kind": "step", "reference.smoothing": 0.2, "run.initial_position": (0.0, 0.0)}
    >>> run = fg.simulate(fg.Scenario.paper().replace({**step, "run.duration": 10.0}))
    >>> bool((fg.metrics.step_response(run).overshoot < 0.01).all())
    True
    """
    scenario = one_scenario(run)
    number("tolerance", tolerance, above=0.0)
    r, unit = scenario.reference, float(scale(run, "1/omega0"))
    stepping = [kind == "step" and r.amplitude[i] != 0 for i, kind in enumerate(r.kinds)]
    if not any(stepping):
        raise ValueError(f"reference.kind is {r.kind!r}: an axis must have a step, of an amplitude other than 0")
    time = run["time"].values
    inside = (time >= r.start * unit) & (time < r.end * unit)
    since, length = time[inside] - r.start * unit, float(scale(run, "q0"))
    found = np.full((4, 2), np.nan)
    for i in np.flatnonzero(stepping):
        position = run["position"].isel(axis=i).values[inside]
        share = (position / length - r.offset[i]) / r.amplitude[i]
        found[:, i] = _step_figures(since, share, tolerance)
    units = TASKS["step"].units
    rows = {name: ("axis", row) for name, row in zip(units, found, strict=True)}
    return _with_units(run, xr.Dataset(rows, {"axis": AXES}), units)


def _step_figures(time: Array, share: Array, tolerance: float) -> list[float]:
    """`share`: of the height reached."""
    if not len(time):
        return [np.nan] * 4

    def first(level: float) -> float:
        above = np.flatnonzero(share >= level)
        return float(time[above[0]]) if len(above) else np.nan

    outside = np.flatnonzero(np.abs(share - 1) > tolerance)
    last = int(outside[-1]) + 1 if len(outside) else 0
    settled = float(time[last]) if last < len(time) else np.nan
    final = share[-max(round(AT_END * len(share)), 1) :]
    return [max(float(share.max()) - 1, 0.0), first(0.9) - first(0.1), settled, float(final.mean()) - 1]


def frequency_response(run: xr.Dataset, bands: int = 100) -> xr.Dataset:
    """Gain and phase from the reference to the position, as measured in a run whose reference is a chirp.

    Over `frequency`, angular and in the run's units, and `axis`: `gain`, `phase` in rad, and `coherence`, the share of
    the motion that follows the reference. The band of the chirp is divided into at most `bands` bands, and each has the
    ratio of spectra with the least squared error. NaN outside of the chirp of an axis.

    Raises ValueError if no axis has a chirp, or for several runs in one Dataset.

    >>> chirp = {"reference.kind": "chirp", "reference.final_frequency": (8.0, 8.0), "reference.end": 80.0}
    >>> response = fg.metrics.frequency_response(fg.simulate(fg.Scenario.paper().replace(chirp)))
    >>> bool(abs(response.gain - 1).max() < 0.01)
    True
    """
    scenario = one_scenario(run)
    r, unit = scenario.reference, float(scale(run, "1/omega0"))
    number("bands", bands, least=1.0)
    sweeping = [i for i, kind in enumerate(r.kinds) if kind == "chirp"]
    if not sweeping:
        raise ValueError(f"reference.kind is {r.kind!r}: an axis must have a chirp")
    time = run["time"].values
    part = run.isel(time=np.flatnonzero((time >= r.start * unit) & (time < r.end * unit)))
    if part.sizes["time"] < 2:
        raise ValueError(f"reference.start is {r.start}: the run must contain some of the chirp")
    step = float(part["time"][1] - part["time"][0])
    frequency = 2 * np.pi * np.fft.rfftfreq(part.sizes["time"], step)
    ends = np.array([sorted((abs(r.frequency[i]), abs(r.final_frequency[i]))) for i in sweeping]) / unit
    low, high = ends.min(), ends.max()
    lines = np.flatnonzero((frequency >= low) & (frequency <= high))
    if not len(lines):
        raise ValueError(f"reference.end is {r.end}: the chirp is too short to resolve its frequencies")
    groups = np.array_split(lines, min(int(bands), len(lines)))
    found = np.full((3, len(groups), 2), np.nan)
    for i in sweeping:
        asked, answered = (_spectrum(part[name].isel(axis=i).values) for name in ("reference", "position"))
        first, last = ends[sweeping.index(i)]
        for g in (g for g, group in enumerate(groups) if first <= frequency[group].mean() <= last):
            x, y = asked[groups[g]], answered[groups[g]]
            power, cross, answer = np.vdot(x, x).real, np.vdot(x, y), np.vdot(y, y).real
            ratio = cross / power
            found[:, g, i] = abs(ratio), np.angle(ratio), abs(cross) ** 2 / (power * answer) if answer else np.nan
    centers = [float(frequency[group].mean()) for group in groups]
    units = {"gain": "1", "phase": "rad", "coherence": "1"}
    rows = {name: (("frequency", "axis"), row) for name, row in zip(units, found, strict=True)}
    response = xr.Dataset(rows, {"frequency": centers, "axis": AXES})
    return _with_units(run, response, units | {"frequency": "omega0"})


def _spectrum(values: Array) -> NDArray[np.complex128]:
    """Spectrum with tapered ends: otherwise motion cut off at the ends leaks into all frequencies."""
    ends = max(round(TAPERED * len(values)), 1)
    rise = 0.5 - 0.5 * np.cos(np.pi * (np.arange(ends) + 0.5) / ends)
    window = np.ones(len(values))
    window[:ends] = rise
    window[-ends:] = rise[::-1]
    spectrum: NDArray[np.complex128] = np.fft.rfft(window * (values - values.mean()))
    return spectrum


def drive(run: xr.Dataset, transient: float | None = None) -> xr.Dataset:
    """Figures of the drive loop of a gyroscope that measures by a vibration of its own, as force_rebalance does.

    Of the time after `transient`, by default half of the run:
    `amplitude_error` is the mean amplitude relative to reference.amplitude, minus 1, and `amplitude_noise` its standard
    deviation, relative; `frequency` is the mean of the phase-locked loop; `phase_error`, rad, is the angle by which the
    drive force leads the velocity, along the vibration; `quadrature` and `quadrature_noise` are mean and standard
    deviation, as an angular rate. `amplitude_settling_time` is the time after which the amplitude control keeps the
    amplitude within 1 %.

    Raises ValueError for other controllers, or for several runs in one Dataset.

    >>> slow = {"controller.kind": "force_rebalance", "reference.kind": ["sine", "rest"], "run.duration": 4000.0}
    >>> figures = fg.metrics.drive(fg.simulate(fg.Scenario.shipped("paper_resonance").replace(slow)))
    >>> bool(abs(figures.amplitude_error) < 0.01)
    True
    """
    scenario = one_scenario(run)
    if not drives(run):
        known = " or ".join(SINE_DRIVES)
        raise ValueError(f"controller.kind is {scenario.controller.kind}: it must be {known} for figures of a drive")
    time = run["time"].values
    begin = 0.5 * float(time[-1]) if transient is None else number("transient", transient, least=0.0)
    steady = run.isel(time=np.flatnonzero(time >= begin))
    if not steady.sizes["time"]:
        raise ValueError(f"transient is {begin:g}: the run must be longer")
    amplitude = float(scale(run, "q0")) * scenario.reference.amplitude[0]
    off = np.abs(run["drive_amplitude"].values / amplitude - 1)
    outside = np.flatnonzero(~(off <= SETTLED_AMPLITUDE))
    last = int(outside[-1]) + 1 if len(outside) else 0
    frequency = float(steady["drive_frequency"].mean())
    share = steady["drive_amplitude"] / amplitude
    found = xr.Dataset(
        {
            "amplitude_error": share.mean() - 1,
            "amplitude_noise": share.std(),
            "amplitude_settling_time": float(time[last]) if last < len(time) else np.nan,
            "frequency": frequency,
            "phase_error": _phase_error(steady, frequency, scenario.run.step * float(scale(run, "1/omega0"))),
            "quadrature": steady["quadrature"].mean(),
            "quadrature_noise": steady["quadrature"].std(),
        }
    )
    return _with_units(run, found, TASKS["drive"].units)


def drives(run: xr.Dataset) -> bool:
    """True for a run of a conventional gyroscope's controller."""
    return "drive_amplitude" in run and one_scenario(run).controller.kind in SINE_DRIVES


def _phase_error(run: xr.Dataset, frequency: float, step: float) -> float:
    """Angle by which the force leads the velocity along the vibration, which is x or a line that turns."""
    angle = frequency * run["time"].values
    basis = np.column_stack([np.cos(angle), np.sin(angle)])
    line = run["pattern_angle"].values if "pattern_angle" in run else np.zeros(run.sizes["time"])
    along = np.column_stack([np.cos(line), np.sin(line)])

    def phasor(name: str) -> complex:
        (cosine, sine), *_ = np.linalg.lstsq(basis, (along * run[name].values).sum(axis=1), rcond=None)
        return complex(cosine, -sine)

    velocity, force = 1j * frequency * phasor("position"), phasor("control")
    # A held force acts half a step late.
    return float(np.angle(force / velocity)) - 0.5 * frequency * step if velocity and force else np.nan


def task_figures(run: xr.Dataset) -> list[xr.Dataset]:
    """Figures of each task of a run: step response, summary of the frequency response, drive. Only axes with the task.

    Raises ValueError if the run is too short for a task.
    """
    axes = task_axes(one_scenario(run))
    found = [step_response(run).sel(axis=axes["step"])] if "step" in axes else []
    found += [_summarized(run, frequency_response(run).sel(axis=axes["chirp"]))] if "chirp" in axes else []
    return found + ([drive(run)] if drives(run) else [])


def task_axes(scenario: Scenario) -> dict[str, list[str]]:
    """Tasks of a scenario, each with its axes; a drive has none."""
    r = scenario.reference
    found = {
        "step": [AXES[i] for i, kind in enumerate(r.kinds) if kind == "step" and r.amplitude[i] != 0],
        "chirp": [axis for axis, kind in zip(AXES, r.kinds, strict=True) if kind == "chirp"],
    }
    drive: dict[str, list[str]] = {"drive": []} if scenario.controller.kind in SINE_DRIVES else {}
    return {name: axes for name, axes in found.items() if axes} | drive


def _summarized(run: xr.Dataset, response: xr.Dataset) -> xr.Dataset:
    """`cutoff_frequency`: the first with a gain 3 dB below 1; the largest deviations from gain 1 and phase 0."""
    below = response["gain"] < 0.5**0.5
    cutoff = xr.where(below.any("frequency"), response["frequency"][below.argmax("frequency")], np.nan)
    deviations = {name: abs(response[name] - ideal).max("frequency") for name, ideal in (("gain", 1.0), ("phase", 0.0))}
    found = xr.Dataset(
        {
            "cutoff_frequency": cutoff.drop_vars("frequency"),
            "gain_deviation": deviations["gain"],
            "phase_deviation": deviations["phase"],
        }
    )
    return _with_units(run, found, TASKS["chirp"].units)


def _with_units(run: xr.Dataset, found: xr.Dataset, units: dict[str, str]) -> xr.Dataset:
    """The same with attributes units: SI if the run is in SI, otherwise nondimensional."""
    for name, unit in units.items():
        found[name].attrs["units"] = si_unit(unit) if run.attrs["units"] == "SI" else unit
    return found
