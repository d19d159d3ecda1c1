"""Disturbances that add up: every kind against its formula in NumPy, in single runs, lanes and the exports."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import fracgyro as fg
import numpy as np
import pytest
from fracgyro import _core
from fracgyro.rate.bound import noise_of
from fracgyro.scenario.to_core import core_setup, datasheet, guard
from scipy import signal

Entry = dict[str, Any]
PAPER = fg.Scenario.paper().replace({"run.duration": 1.5})
STEP = PAPER.run.step
SEED = 5
PSD = [[2.0, 0.01], [20.0, 0.1], [200.0, 0.02]]
ENTRIES: dict[str, Entry] = {
    "noise": {"kind": "noise", "standard_deviation": 0.5, "hold": 3e-3},
    "noise for a time": {"kind": "noise", "standard_deviation": 2.0, "start": 0.2, "end": 0.9},
    "noise in a band": {"kind": "noise", "standard_deviation": 1.5, "band": [0.0, 50.0], "start": 0.1},
    "dense noise in a band": {"kind": "noise", "density": 0.01, "band": [10.0, 70.0]},
    "sine": {"kind": "sine", "amplitude": [0.3, 0.4], "frequency": [2.0, -3.0], "phase": [0.5, 1.0], "start": 0.3},
    "step": {"kind": "step", "amplitude": [2.0, -1.0], "start": 0.5, "end": 0.8},
    "pulse": {"kind": "pulse", "amplitude": [30.0, -4.0], "start": 1.0004, "width": 0.0123},
    "pulse that is cut off": {"kind": "pulse", "amplitude": [3.0, 4.0], "start": 0.2, "width": 0.5, "end": 0.45},
    "vibration": {"kind": "vibration", "psd": PSD, "weights": [1.0, 0.5]},
    "pink vibration": {"kind": "vibration", "psd": [[1.0, 0.2], [10.0, 0.02]], "weights": [0.0, 1.0]},
    "table": {"kind": "table", "points": [[0.0, 0.0, 2.0], [0.1, 1.0, -1.0], [0.25, 0.5, 2.0]], "start": 0.4},
}
LIST = [{"kind": "none", "seed": SEED}, *ENTRIES.values()]


def with_list(*entries: Entry) -> fg.Scenario:
    return PAPER.replace({"disturbance": list(entries)})


def drawn(scenario: fg.Scenario, count: int = 1501, first: int = 0) -> np.ndarray:
    return _core.disturbance(core_setup(scenario), first, count)


def sines(times: np.ndarray, psd: np.ndarray, stream: int, axis: int) -> np.ndarray:
    """Sixty-four sines of equal power whose frequencies divide the integral of the spectrum."""
    (low, high), (of_low, of_high) = (np.stack([column[:-1], column[1:]]) for column in psd.T)
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = np.where(of_low == of_high, 0.0, np.log(of_high / of_low) / np.log(high / low))
    power, part = np.zeros(len(low)), slope + 1.0
    for i, p in enumerate(part):
        if slope[i] == 0:
            power[i] = of_low[i] * (high[i] - low[i])
        elif abs(p) < 1e-9:
            power[i] = of_low[i] * low[i] * math.log(high[i] / low[i])
        else:
            power[i] = of_low[i] * low[i] / p * ((high[i] / low[i]) ** p - 1)
    total, before = power.sum(), np.concatenate([[0.0], np.cumsum(power)])
    d = np.zeros(len(times))
    for k in range(64):
        words = _core.philox(SEED, [k, axis, stream, 1])
        wanted = total * (k + words[0] / 2**32) / 64
        i = int(np.searchsorted(before, wanted, side="right")) - 1
        rest = wanted - before[i]
        if slope[i] == 0:
            frequency = low[i] + rest / of_low[i]
        elif abs(part[i]) < 1e-9:
            frequency = low[i] * math.exp(rest / (of_low[i] * low[i]))
        else:
            frequency = low[i] * (1 + part[i] * rest / (of_low[i] * low[i])) ** (1 / part[i])
        d += np.sin(frequency * times + 2 * np.pi * words[1] / 2**32)
    return math.sqrt(2 * total / 64) * d


def white(count: int, deviation: float, hold: int, stream: int) -> np.ndarray:
    """Box-Muller normals, two holds from each block of four words."""
    holds = -(-count // hold)
    words = np.array([_core.philox(SEED, [k, 0, stream, 0]) for k in range(holds // 2 + 1)], dtype=float)
    radial, angular = words[:, [0, 2]].ravel(), words[:, [1, 3]].ravel()
    radius = np.sqrt(-2 * np.log((np.floor(radial / 2) + 0.5) / 2**31))
    angle = 2 * np.pi * angular / 2**32
    normals = radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return deviation * np.repeat(normals, hold, axis=0)[:count]


def formula(entry: Entry, stream: int, count: int = 1501) -> np.ndarray:
    """d at the samples, without the core."""
    t = np.arange(count) * STEP
    start, end = entry.get("start", 0.0), entry.get("end", math.inf)
    x_and_y = np.array(entry.get("amplitude", [0.0, 0.0]))
    d = np.zeros((count, 2))
    if "band" in entry:
        low, high = entry["band"]
        density = entry["density"] / math.pi if "density" in entry else entry["standard_deviation"] ** 2 / (high - low)
        d = np.stack([sines(t, np.array([[low, density], [high, density]]), stream, k) for k in range(2)], axis=1)
    elif entry["kind"] == "noise":
        d = white(count, entry["standard_deviation"], round(entry.get("hold", STEP) / STEP), stream)
    elif entry["kind"] == "sine":
        d = x_and_y * np.sin(np.outer(t, entry["frequency"]) + entry["phase"])
    elif entry["kind"] == "step":
        d = np.tile(x_and_y, (count, 1))
    elif entry["kind"] == "pulse":
        passed = (t - start) / entry["width"]
        d = np.where((passed >= 0) & (passed < 1), np.sin(np.pi * passed), 0.0)[:, None] * x_and_y
    elif entry["kind"] == "vibration":
        psd = np.array(entry["psd"])
        d = np.stack([w * sines(t, psd, stream, k) for k, w in enumerate(entry["weights"])], axis=1)
    elif entry["kind"] == "table":
        times, *values = np.array(entry["points"]).T
        inside = (t - start > times[0] - 1e-9) & (t - start < times[-1] + 1e-9)
        d = np.stack([np.where(inside, np.interp(t - start, times, v), 0.0) for v in values], axis=1)
    return np.where(((t > start - 1e-9) & (t < end - 1e-9))[:, None], d, 0.0)


@pytest.mark.parametrize("name", ENTRIES)
def test_each_kind_is_its_formula_first_or_added(name: str) -> None:
    entry = ENTRIES[name]
    tolerance = 3e-6 if "noise" in name and "band" not in name else 1e-9  # normals are drawn in single precision
    alone = drawn(with_list({**entry, "seed": SEED}))
    np.testing.assert_allclose(alone, formula(entry, 0), rtol=0, atol=tolerance)
    added = drawn(with_list({"kind": "none", "seed": SEED}, entry))
    np.testing.assert_allclose(added, formula(entry, 17), rtol=0, atol=tolerance)
    assert np.abs(alone).max() > 0.1


def test_entries_add_up_and_any_part_can_be_drawn() -> None:
    scenario = with_list(*LIST)
    expected = sum(formula(entry, 16 + place) for place, entry in enumerate(LIST) if place)
    whole = drawn(scenario)
    np.testing.assert_allclose(whole, expected, rtol=0, atol=1e-5)
    for first, count in [(0, 1), (1, 200), (137, 64), (640, 65), (1499, 2)]:
        np.testing.assert_array_equal(drawn(scenario, count, first), whole[first : first + count])
    np.testing.assert_array_equal(fg.simulate(scenario)["disturbance"].values, whole)


def test_a_limit_in_time_leaves_the_noise_as_it_is() -> None:
    noise = {"kind": "noise", "standard_deviation": 1.0, "seed": SEED}
    always, limited = drawn(with_list(noise)), drawn(with_list({**noise, "start": 0.2, "end": 0.9}))
    np.testing.assert_array_equal(limited[200:900], always[200:900])
    assert not limited[:200].any()
    assert not limited[900:].any()


def test_added_noise_is_independent_and_follows_the_seed() -> None:
    noise = {"kind": "noise", "standard_deviation": 1.0}
    first = drawn(with_list({**noise, "seed": 1}), 20_000)
    both = drawn(with_list({**noise, "seed": 1}, noise), 20_000)
    added = both - first
    assert abs(np.corrcoef(first[:, 0], added[:, 0])[0, 1]) < 0.03
    np.testing.assert_allclose(added.std(axis=0), 1.0, atol=0.02)
    setup = core_setup(with_list({**noise, "seed": 1}, noise))
    setup.seed = 2
    other = _core.disturbance(setup, 0, 20_000)
    np.testing.assert_array_equal(other, drawn(with_list({**noise, "seed": 2}, noise), 20_000))


@pytest.mark.parametrize(
    ("entry", "variance"),
    [
        ({"kind": "vibration", "psd": PSD}, None),
        ({"kind": "vibration", "psd": [[5.0, 0.1], [50.0, 0.1]]}, 4.5),
        ({"kind": "vibration", "psd": [[5.0, 0.1], [50.0, 0.01]]}, 0.5 * math.log(10)),
        ({"kind": "noise", "standard_deviation": 1.5, "band": [20.0, 50.0]}, 2.25),
        ({"kind": "noise", "density": 0.2, "band": [20.0, 50.0]}, 6 / math.pi),
    ],
)
def test_the_mean_square_of_a_spectrum_is_its_integral(entry: Entry, variance: float | None) -> None:
    if variance is None:
        frequency = np.geomspace(PSD[0][0], PSD[-1][0], 200_001)
        density = np.exp(np.interp(np.log(frequency), *np.log(np.transpose(PSD))))
        variance = float(np.trapezoid(density, frequency))
    d = drawn(with_list({**entry, "seed": 3}), 400_000)
    np.testing.assert_allclose((d**2).mean(axis=0), variance, rtol=0.015)
    assert abs((d[:, 0] * d[:, 1]).mean()) < 0.02 * variance
    assert 2.8 < (d[:, 0] ** 4).mean() / variance**2 < 3.1  # nearly Gaussian: 3 - 3/128


def test_the_spectrum_of_vibration_is_the_given_one() -> None:
    found = []
    for seed in range(60):
        d = drawn(with_list({"kind": "vibration", "psd": PSD, "seed": seed}), 16_384)
        frequency, density = signal.welch(d[:, 0], 2 * math.pi / STEP, nperseg=16_384)
        found.append(density)
    mean = np.mean(found, axis=0)
    for low, high in [(4, 8), (8, 16), (24, 48), (48, 96), (96, 180)]:
        inside = (frequency >= low) & (frequency < high)
        expected = np.exp(np.interp(np.log(frequency[inside]), *np.log(np.transpose(PSD))))
        np.testing.assert_allclose(mean[inside].mean(), expected.mean(), rtol=0.12)
    assert mean[frequency > 230].max() < 1e-4 * mean.max()


@pytest.mark.parametrize("lanes", [1, *_core.lane_counts()])
def test_runs_in_lanes_have_the_same_disturbance_as_single_ones(lanes: int) -> None:
    """With the disturbance shared by all lanes, and with another one in each."""
    runs = [with_list(*LIST) for _ in range(3)] + [with_list({**entry, "seed": 2}) for entry in ENTRIES.values()]
    runs += [with_list({"kind": "none", "seed": seed}, ENTRIES["vibration"]) for seed in range(3)]
    params = _core.MetricsParams()
    params.transient = 0.5
    alone = np.array([_core.measure_runs([core_setup(run)], params, 1, 1, False)[0] for run in runs])
    together = _core.measure_runs([core_setup(run) for run in runs], params, 2, lanes, False)
    np.testing.assert_allclose(together, alone, rtol=1e-9, atol=1e-12)
    assert len({row.tobytes() for row in alone}) == len(runs) - 2  # the first three are equal


def test_a_real_device_and_a_loop_in_parts_have_the_same_disturbance() -> None:
    scenario = with_list(*LIST).replace({"device.position_noise": 1e-12})
    run = fg.simulate(scenario)
    np.testing.assert_array_equal(run["disturbance"].values, drawn(scenario))
    loop = fg.Loop(scenario)
    parts = np.concatenate([loop.run(count)["disturbance"].values for count in (1, 500, 77)])
    np.testing.assert_array_equal(parts, drawn(scenario, 578))


def test_a_list_is_read_back_from_toml() -> None:
    scenario = with_list(*LIST)
    text = scenario.to_toml()
    assert text.count("\n[[disturbance]]\n") == len(LIST)
    assert fg.Scenario.from_toml(text) == scenario
    assert fg.Scenario.from_toml(text).to_toml() == text
    assert "[disturbance]\n" in with_list(LIST[1]).to_toml()
    short = '[[disturbance]]\nkind = "none"\n[[disturbance]]\nkind = "step"\namplitude = [1.0, 0.0]\n'
    assert fg.Scenario.from_toml(short).disturbance.added[0].amplitude == (1.0, 0.0)
    one = '[[disturbance]]\nkind = "step"\namplitude = [1.0, 0.0]\n'
    assert fg.Scenario.from_toml(one) == fg.Scenario.from_toml(one.replace("[[", "[").replace("]]", "]", 1))


def test_a_list_keeps_its_entries_when_a_field_of_the_first_is_replaced() -> None:
    changed = with_list(*LIST).replace({"disturbance.seed": 9, "controller.kind": "pid"})
    assert changed.disturbance.seed == 9
    assert changed.disturbance.added == with_list(*LIST).disturbance.added
    assert with_list(*LIST).replace({"disturbance.added": []}).disturbance.added == ()


def test_a_table_is_read_from_a_file_next_to_the_scenario(tmp_path: Path) -> None:
    (tmp_path / "shock.csv").write_text("time,x,y\n0,0,0\n0.1,1,-1\n", encoding="utf-8")
    file = tmp_path / "my.toml"
    block = '[[disturbance]]\nkind = "table"\nfile = "shock.csv"\n'
    file.write_text('[[disturbance]]\nkind = "none"\n' + block, encoding="utf-8")
    added = fg.Scenario.load(file).disturbance.added[0]
    assert (added.file, added.points) == (None, ((0.0, 0.0, 0.0), (0.1, 1.0, -1.0)))
    file.write_text(block, encoding="utf-8")
    assert fg.Scenario.load(file).disturbance.points == added.points
    (tmp_path / "shock.csv").write_text("time,x,y\n0,0\n", encoding="utf-8")
    with pytest.raises(fg.ScenarioError, match=r"disturbance\.file is .*: row 2 must be three finite numbers"):
        fg.Scenario.load(file)


def test_a_function_of_time_adds_a_force() -> None:
    noisy = fg.Scenario.paper().with_disturbance(lambda t: (t, -1.0), every=20)
    assert noisy.disturbance.kinds == "noise + table"
    assert noisy.disturbance.hold == 1e-3
    assert noisy.disturbance.added[0].points[1] == (0.02, 0.02, -1.0)
    twice = noisy.with_disturbance(lambda t: (0.0, 0.0), every=40)
    assert twice.disturbance.kinds == "noise + table + table"
    silent = {"disturbance.kind": "none", "disturbance.seed": 7, "run.units": "SI"}
    newtons = fg.Scenario.paper().replace(silent).with_disturbance(lambda t: (1e-6 + t, 0.0), every=20)
    assert (newtons.disturbance.kinds, newtons.disturbance.seed) == ("table", 7)
    assert newtons.disturbance.points[1] == pytest.approx((0.02, (1e-6 + 2e-5) / 1.8e-7, 0.0))
    with pytest.raises(fg.ScenarioError, match=r"the disturbance at t = 0 is 1\.0: it must be two finite numbers"):
        noisy.with_disturbance(lambda t: 1.0, every=20)


def test_lists_of_tables_differ_field_by_field() -> None:
    one = with_list({"kind": "none"}, {"kind": "sine", "amplitude": [1.0, 0.0]})
    other = with_list({"kind": "none"}, {"kind": "step", "amplitude": [1.0, 0.0]})
    assert one.differences(other) == {"disturbance[1].kind": ("sine", "step")}
    assert with_list({"kind": "none"}).differences(other) == {
        "disturbance[1].kind": (None, "step"),
        "disturbance[1].amplitude": (None, (1.0, 0.0)),
    }


WRONG: list[tuple[list[Any], str]] = [
    (
        [],
        'disturbance is []: it must be a table or a list of 1 to 64 tables; a table with kind = "none" switches it off',
    ),
    ([1.0], "disturbance is [1.0]: it must be a table or a list of 1 to 64 tables"),
    ([{"kind": "none"}] * 65, "it must be a table or a list of 1 to 64 tables"),
    ([{"kind": "pulse"}], "disturbance.width is missing: a pulse must have one"),
    (
        [{"kind": "none", "width": 1.0}],
        'disturbance.width is 1.0: it needs disturbance.kind = "pulse", but disturbance.kind is "none"',
    ),
    ([{"kind": "vibration"}], "disturbance.psd is missing: a vibration must have one"),
    ([{"kind": "table"}], "disturbance.points is missing: a table must have points, or a file of them"),
    ([{"kind": "pulse", "width": 1.0}], "disturbance.amplitude is missing: a pulse must have one, [x, y]; zeros are"),
    ([{"kind": "none"}, {"kind": "sine"}], "disturbance[1].amplitude is missing: a sine must have one"),
    ([{"kind": "noise", "file": "a.csv"}], 'disturbance.file is "a.csv": it needs disturbance.kind = "table"'),
    (
        [{"kind": "step", "amplitude": ["10 g", 0.0]}],
        'disturbance[0].amplitude[0] is "10 g": it is a mass; it must be a force such as "1 uN"; disturbance[0].'
        'quantity = "acceleration" takes an acceleration',
    ),
    (
        [{"kind": "step", "amplitude": [1.0, 1.0], "start": 2.0, "end": 2.0}],
        "disturbance.end is 2.0: it must be greater than disturbance.start",
    ),
    ([{"kind": "step", "start": -1.0}], "disturbance.start is -1.0: it must be at least 0"),
    (
        [{"kind": "noise", "density": 1.0, "band": [2.0, 1.0]}],
        "disturbance.band is [2.0, 1.0]: its second number must be greater",
    ),
    (
        [{"kind": "noise", "density": 1.0, "band": [0.0, 1.0], "hold": 1e-3}],
        "disturbance.hold is 0.001: it must be left out with disturbance.band",
    ),
    (
        [{"kind": "noise", "density": 1.0, "band": [0.0, 4000.0]}],
        "disturbance.band reaches 4000.0: it must reach at most pi over run.step, which is 3141.59",
    ),
    (
        [{"kind": "vibration", "psd": [[0.0, 1.0], [1.0, 1.0]]}],
        "disturbance.psd is [[0.0, 1.0], [1.0, 1.0]]: it must be a list of 2 to 100000 pairs [frequency, density] of "
        "numbers from 1e-60 to 1e+60 whose frequencies rise",
    ),
    ([{"kind": "table", "points": [[0.0, 1.0]]}], "it must be a list of 1 to 100000 triples [time, x, y]"),
    ([{"kind": "none"}, {}], "disturbance[1].kind is missing: it must be given"),
    (
        [{"kind": "none"}, {"kind": "puls"}],
        'disturbance[1].kind is "puls": it must be none, noise, sine, step, pulse, ',
    ),
    ([{"kind": "none"}, {"kind": "none", "seed": 1}], "disturbance[1].seed is not a known field"),
    ([{"kind": "none"}, {"kind": "none", "widht": 1.0}], "did you mean disturbance[1].width?"),
    ([{"kind": "none"}, {"kind": "pulse"}], "disturbance[1].width is missing: a pulse must have one"),
    ([{"kind": "none"}, {"kind": "none", "start": -1.0}], "disturbance[1].start is -1.0: it must be at least 0"),
    (
        [{"kind": "none"}, {"kind": "noise", "density": 1.0, "hold": 1.5e-3}],
        "disturbance[1].hold is 0.0015: it must be a whole number of run.step",
    ),
    (
        [{"kind": "none"}, {"kind": "vibration", "psd": [[1.0, 1.0], [1e4, 1.0]]}],
        "disturbance[1].psd reaches 10000.0: it must reach at most pi over run.step",
    ),
]


@pytest.mark.parametrize(("entries", "message"), WRONG)
def test_wrong_entries_are_refused_in_one_sentence(entries: list[Any], message: str) -> None:
    with pytest.raises(fg.ScenarioError) as raised:
        PAPER.replace({"disturbance": entries})
    assert message in str(raised.value)


def test_what_controllers_assume_follows_from_the_sum() -> None:
    scenario = with_list(*LIST)
    assert guard(scenario).force_tolerance > np.abs(drawn(scenario)).max()
    exact = with_list(
        {"kind": "step", "amplitude": [1.0, -2.0]}, {"kind": "pulse", "amplitude": [3.0, 0.0], "width": 1.0}
    )
    assert guard(exact).force_tolerance == 1e-5 + 5.0
    # White noise of the density of the paper's, in a band or not.
    density = STEP
    paper = with_list({"kind": "noise", "density": density})
    band = with_list({"kind": "noise", "density": density, "band": [0.0, 100.0]})
    two = with_list({"kind": "none"}, *[{"kind": "noise", "density": density / 2}] * 2)
    for other in (band, two):
        np.testing.assert_allclose(datasheet(other).force_noise, datasheet(paper).force_noise, rtol=1e-12)


def test_the_bound_of_the_rate_is_that_of_white_noise_only() -> None:
    one = noise_of(with_list({"kind": "noise", "density": 0.2}))
    two = noise_of(with_list({"kind": "noise", "density": 0.1}, {"kind": "noise", "density": 0.1}))
    assert one is not None
    assert two is not None
    assert one.force == two.force == 0.2
    assert noise_of(with_list({"kind": "noise", "density": 0.1}, ENTRIES["pulse"])) is None
    assert noise_of(with_list({"kind": "none"}, {"kind": "none"})) is None


# -- Share of an acceleration ------------------------------------------------------------------------------------------

SHARES = (0.25, -0.5)
SHARED: dict[str, Entry] = {
    "sine": {"amplitude": [0.25 * 0.3, -0.5 * 0.4]},
    "step": {"amplitude": [0.25 * 2.0, -0.5 * -1.0]},
    "pulse": {"amplitude": [0.25 * 30.0, -0.5 * -4.0]},
    "vibration": {"weights": [0.25, 0.25]},
    "table": {"points": [[0.0, 0.0, -1.0], [0.1, 0.25, 0.5], [0.25, 0.125, -1.0]]},
}


@pytest.mark.parametrize("name", SHARED)
def test_an_acceleration_drives_each_mode_by_its_share_and_a_force_as_it_is(name: str) -> None:
    force = ENTRIES[name]
    shared = {"device.acceleration_share": SHARES, "disturbance": [LIST[0], {**force, "quantity": "acceleration"}]}
    np.testing.assert_array_equal(drawn(PAPER.replace(shared)), drawn(with_list(LIST[0], {**force, **SHARED[name]})))
    kept = {"device.acceleration_share": SHARES, "disturbance": [LIST[0], force]}
    np.testing.assert_array_equal(drawn(PAPER.replace(kept)), drawn(with_list(LIST[0], force)))


def test_the_share_also_makes_noise_smaller_and_what_a_controller_knows_of_it() -> None:
    def made(share: object, **entry: object) -> fg.Scenario:
        entries = [{"seed": SEED, "kind": "noise", "quantity": "acceleration", **entry}]
        return PAPER.replace({"device.acceleration_share": share, "disturbance": entries})

    whole, half = (made(share, standard_deviation=2.0) for share in (None, (0.5, -0.5)))
    np.testing.assert_array_equal(drawn(half), 0.5 * drawn(whole))
    assert datasheet(half).force_noise == 0.5 * datasheet(whole).force_noise
    assert (
        guard(half.replace({"guard.checked": True})).force_tolerance
        < 0.51 * guard(whole.replace({"guard.checked": True})).force_tolerance
    )
    banded, shared = (made(share, density=0.01, band=[10.0, 70.0]) for share in (None, (1.0, 0.5)))
    np.testing.assert_allclose(drawn(shared), [1.0, 0.5] * drawn(banded), rtol=1e-12)
    dense, thin = (made(share, density=0.01) for share in (None, (0.5, 0.5)))
    np.testing.assert_allclose(drawn(thin), 0.5 * drawn(dense), rtol=1e-15)
    with pytest.raises(fg.ScenarioError, match=r"share is \[1.0, 0.5\]: its numbers must have the same size"):
        made((1.0, 0.5), standard_deviation=2.0)
