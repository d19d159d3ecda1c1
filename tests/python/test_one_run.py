"""Shared inputs of runs are computed once, and a freed run's memory is reused, without leaking data between runs."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import fracgyro as fg
import numpy as np
import pytest
import xarray as xr
from fracgyro import _core
from fracgyro.scenario.to_core import core_setup
from fracgyro.simulation import dataset, measure

PAPER = fg.Scenario.paper().replace({"run.duration": 0.2})
SI = fg.Scenario.paper().replace({"run.duration": 0.1, "run.units": "SI", "run.record_every": 3})
COMPOSITE = PAPER.replace({"adaptation.kind": "composite"})
HOLDS_STILL = PAPER.replace({"device.delay": 1, "rate.kind": "step", "rate.amplitude": 50.0, "rate.start": 0.0001})
LARGE = fg.Scenario.paper().replace({"run.duration": 20.0})  # 4.6 MB


def pd(s: fg.Sample) -> tuple[float, float]:
    (x, y), (vx, vy), (rx, ry), (rvx, rvy) = s.position, s.velocity, s.reference, s.reference_velocity
    return -1600.0 * (x - rx) - 56.0 * (vx - rvx), -1600.0 * (y - ry) - 56.0 * (vy - rvy)


DATASETS = {
    "one run": lambda: fg.simulate(PAPER),
    "SI": lambda: fg.simulate(SI),
    "composite": lambda: fg.simulate(COMPOSITE),
    "device": lambda: fg.simulate(HOLDS_STILL),
    "many": lambda: fg.simulate_many([PAPER, COMPOSITE], seeds=[1, 2]),
    "callable": lambda: fg.simulate(PAPER, pd),
    "loop": lambda: fg.Loop(PAPER).run(7),
    "metrics": lambda: fg.measure_many([PAPER]),
    "metrics of many": lambda: fg.measure_many([PAPER, COMPOSITE], seeds=[1, 2]),
}
every = pytest.mark.parametrize("made", DATASETS.values(), ids=DATASETS.keys())


@every
def test_a_dataset_is_what_xarray_makes_of_its_parts(made) -> None:
    run = made()
    again = xr.Dataset(
        {name: (v.dims, v.values.copy(), dict(v.attrs)) for name, v in run.data_vars.items()},
        coords={name: (v.dims, v.values.copy(), dict(v.attrs)) for name, v in run.coords.items()},
        attrs=dict(run.attrs),
    )
    xr.testing.assert_identical(run, again)
    assert list(run.indexes) == [name for name in run.coords if name in run.dims]
    for name, index in again.indexes.items():
        assert run.indexes[name].equals(index)
        assert run.indexes[name].dtype == index.dtype
    for name, variable in again.variables.items():
        assert type(run.variables[name]) is type(variable)
        assert run.variables[name].dtype == variable.dtype


@every
def test_what_is_changed_in_one_dataset_is_not_in_the_next(made) -> None:
    changed, untouched = made(), made()
    before = untouched.copy(deep=True)
    changed.attrs["units"] = "furlongs"
    for name in changed.variables:
        changed[name].attrs["units"] = "furlongs"
        changed[name].encoding["dtype"] = "float32"
        try:
            changed[name].values[...] = 7
        except ValueError:
            assert name in changed.coords  # values are read-only
    for index in changed.indexes.values():
        index.name = "furlongs"
    changed["more"] = 1
    for other in (untouched, made()):
        xr.testing.assert_identical(other, before)
        assert all(not variable.encoding for variable in other.variables.values())
        assert [index.name for index in other.indexes.values()] == list(other.indexes)


def test_every_variable_can_be_written_to_and_is_a_view_of_one_record() -> None:
    run = fg.simulate(PAPER)
    assert len({id(_owner(variable.values)) for variable in run.data_vars.values()}) == 1
    for variable in run.data_vars.values():
        variable.values[...] = 7.0
    assert all((variable == 7.0).all() for variable in run.data_vars.values())


def _owner(array: np.ndarray) -> object:
    while isinstance(array.base, np.ndarray):
        array = array.base
    return array


def test_times_are_those_of_the_run_and_of_its_units() -> None:
    """Two runs after one another whose records have the same shape."""
    step, wide = (PAPER.replace({"run.step": h, "run.duration": 100 * h}) for h in (1e-3, 5e-4))
    assert fg.simulate(step)["time"].values[-1] == 100 * 1e-3
    assert fg.simulate(wide)["time"].values[-1] == 100 * 5e-4
    si = fg.simulate(step.replace({"run.units": "SI"}))["time"]
    assert (si.values[-1], si.attrs["units"]) == (100 * 1e-3 * 1e-3, "s")
    loop = fg.Loop(step)
    assert [float(loop.run(3)["time"][0]) for _ in range(3)] == [0.0, 3 * 1e-3, 6 * 1e-3]


def test_long_runs_do_not_keep_their_coordinates(monkeypatch: pytest.MonkeyPatch) -> None:
    fg.simulate(PAPER)
    before = dataset._form.cache_info()
    monkeypatch.setattr(dataset, "MAX_CACHED", 100)
    run = fg.simulate(PAPER)
    assert dataset._form.cache_info() == before
    monkeypatch.undo()
    xr.testing.assert_identical(run, fg.simulate(PAPER))


def test_a_changed_scenario_has_its_own_text_and_setup() -> None:
    text = PAPER.to_toml()
    assert PAPER.to_toml() is text
    other = PAPER.model_copy(update={"run": PAPER.run.model_copy(update={"duration": 0.3})})  # keeps as much as
    # possible
    assert "duration = 0.3" in other.to_toml()
    assert core_setup(other).steps == 300
    assert core_setup(PAPER, {"run.steps": 50}).steps == 50
    changed = core_setup(PAPER)
    changed.seed = 77
    assert core_setup(PAPER).seed == 0


# -- Memory ----------------------------------------------------------------------------------------------


def address(record: np.ndarray) -> int:
    return record.__array_interface__["data"][0]


def kept_from_others(place: int, size: int) -> bool:
    """True if this memory is not reused: malloc would give freed memory to the next caller."""
    others = [np.empty(size, np.uint8) for _ in range(8)]
    return not any(address(other) < place + size and place < address(other) + size for other in others)


def rows_of(scenario: fg.Scenario) -> np.ndarray:
    return _core.record_runs([core_setup(scenario)], 1, 1)[0]


def test_the_memory_of_a_record_that_is_gone_serves_the_next_of_its_size() -> None:
    first = rows_of(LARGE)
    assert first.nbytes > 4 << 20
    place = address(first)
    assert place % (2 << 20) == 0
    second = rows_of(LARGE)
    assert address(second) != place
    expected = second.copy()
    first[...] = np.nan
    view = first[0, 10:, 3]
    del first
    third = rows_of(LARGE)  # while a view of the first is alive
    assert address(third) not in (place, address(second))
    assert np.isnan(view).all()
    del view
    assert kept_from_others(place, second.nbytes)
    fourth = rows_of(LARGE)
    assert address(fourth) == place
    for record in (second, third, fourth):
        np.testing.assert_array_equal(record, expected)


def test_a_dataset_gives_its_memory_back_when_it_dies() -> None:
    """At once: nothing in it refers to itself."""
    size = rows_of(LARGE).nbytes
    place = address(fg.simulate(LARGE)["position"].values)
    assert kept_from_others(place, size)
    assert address(fg.simulate(LARGE)["position"].values) == place
    long = LARGE.replace({"run.duration": 60.0})  # a callable reports less
    law = fg.simulate(long, pd)
    place, size = address(law["position"].values), _owner(law["position"].values).nbytes
    assert size > 4 << 20
    del law
    assert kept_from_others(place, size)
    assert address(fg.simulate(long, pd)["position"].values) == place


def test_as_many_records_are_kept_for_later_as_64_mb_hold() -> None:
    size = rows_of(LARGE).nbytes
    alive = [rows_of(LARGE) for _ in range(20)]
    places = {address(record) for record in alive}
    del alive
    again = [rows_of(LARGE) for _ in range(20)]
    assert sum(address(record) in places for record in again) >= (64 << 20) // (size + (2 << 20))
    del again
    whole = rows_of(LARGE.replace({"run.duration": 300.0}))  # more than that
    assert whole.nbytes > 64 << 20
    del whole
    rows_of(LARGE)


def test_runs_on_several_threads_do_not_share_their_memory() -> None:
    scenarios = [LARGE.replace({"disturbance.seed": seed}) for seed in range(4)]
    expected = [rows_of(scenario).copy() for scenario in scenarios]

    def often(i: int) -> bool:
        return all(np.array_equal(fg.simulate(scenarios[i])["position"], expected[i][0, :, :2]) for _ in range(5))

    with ThreadPoolExecutor(4) as pool:
        assert all(pool.map(often, [0, 1, 2, 3]))


# -- Few runs --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("threads", [1, 64])
def test_only_the_number_of_runs_says_whether_they_go_by_themselves(
    threads: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []

    def measure_runs(setups, params, threads, lanes, single):
        asked.append((len(setups), lanes))
        return _core_measure_runs(setups, params, 1, lanes, single)

    _core_measure_runs = _core.measure_runs
    monkeypatch.setattr(_core, "measure_runs", measure_runs)
    monkeypatch.setattr(measure, "threads_available", lambda: threads)
    widest = _core.lane_counts()[-1]
    for runs in (1, 2, 3, 20):
        fg.measure_many([PAPER], seeds=range(runs))
    assert asked == [(1, 1), (2, 1), (3, widest), (20, widest)]


@pytest.mark.parametrize("single", [False, True])
def test_a_run_by_itself_has_the_metrics_that_it_has_among_many(single: bool) -> None:
    wild = PAPER.replace({"controller.fractional_gain": 3000.0, "run.duration": 2.0})
    for scenario in (PAPER, COMPOSITE, wild, PAPER.replace({"controller.kind": "super_twisting"})):
        alone = fg.measure_many([scenario], transient=0.1, single_precision=single)
        among = fg.measure_many([scenario, PAPER, COMPOSITE], transient=0.1, single_precision=single)
        xr.testing.assert_identical(alone, among.isel(run=[0]))
    assert alone.attrs == among.attrs
