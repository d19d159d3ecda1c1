"""Simulation: from scenarios to xarray Datasets."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import islice

import numpy as np
import xarray as xr

from .. import _core
from ..scenario import Scenario, bounded, check_scenario
from ..scenario.device_core import device_channels
from ..scenario.kinds import LOOP_CHANNELS, Channel, columns, reported_channels
from ..scenario.to_core import core_setup
from .dataset import dataset, time_scale
from .many import check_many, seed_of_each, setups_of, threads_available
from .user_controller import ControllerLike, UserController
from .user_plant import PlantLike, UserPlant, put_into, running

CHUNK = 32  # runs between two checks for interrupts and progress
SHARED_FIELDS = ("duration", "step", "record_every", "units")  # fields of [run] that runs of one record share
MAX_RECORD = 2 * 10**9  # bytes; the same on every machine


class DivergedError(ValueError):
    """The motion diverged, or the mass touched an electrode. `run` is the Dataset up to that time.

    `electrode` is the place of the touched one in [[electrodes]], otherwise None.

    >>> try:
    ...     run = fg.simulate(fg.Scenario.paper().replace({"run.step": 0.05, "disturbance.hold": 0.05}))
    ... except fg.DivergedError as error:
    ...     run = error.run
    >>> run.sizes["time"] < 1600
    True
    """

    def __init__(self, scenario: Scenario, time: float, run: xr.Dataset, electrode: int | None = None) -> None:
        si, scale = run.attrs["units"] == "SI", time_scale(scenario)
        step, half = scenario.run.step, f'"{scenario.run.step / 2 * scale:g} s"' if si else f"{scenario.run.step / 2:g}"

        def at(length: float) -> str:
            return f"{length * scale:.6g} s" if si else f"{length:.6g}/ω0"

        shorter = f"try run.step = {half} or less, or smaller gains"
        why = f"run.step is {at(step)}, which is too long for these gains, this rate or this force; {shorter}"
        if "plant" in run.attrs:
            gains = f"gains of {run.attrs['controller']}" if "controller" in run.attrs else "gains"
            why = (
                f"the {gains} are too large for {run.attrs['plant']} and a run.step of {at(step)}, or it is unstable, "
                f"or too stiff for a Runge-Kutta step of that length; {shorter}"
            )
        elif "controller" in run.attrs:
            why = (
                f"the gains of {run.attrs['controller']} are too large for run.step, which is {at(step)}, or it "
                f"assumes another sampling time; {shorter}"
            )
            why += "; as run.units is SI, its samples are in m and m/s, and its force is in N" if si else ""
        elif grown := bounded.cause(scenario, run):
            gain, b = grown
            why = (
                f"the bound estimates had grown to [{', '.join(f'{each:.3g}' for each in b)}], so that rho h/delta "
                f"was {gain:.3g}, and from about 2 on the sampled loop is unstable; "
                "controller.switching_limit = 0.5 bounds them"
            )
        said = f"the run diverged at t = {at(time)}: {why}"
        if electrode is not None:
            role = scenario.electrodes.each[electrode].role
            said = (
                f"the mass touched electrodes[{electrode}], of role {role}, at t = {at(time)}: it was pulled in; lower "
                "a bias, the force or the amplitude, or widen the gap"
            )
        super().__init__(said)
        self.run, self.electrode = run, electrode


def simulate(
    scenario: Scenario, controller: ControllerLike | None = None, plant: PlantLike | None = None
) -> xr.Dataset:
    """One closed-loop run.

    Returns a Dataset with position, velocity, reference, error, error_rate, control, disturbance and the reports of the
    controller over `time` (and `axis`, `entry` or `bound`), sampled every `scenario.run.record_every` steps, in the
    units of `scenario.run.units`. Position, velocity and error are the simulated values, without sensing errors. With
    adaptation.kind composite or joint, rate_deviation is the standard deviation of the rate estimate, and the force
    uses the estimates once rate_trusted is true. A dynamic [rate] and the imperfections of [device] have channels of
    their own. docs/reference.md lists all variables.

    `controller`: replaces the scenario's controller. It is a `native.Law`, or a callable that takes a `Sample` and
    returns the force (ux, uy), two finite numbers in a tuple or an array of any shape. Optional methods are
    reset(scenario), called before a run, and report(), called after each recorded sample, which returns a dict of names
    to numbers or pairs of numbers. These become variables, in the units of the run; rate_estimate makes the controller
    a rate sensor. A callable without reset is copied for each run, so that runs are independent; a function, which
    cannot be copied, keeps the variables of its enclosing scope. Only the force limit and the observer bandwidth of the
    scenario's controller remain in effect.

    `plant`: replaces the gyroscope. It is a `native.Plant`, or a callable that takes the time, the state and the force
    (ux, uy), which includes the disturbance, and returns the derivative of the state, in the units of the run. The
    state is (x, y, vx, vy), at first run.initial_position and run.initial_velocity. With an attribute `initial_state`
    it is those 2 to 8 numbers, and a method `motion(state)` returns x, y, vx and vy. With an attribute `takes_rate` of
    True, the angular rate is a fourth argument, and may be dynamic. A step is the classical Runge-Kutta step of fourth
    order over run.step, with the force held: four calls. The controller still assumes the [plant] of the scenario, to
    which errors of estimates refer. Sensors, actuators and disturbance remain those of the scenario.

    Raises DivergedError, which has the samples so far, if the motion diverges; ControllerError or PlantError, with the
    time, if a callable raises an exception; ValueError if the controller returns anything but two finite numbers or
    changes the names of its reports, or if the plant returns anything but a finite number for each state; ScenarioError
    if the plant cannot have the rate or the device of the scenario; TypeError if the controller or the plant is neither
    callable nor a C function.

    >>> run = fg.simulate(fg.Scenario.paper())
    >>> run["position"].dims, run.sizes["time"]
    (('time', 'axis'), 80001)
    """
    check_scenario(scenario)
    setup, device = core_setup(scenario), device_channels(scenario)
    own = None if plant is None else UserPlant(plant)
    put_into(own, [setup], [scenario])
    user = None if controller is None else UserController(controller)
    channels = user.channels(device) if user else _channels([setup], device)
    _check_size(scenario, channels, 1)
    every = scenario.run.record_every
    with running(own):
        if user:
            rows, lasted = user.record([scenario], [setup], every, device, 1)
            channels = user.channels(device)
        else:
            rows, lasted = _core.record_runs([setup], every, 1, columns(device))
    samples = int(lasted[0])
    diverged = samples <= scenario.run.steps
    run = dataset(rows[0, : -(-samples // every)] if diverged else rows[0], [scenario], channels, user, plant=own)
    if diverged:
        touched = setup.touched
        raise DivergedError(scenario, samples * scenario.run.step, run, touched - 1 if touched else None)
    return run


def simulate_many(
    scenarios: Sequence[Scenario],
    *,
    seeds: Sequence[int] | None = None,
    controller: ControllerLike | None = None,
    plant: PlantLike | None = None,
    progress: Callable[[int], object] | None = None,
) -> xr.Dataset:
    """Many runs on all processors: the variables of `simulate` with a leading `run` dimension.

    `seeds`: runs every scenario with each of these values of disturbance.seed; the runs of the first scenario come
    first, and the coordinate `seed` has the seed of each run. `controller`: replaces the scenarios' controllers, as in
    `simulate`. A `native.Law` runs on all processors; a callable runs on one, one run after another, each after
    reset(scenario) or with a copy of it. `plant`: replaces the gyroscope, as in `simulate`; a callable is used by all
    runs, one after another. `progress`: called with the number of runs finished since the last call.

    All scenarios must share run.duration, run.step, run.record_every and run.units, and in SI units
    plant.reference_frequency, which sets the unit of time. A run that diverges is NaN from `diverged_at` on, which is
    NaN for the others. Channels that only some controllers report are NaN for the others.

    Raises TypeError if `scenarios` is not a list of scenarios or `seeds` is not a list of integers; ValueError for an
    empty list, a repeated seed or one outside 0 to 2^63 - 1, scenarios that do not match, or a record larger than 2 GB
    (`measure_many` keeps no record); also the errors that `simulate` raises for a controller or a plant.

    >>> scenario = fg.Scenario.paper().replace({"run.duration": 2.0})
    >>> fg.simulate_many([scenario], seeds=range(4))["position"].shape
    (4, 2001, 2)
    """
    times = check_many(scenarios, seeds)
    _check_alike(scenarios)
    first, user = scenarios[0], None if controller is None else UserController(controller)
    own_plant = None if plant is None else UserPlant(plant)
    device = device_channels(*scenarios)
    channels = user.channels(device) if user else _channels(list(map(core_setup, scenarios)), device)
    _check_size(first, channels, len(scenarios) * times)
    threads, every = threads_available(), first.run.record_every
    parts, lasted = [], []
    waiting = setups_of(map(core_setup, scenarios), seeds, 1)
    while taken := list(islice(waiting, CHUNK)):
        setups = [setup for _, setup in taken]
        own = [scenarios[place // times] for place, _ in taken]
        put_into(own_plant, setups, own)
        with running(own_plant):
            if user:
                rows, samples = user.record(own, setups, every, device, threads)
            else:
                rows, samples = _record(setups, every, threads, device, channels)
        parts.append(rows)
        lasted.append(samples)
        if progress:
            progress(len(setups))
    whole = parts[0] if len(parts) == 1 else np.concatenate(parts)
    each = [scenario for scenario in scenarios for _ in range(times)]
    run = dataset(whole, each, user.channels(device) if user else channels, user, plant=own_plant)
    samples = np.concatenate(lasted)
    time = np.where(samples > first.run.steps, np.nan, samples * first.run.step)
    run["diverged_at"] = ("run", time * time_scale(first), {"long_name": "time of divergence"})
    texts = np.repeat([s.to_toml() for s in scenarios], times)
    return run.assign_coords(scenario=("run", texts), **seed_of_each(scenarios, seeds))


def _check_alike(scenarios: Sequence[Scenario]) -> None:
    """Raises ValueError if the runs cannot share the coordinate `time`."""
    values = {f"run.{name}": {getattr(s.run, name) for s in scenarios} for name in SHARED_FIELDS}
    if scenarios[0].run.units == "SI":
        values["plant.reference_frequency"] = {s.plant.reference_frequency for s in scenarios}
    for path, found in values.items():
        if len(found) > 1:
            in_si = " when run.units is SI" if path.startswith("plant") else ""
            raise ValueError(
                f"{path} is {' and '.join(map(str, sorted(found)))}: it must be the same in all scenarios that are "
                f"recorded together{in_si}; measure_many has no such limit"
            )


def _channels(setups: Sequence[_core.DeviceSetup], device: tuple[Channel, ...]) -> tuple[Channel, ...]:
    """Channels of a joint record: all that any controller reports, NaN for the others."""
    found = dict.fromkeys(channel for setup in setups for channel in reported_channels(setup))
    return (*LOOP_CHANNELS, *found, *device)


def _record(
    setups: Sequence[_core.DeviceSetup],
    every: int,
    threads: int,
    device: tuple[Channel, ...],
    channels: tuple[Channel, ...],
) -> tuple[np.ndarray, np.ndarray]:
    """Rows of these channels, (run, sample, column), and the number of samples of each run."""
    groups: dict[tuple[Channel, ...], list[int]] = {}
    for i, setup in enumerate(setups):
        groups.setdefault(_channels([setup], device), []).append(i)
    if list(groups) == [channels]:
        rows, lasted = _core.record_runs(setups, every, threads, columns(device))
        return rows, lasted
    starts = dict(zip(channels, np.cumsum([0, *(channel.width for channel in channels)]).tolist(), strict=False))
    width = columns(channels)
    whole = np.full((len(setups), setups[0].steps // every + 1, width), np.nan)
    lasted = np.zeros(len(setups), dtype=np.int64)
    for own, places in groups.items():
        rows, lasted[places] = _core.record_runs([setups[i] for i in places], every, threads, columns(device))
        to = [column for channel in own for column in range(starts[channel], starts[channel] + channel.width)]
        whole[np.ix_(places, range(rows.shape[1]), to)] = rows
    return whole, lasted


def _check_size(scenario: Scenario, channels: tuple[Channel, ...], runs: int) -> None:
    """Raises ValueError if the record of `runs` runs would be too large."""
    run = scenario.run
    columns = sum(channel.width for channel in channels)
    samples = run.steps // run.record_every + 1
    if (size := 8 * columns * samples * runs) > MAX_RECORD:
        raise ValueError(
            f"run.record_every is {run.record_every}: {runs} runs of {samples} samples of {columns} numbers are "
            f"{size / 1e9:.3g} GB, and a record may be at most {MAX_RECORD / 1e9:g} GB; increase it, record fewer "
            "runs at a time, or use measure_many, which keeps no record"
        )
