"""The live page: its state in node, and the page itself in Chromium."""

from __future__ import annotations

import json
import re
import shlex
import subprocess
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import fracgyro as fg
import numpy as np
import pytest
import xarray as xr
from browser import Quiet, served, violations, watched
from children import PATIENCE
from embedded import need
from fracgyro.cli.simulate import _change
from fracgyro.export.live import FACE, bundled, laws, page, page_data, scenario_data
from fracgyro.export.web import document
from fracgyro.scenario.kinds import KINDS
from matplotlib import image
from shared import live_page

# -- The page's state, in node -------------------------------------------------------------------------------------

PRELUDE = """
import { readFileSync } from "node:fs";
const folder = process.argv[1];
const data = JSON.parse(readFileSync(process.argv[2]));
const state = await import(folder + "/live/state.mjs");
const { presets } = await import(folder + "/live/presets.mjs");
const at = (hash) => state.fromHash(data, presets, hash);
"""


@pytest.fixture(scope="session")
def data_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    need("WebAssembly")
    path = tmp_path_factory.mktemp("live") / "data.json"
    path.write_text(json.dumps(page_data()), encoding="utf-8")
    return path


def in_node(data_file: Path, code: str) -> str:
    command = ["node", "--input-type=module", "-e", PRELUDE + code, str(FACE), str(data_file)]
    ran = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE)
    assert ran.returncode == 0, ran.stderr
    return ran.stdout


ADDRESSES = {
    "the first": "",
    "another rate": "plant.angular_rate=50.25",
    "noise": "disturbance.standard_deviation=0.3&disturbance.seed=7",
    "no noise": "disturbance.kind=none",
    "a sine of noise": "disturbance.kind=sine&disturbance.amplitude.x=5&disturbance.frequency.y=3",
    "gains": "a.controller.order=0.6&a.controller.fractional_gain.y=12.5&a.controller.force_limit=2000",
    "arrays": "a.adaptation.bound_gain[1]=2&a.adaptation.initial_rate=0.05",
    "a deviation": "plant.stiffness_deviation.xx=2.5&plant.damping_deviation.xy=1e-7",
    "a step": "run.step=0.0005",
    "held noise": "disturbance.hold_steps=3&run.step=0.002",
    "a sine": "rate=sine",
    "positions": "sensors=positions",
    "a drawn figure": "figure=1+0,0+1,-1+-1",
    "a drawn figure, from positions": "figure=0+0,1+0.5,0+1.25&sensors=positions&b=yours",
    "a drawn figure, after another motion": "figure=1+0,0+1,-1+-1&reference.amplitude.x=2&reference.offset.y=0.5",
    "both, with another strength of noise": "rate=sine&sensors=positions&disturbance.standard_deviation=2",
    **{f"law {law}": f"a={law}" for law in laws()},
    **{f"law {law}, from positions": f"a={law}&sensors=positions" for law in ("least_squares", "joint", "lqg")},
}


def test_toml_and_command_are_the_scenario_that_is_run(data_file: Path) -> None:
    """Every number passed to the module equals Python's."""
    code = f"""
    const said = Object.fromEntries(Object.entries({json.dumps(ADDRESSES)}).map(([name, rest]) => {{
      const of = at(`#follow&a=corrected${{rest && "&" + rest}}`);
      return [name, {{
        scenario: state.scenarioOf(data, of, "a"),
        toml: state.toToml(data, of, "a"),
        command: state.toCommand(data, of, "a"),
      }}];
    }}));
    console.log(JSON.stringify(said));
    """
    for name, said in json.loads(in_node(data_file, code)).items():
        expected = said["scenario"]
        for made in (fg.Scenario.from_toml(said["toml"]), scenario_of(said["command"])):
            found = document(made)
            assert acting(found["settings"]) == acting(expected["settings"]), name
            assert found.get("device") == expected.get("device"), name
            assert found.get("reference") == expected.get("reference"), name


def scenario_of(command: str) -> fg.Scenario:
    program, verb, *words = shlex.split(command)
    assert (program, verb, *words[::2]) == ("fracgyro", "simulate", *["--set"] * (len(words) // 2))
    return fg.Scenario.paper().replace(dict(map(_change, words[1::2])))


def acting(settings: dict[str, Any]) -> dict[str, Any]:
    """Without the guard, which no closed loop asks."""
    return {name: value for name, value in settings.items() if not name.startswith("guard.")}


def test_an_address_says_what_differs_and_comes_back(data_file: Path) -> None:
    code = f"""
    for (const rest of {json.dumps(list(ADDRESSES.values()))}) {{
      const of = at(`#follow&b=pid${{rest && "&" + rest}}`);
      const again = state.toHash(presets, of);
      console.log(JSON.stringify(at(again)) === JSON.stringify(of), again === state.toHash(presets, at(again)));
    }}
    console.log(state.toHash(presets, at("#follow&plant.angular_rate=50&a.controller.order=0.5&speed=0.5")));
    console.log(presets.every(({{ key }}) => state.toHash(presets, at("#" + key)) === "#" + key), at("").preset);
    """
    *rounds, said, presets = in_node(data_file, code).splitlines()
    assert set(rounds) == {"true true"}
    assert said == "#follow&speed=0.5&plant.angular_rate=50&a.controller.order=0.5"
    assert presets == "true follow"


@pytest.fixture(scope="module")
def preset_runs(data_file: Path) -> dict[str, list[fg.Scenario]]:
    """The scenarios of each preset, for as long as two swings of a rate that moves."""
    code = """
    const runs = (of) => state.RUNS.filter((run) => ![state.NO_LAW, state.YOURS].includes(of[run]));
    console.log(JSON.stringify(Object.fromEntries(presets.map(({ key }) => {
      const of = at("#" + key);
      return [key, runs(of).map((run) => state.toToml(state.dataOf(data, presets, of), of, run))];
    }))));
    """
    said = json.loads(in_node(data_file, code))
    return {
        key: [fg.Scenario.from_toml(toml).replace({"run.duration": 42.0}) for toml in tomls]
        for key, tomls in said.items()
    }


def rms(run: xr.Dataset, begin: float, end: float) -> np.ndarray:
    """Tracking error, on each axis."""
    errors: np.ndarray = run["error"].sel(time=slice(begin, end)).values
    return np.sqrt((errors**2).mean(axis=0))


def rate_error(run: xr.Dataset) -> np.ndarray:
    """rad/s."""
    true = run["angular_rate"].values if "angular_rate" in run else 0.1
    off: np.ndarray = 1e3 * (run["rate_estimate"].values - true)
    return off


def test_what_the_presets_say_is_so(preset_runs: dict[str, list[fg.Scenario]]) -> None:
    def run(key: str) -> list[xr.Dataset]:
        return [fg.simulate(scenario) for scenario in preset_runs.pop(key)]

    def deviation(of: xr.Dataset, time: float | slice) -> float:
        method = None if isinstance(time, slice) else "nearest"
        return 1e3 * float(of["rate_deviation"].sel(time=time, method=method).mean())

    printed, least_squares = run("follow")  # moved: in Chromium, below
    assert (printed["rate_estimate"] == printed["rate_estimate"][0]).all()

    kalman, gradient = (scenario.replace({"run.record_every": 10}) for scenario in preset_runs.pop("dual-mass"))
    assert kalman.plant.angular_rate == pytest.approx(np.deg2rad(300.0), rel=1e-6)
    unit = 1e3 * kalman.plant.scales.time
    off = []
    for scenario in (kalman, gradient):
        loop, scale = fg.Loop(scenario), np.rad2deg(scenario.plant.scales.rate)
        found = loop.run(round(25.0 / unit / scenario.run.step))["rate_estimate"].values
        loop.set({"plant.angular_rate": -scenario.plant.angular_rate})
        reversed_ = loop.run(round(0.5 / unit / scenario.run.step))["rate_estimate"].values
        off.append((scale * found[2 * len(found) // 5 :] - 300.0, scale * reversed_ + 300.0))
    assert np.abs(off[0][0]).max() < 0.3
    assert rms_of(off[0][0]) < 0.2
    assert rms_of(off[1][0]) > 200.0
    assert min(rms_of(after) for _, after in off) > 200.0

    (thrown,) = run("thrown")
    assert np.abs(rate_error(thrown)).max() > 200 * 100.0
    assert 40 < abs(rate_error(thrown)[20_000]) < 60

    (first,) = run("first")
    for time, percent in ((1.0, 10.0), (20.0, 2.0)):
        assert 0.8 * percent < deviation(first, time) < percent
        assert abs(rate_error(first)[round(time / 1e-3)]) < 1.5 * percent

    slow, fast = run("moving")
    assert rms_rate(fast, 21.0) < 0.5 * rms_rate(slow, 21.0)
    for followed in (slow, fast):
        band = 1e3 * followed["rate_deviation"].values[21_000:]
        assert (np.abs(rate_error(followed)[21_000:]) < 4 * band).all()
    assert deviation(slow, slice(21.0, None)) > 1.5 * deviation(fast, slice(21.0, None))

    squares, filtered = run("sensors")
    assert deviation(squares, 20.0) == pytest.approx(75.0, rel=0.05)
    assert deviation(filtered, 20.0) == pytest.approx(5.0, rel=0.1)
    assert rms_rate(filtered, 17.0) < 10.0  # D and K are learned until then

    deviations = []
    for scenario in preset_runs.pop("allan"):
        numbers = rate_error(fg.simulate(scenario.replace({"run.duration": 140.0, "run.record_every": 10})))[6_000:]
        deviations.append(allan_deviation(numbers, [1, 10, 30, 100, 150, 300, 1000]))
    kalman, squares = deviations
    assert (kalman < 4.0).all()
    assert 30.0 < squares[3] < 45.0
    assert 30.0 < squares[4] < 45.0
    assert squares.max() < 45.0

    squares, corrected = run("draw")
    assert rms_rate(squares, 10.0) < 10.0
    assert rms_rate(corrected, 30.0) > 100.0

    (paper,) = preset_runs.pop("your-own")
    assert rms_rate(fg.simulate(paper, controller=Example(paper)), 10.0) < 20.0
    assert rms_of(rate_error(fg.simulate(paper))[10_000:20_000]) > 200.0

    corrected, least_squares = run("quiet")
    with_noise = fg.simulate(fg.Scenario.paper().replace({"run.duration": 42.0}))
    assert np.abs(rate_error(least_squares)[1000:]).max() < 0.1
    assert rms_rate(corrected, 5.0) == pytest.approx(rms_rate(with_noise, 5.0), rel=0.2)

    fractional, ordinary = run("order")
    assert (rms(fractional, 0, 10) < rms(ordinary, 0, 10)).all()
    assert (rms(ordinary, 10, 20) < rms(fractional, 10, 20)).all()

    paper, lqg = run("lqg")
    for window in ((0, 10), (10, 20)):
        assert (rms(lqg, *window) < rms(paper, *window) / 3).all()

    corrected_law, pid = preset_runs.pop("long-step")
    assert corrected_law.run.step == 6e-3
    with pytest.raises(fg.DivergedError, match=r"t = 1\.1"):
        fg.simulate(corrected_law)
    assert (rms(fg.simulate(pid), 10, 20) < 1e-3).all()
    assert not preset_runs, "a preset that nobody checks"


class Example:
    """The function that the page begins with (integrations/web/live/example.mjs)."""

    def __init__(self, scenario: fg.Scenario) -> None:
        self.damping, self.stiffness = (matrix.tolist() for matrix in scenario.plant.nondimensional()[:2])
        self.bandwidth = 0.2 / scenario.run.step
        self.rate = 0.0

    def __call__(self, s: fg.Sample) -> tuple[float, float]:
        d, k, w = self.damping, self.stiffness, self.bandwidth
        (x, y), (vx, vy), (ex, ey), (dx, dy), (ax, ay) = (
            s.position,
            s.velocity,
            s.error,
            s.error_rate,
            s.reference_acceleration,
        )
        self.rate += 0.1 * ((dx + 0.5 * w * ex) * vy - (dy + 0.5 * w * ey) * vx)
        ux = ax + d[0] * vx + d[1] * vy + k[0] * x + k[1] * y - 2 * self.rate * vy
        uy = ay + d[1] * vx + d[2] * vy + k[1] * x + k[2] * y + 2 * self.rate * vx
        return ux - w * w * ex - 1.4 * w * dx, uy - w * w * ey - 1.4 * w * dy

    def report(self) -> dict[str, float]:
        return {"rate_estimate": self.rate}


def rms_rate(run: xr.Dataset, begin: float) -> float:
    """From there on, rad/s."""
    return float(np.sqrt((rate_error(run)[round(begin / 1e-3) :] ** 2).mean()))


def rms_of(numbers: np.ndarray) -> float:
    return float(np.sqrt((numbers**2).mean()))


def allan_deviation(numbers: np.ndarray, sizes: list[int]) -> np.ndarray:
    """Overlapping, at averages of these numbers of samples."""
    found = []
    for size in sizes:
        means = np.lib.stride_tricks.sliding_window_view(numbers, size).mean(axis=1)
        found.append(np.sqrt(((means[size:] - means[:-size]) ** 2).mean() / 2))
    return np.array(found)


def test_spectrum_and_allan_deviation_are_those_of_numpy(data_file: Path) -> None:
    numbers = np.cumsum(np.random.default_rng(5).normal(size=5_000)) / 50 + np.sin(np.arange(5_000) / 3)
    code = f"""
    const {{ allan, spectrum }} = await import(folder + "/live/spectra.mjs");
    const numbers = {numbers.tolist()};
    const few = [allan([1, 2, 3], 0.5), spectrum([1, 2, 3], 0.5)];
    console.log(JSON.stringify([allan(numbers, 0.5), spectrum(numbers, 0.5), few]));
    """
    deviations, densities, few = json.loads(in_node(data_file, code))
    assert few == [[], []]
    times, found = np.array(deviations).T
    assert (times[0], times[-1]) == (0.5, pytest.approx(500.0, rel=0.3))
    np.testing.assert_allclose(found, allan_deviation(numbers, [round(2 * time) for time in times]), rtol=1e-9)
    length = 1024
    window = np.sin(np.pi * (np.arange(length) + 0.5) / length) ** 2
    starts = range(0, len(numbers) - length + 1, length // 2)
    parts = np.array([numbers[start : start + length] for start in starts])
    power = np.abs(np.fft.rfft(window * (parts - parts.mean(axis=1, keepdims=True)))) ** 2
    expected = np.sqrt(2 * 0.5 * power.mean(axis=0) / (window**2).sum())
    frequencies, found = np.array(densities).T
    np.testing.assert_allclose(frequencies, np.fft.rfftfreq(length, 0.5)[2:-1])
    np.testing.assert_allclose(found, expected[2:-1], rtol=1e-9)


FIGURE = [(1.0, 0.2), (-0.5, 1.0), (-1.0, -1.0), (0.5, -0.75)]


def test_a_drawn_figure_is_the_fourier_series_of_its_closed_line(data_file: Path) -> None:
    text = ", ".join(f"{x} {y}" for x, y in FIGURE)
    code = f"""
    const figure = await import(folder + "/live/figure.mjs");
    const line = Array.from({{ length: 500 }}, (_, i) => [Math.cos(i / 79), Math.sin(i / 79)]);
    const drawn = figure.pointsOf(figure.textOf(line));
    const few = [figure.textOf(line.slice(0, 20)), figure.textOf([[0, 0]])];
    console.log(JSON.stringify([figure.seriesOf(figure.pointsOf("{text}"), 2.0), drawn, few, figure.FIGURES]));
    """
    series, drawn, few, ready = json.loads(in_node(data_file, code))
    corners = np.array([*FIGURE, FIGURE[0]])
    ends = np.append(0.0, np.cumsum(np.hypot(*np.diff(corners, axis=0).T)))
    at = np.arange(256) * ends[-1] / 256
    samples = np.array([np.interp(at, ends, axis) for axis in corners.T])
    expected = np.fft.rfft(samples) / 256
    np.testing.assert_allclose(series["mean"], expected[:, 0].real, atol=1e-6)
    amplitude, frequency, phase = np.array(series["terms"]).reshape(8, 3, 2).transpose(1, 2, 0)
    np.testing.assert_array_equal(frequency, np.tile(2.0 * np.arange(1, 9), (2, 1)))
    np.testing.assert_allclose(-0.5j * amplitude * np.exp(1j * phase), expected[:, 1:9], atol=2e-6)
    assert len(drawn) == 40
    np.testing.assert_allclose(np.hypot(*np.array(drawn).T), 1.0, atol=0.01)
    assert few == ["", ""]
    assert set(ready) == {"circle", "square", "star", "heart"}


WRONG = {
    "#nothing": "preset is nothing: it must be one of ",
    "#follow&a=none": "a is none: it must be one of printed, corrected, ",
    "#follow&speed=1000": "speed is 1000: it must be from 0.1 to 40",
    "#follow&speed=x": "speed is x: it must be from 0.1 to 40",
    "#follow&window=7": "window is 7: it must be one of 2, 5, 20, 80",
    "#follow&figure=1+0,0+1": "figure has 2 points: it must have 3 to 200, such as 1 0, 0 1, -1 0",
    "#follow&figure=1+0,0+1,x": "figure has the point x: it must be x and y from −2 to 2, such as 1 0",
    "#follow&figure=1+0,0+1,3+0": "figure has the point 3 0: it must be x and y from −2 to 2, such as 1 0",
    "#follow&figure=1+0,1+0,1+0": "figure has no length: its points must differ, such as 1 0",
    "#dual-mass&figure=1+0,0+1,-1+0": "figure is nothing that this page can set",
    "#follow&b=yours&b.controller.order=0.5": "b.controller.order is not a setting of a function of your own",
    "#follow&plant.mass=1": "plant.mass is nothing that this page can set",
    "#follow&controller.order=1": "controller.order is nothing that this page can set",
    "#follow&a.plant.angular_rate=1": "a.plant.angular_rate is nothing that this page can set",
    "#follow&plant.stiffness.xx=1": "plant.stiffness.xx is nothing that this page can set",
    "#follow&toString=1": "toString is nothing that this page can set",
    "#follow&b.controller.damping_ratio=1": "b.controller.damping_ratio is not a setting of the paper with ",
}


def test_an_address_that_no_page_has_is_refused_in_one_sentence(data_file: Path) -> None:
    code = f"""
    for (const hash of {json.dumps(list(WRONG))}) {{
      try {{ at(hash); console.log("taken"); }} catch (e) {{ console.log(`${{e.name}}: ${{e.message}}`); }}
    }}
    """
    for found, sentence in zip(in_node(data_file, code).splitlines(), WRONG.values(), strict=True):
        assert found.startswith(f"RangeError: {sentence}")


def test_every_kind_of_controller_is_offered_with_all_of_its_own_settings(data_file: Path) -> None:
    code = """
    for (const key of Object.keys(data.laws)) {
      const of = at(`#follow&a=${key}`);
      const names = state.settingNames(data, state.kindOf(data, of, "a"));
      const { settings } = state.scenarioOf(data, of, "a");
      console.log(state.kindOf(data, of, "a"), names.every((name) => settings[name] !== undefined));
    }
    """
    kinds, complete = zip(*(line.split() for line in in_node(data_file, code).splitlines()), strict=True)
    assert set(kinds) == set(KINDS)
    assert set(complete) == {"true"}


def test_scripts_that_become_one_declare_no_name_twice(tmp_path: Path) -> None:
    for script in ("live", "worker"):
        whole = bundled(FACE / "live" / f"{script}.mjs")
        assert not re.search(r"^(import|export) ", whole, re.MULTILINE)
    (tmp_path / "one.mjs").write_text("export const a = 1;\n", encoding="utf-8")
    (tmp_path / "two.mjs").write_text('import { a } from "./one.mjs";\nfunction a() {}\n', encoding="utf-8")
    with pytest.raises(ValueError, match=r"^two.mjs declares a twice"):
        bundled(tmp_path / "two.mjs")


# -- The page in Chromium --------------------------------------------------------------------------------------------

MOST_BYTES = 300_000
STILL = {"reduced_motion": "reduce"}  # starts paused at t = 0


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    need("browser")
    return live_page(tmp_path_factory)


@pytest.fixture(scope="session")
def address(folder: Path) -> Iterator[str]:
    with served(folder) as found:
        yield found


@contextmanager
def opened(browser: Any, address: str, hash: str = "", **options: Any) -> Iterator[Any]:
    """The page after its first sample; it must print no messages and send no external requests."""
    page = browser.new_page(**{"viewport": {"width": 1280, "height": 800}, **STILL, **options})
    page.set_default_timeout(1000 * PATIENCE)
    faults = watched(page, address)
    page.goto(address + hash)
    ready(page, playing=options.get("reduced_motion") == "no-preference")
    yield page
    page.close()
    assert faults == []


def ready(page: Any, playing: bool = False) -> None:
    wanted = "" if playing else "paused"
    page.wait_for_function(f"/^t = .*{wanted}/.test(document.getElementById('clock').textContent)")


def time(page: Any) -> float:
    """Time of the displayed sample, ms."""
    found = re.match(r"t = ([\d.]+) ms", page.text_content("#clock"))
    assert found
    return float(found[1])


def run_to(page: Any, until: float) -> int:
    """Play to a sample at this time or later; return its time."""
    page.keyboard.press(" ")
    page.wait_for_function("!document.getElementById('clock').textContent.includes('paused')")
    page.wait_for_function(f"parseFloat(document.getElementById('clock').textContent.slice(4)) >= {until}")
    page.keyboard.press(" ")
    page.wait_for_function("document.getElementById('clock').textContent.includes('paused')")
    return round(time(page) / 1e-3)


def value(page: Any, channel: str, run: str = "a") -> str:
    found: str = page.text_content(f'td[data-run="{run}"][data-channel="{channel}"]')
    return found.replace("−", "-")


def digits(number: float) -> str:
    """Numbers as displayed by the page."""
    return str(float(f"{number:.3e}"))


def test_the_page_is_one_small_file(folder: Path) -> None:
    assert [path.name for path in folder.iterdir()] == ["index.html"]
    assert (folder / "index.html").stat().st_size < MOST_BYTES


def test_it_runs_from_a_file_too(browser: Any, folder: Path) -> None:
    with opened(browser, (folder / "index.html").as_uri()) as page:
        page.keyboard.press(".")
        page.wait_for_function("document.getElementById('clock').textContent.startsWith('t = 0.001 ms')")


def test_what_it_shows_is_what_python_computes(browser: Any, address: str) -> None:
    with opened(browser, address, "#follow&a=corrected&b=least_squares&speed=40&disturbance.seed=3") as page:
        for until in (1.0, 5.0):
            sample = run_to(page, until)
            for run, (_, law) in (("a", laws()["corrected"]), ("b", laws()["least_squares"])):
                at = fg.simulate(law.replace({"disturbance.seed": 3, "run.duration": 80.0})).isel(time=sample)
                scale = law.plant.scales.rate
                expected = {
                    "rate": law.plant.angular_rate,
                    "rate_estimate": scale * float(at["rate_estimate"]),
                    "error.x": abs(float(at["error"][0])),
                    "control.y": float(at["control"][1]),
                }
                if "rate_deviation" in at:
                    expected["rate_deviation"] = scale * float(at["rate_deviation"])
                for channel, number in expected.items():
                    assert str(float(value(page, channel, run))) == digits(number), channel


def test_the_preset_of_another_gyroscope_runs_it_in_degrees_a_second(browser: Any, address: str) -> None:
    scenario = fg.Scenario.shipped("dual_mass")
    milliseconds = 1e3 * scenario.run.step * scenario.plant.scales.time
    scale = np.rad2deg(scenario.plant.scales.rate)
    runs = {
        run: fg.simulate(scenario.replace({**changes, "run.duration": 1200.0}))
        for run, changes in (("a", {}), ("b", {"adaptation.kind": "gradient"}))
    }
    with opened(browser, address, "#dual-mass&speed=2") as page:
        assert page.text_content("#rate-value") == "300 deg/s"
        run_to(page, 0.5)
        sample = round(time(page) / milliseconds)
        assert float(value(page, "rate")) == pytest.approx(300.0, abs=0.1)
        for run, expected in runs.items():
            at = expected.isel(time=sample)
            assert str(float(value(page, "rate_estimate", run))) == digits(scale * float(at["rate_estimate"]))
        page.click("#rate-reverse")
        page.wait_for_function("document.getElementById('rate-value').textContent === '−300 deg/s'")
        page.get_by_text("Copy B as TOML").click()
        copied = fg.Scenario.from_toml(page.input_value("#text"))
        assert (copied.adaptation.kind, copied.plant.angular_rate) == ("gradient", -scenario.plant.angular_rate)
        assert copied.device == scenario.device
        page.click('a[href="#follow"]')
        page.wait_for_function("document.getElementById('rate-value').textContent === '100 rad/s'")
        assert page.locator("#window option").first.text_content() == "2 ms"


def settled(page: Any, begin: float) -> tuple[float, float]:
    """Estimate of the second run and its deviation, when that is small; a slow machine pauses later than asked."""
    for until in (begin, begin + 4.0, begin + 8.0):
        run_to(page, until)
        estimate, deviation = float(value(page, "rate_estimate", "b")), float(value(page, "rate_deviation", "b"))
        if 4 * deviation < 40.0:
            break
    return estimate, deviation


def test_the_estimate_follows_the_slider_within_its_band_and_the_printed_law_does_not(
    browser: Any, address: str
) -> None:
    with opened(browser, address, "#follow&speed=40") as page:
        page.fill("#rate", "-200")
        page.focus("#plot-list")
        estimate, deviation = settled(page, 15.0)
        assert float(value(page, "rate")) == -200.0
        assert abs(estimate + 200.0) < 4 * deviation < 40.0
        assert float(value(page, "rate_estimate", "a")) == 95.0
        page.click("#rate-reverse")
        page.focus("#plot-list")
        estimate, deviation = settled(page, 35.0)
        assert abs(estimate - 200.0) < 4 * deviation < 40.0


def test_what_is_moved_while_it_runs_acts_as_in_a_loop_in_python(browser: Any, address: str) -> None:
    with opened(browser, address, "#follow&a=corrected&b=none&speed=40") as page:
        page.click("#rate-reverse")
        page.get_by_text("All settings of this controller").click()
        page.get_by_label("layer_thickness").fill("0.03")
        page.keyboard.press("Enter")
        page.focus("#plot-list")
        sample = run_to(page, 3.0)
        shown = value(page, "error.y")
    loop = fg.Loop(fg.Scenario.paper())
    loop.run(1)
    loop.set({"plant.angular_rate": -100.0, "controller.layer_thickness": 0.03})
    at = loop.run(sample).isel(time=-1)
    assert str(float(shown)) == digits(abs(float(at["error"][1])))


DRAWN = """
(canvas) => {
  const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  const near = (color) => {
    let count = 0;
    for (let i = 0; i < data.length; i += 4) {
      count += data[i + 3] > 200 && color.every((part, k) => Math.abs(data[i + k] - part) < 40);
    }
    return count;
  };
  return [near([0x00, 0x64, 0xa6]), near([0xc2, 0x4e, 0x00])];
}
"""


def test_the_plots_draw_both_runs_and_their_cursor_shows_a_sample(browser: Any, address: str) -> None:
    with opened(browser, address, "#follow&a=corrected&speed=40&window=2", color_scheme="light") as page:
        sample = run_to(page, 3.0)
        for canvas in page.query_selector_all(".plot canvas, #scene"):
            assert min(canvas.evaluate(DRAWN)) > 100
        page.focus("#plot-list")
        for _ in range(3):
            page.keyboard.press("Shift+ArrowLeft")
        page.wait_for_function("document.querySelector('caption').textContent.includes('at the cursor')")
        cell = 'td[data-run="a"][data-channel="error.x"]'
        # Both at once: a press may be shown later than the one before.
        caption, error = page.evaluate(f"['caption', '{cell}'].map((one) => document.querySelector(one).textContent)")
        found = re.search(r"t = ([\d.]+) ms", caption)
        assert found
        at_cursor = round(float(found[1]) / 1e-3)
        assert at_cursor >= sample - 610  # a request pending at the stop adds to it
        at = fg.simulate(fg.Scenario.paper()).isel(time=at_cursor)
        assert str(float(error)) == digits(abs(float(at["error"][0])))
        page.keyboard.press("Escape")
        page.wait_for_function("!document.querySelector('caption').textContent.includes('at the cursor')")


GAPS = """
(canvas) => {
  const { width, height, data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  const color = (x, y) => data.slice(4 * (y * width + x), 4 * (y * width + x) + 3);
  const near = (one, other) => other.every((part, k) => Math.abs(one[k] - part) < 60);
  const drawn = [];
  for (let x = 0; x < width; ++x) {
    let found = false;
    for (let y = 0; y < height && !found; ++y) {
      found = [[0xc2, 0x4e, 0x00], [0xd9, 0x7b, 0x34]].some((wanted) => near(color(x, y), wanted));
    }
    drawn.push(found);
  }
  const part = drawn.slice(drawn.indexOf(true), drawn.lastIndexOf(true));
  return [part.length, part.filter((found) => !found).length];
}
"""


def test_curves_on_a_logarithmic_scale_have_no_gaps(browser: Any, address: str) -> None:
    with opened(browser, address, "#order&speed=40&window=2", color_scheme="light") as page:
        run_to(page, 3.0)
        length, gaps = page.query_selector(".plot.tall canvas").evaluate(GAPS)
        assert length > 500
        assert gaps == 0


def test_the_first_preset_reverses_the_rate_by_itself_until_it_is_moved(browser: Any, address: str) -> None:
    with opened(browser, address, reduced_motion="no-preference") as page:
        page.wait_for_function("document.getElementById('rate-value').textContent === '−100 rad/s'")
        page.wait_for_function("document.getElementById('rate-value').textContent === '100 rad/s'")
        page.keyboard.press(" ")
        page.wait_for_function("document.getElementById('clock').textContent.includes('paused')")
        assert page.evaluate("location.hash") in ("", "#follow")
        sample = round(time(page) / 1e-3)
        loop = fg.Loop(laws()["least_squares"][1])
        for samples, rate in ((5_000, -100.0), (10_000, 100.0)):
            loop.run(samples)
            loop.set({"plant.angular_rate": rate})
        at = loop.run(sample + 1 - 15_000).isel(time=-1)
        assert str(float(value(page, "rate_estimate", "b"))) == digits(1e3 * float(at["rate_estimate"]))
        page.fill("#rate", "-150")
        page.focus("#plot-list")
        run_to(page, time(page) + 15.0)
        assert page.text_content("#rate-value") == "−150 rad/s"
        assert float(value(page, "rate")) == -150.0
    with opened(browser, address) as page:  # nothing moves by itself
        run_to(page, 8.0)
        assert float(value(page, "rate")) == 100.0


def test_the_sentence_of_the_numbers_has_the_rms_of_the_time_shown(browser: Any, address: str) -> None:
    with opened(browser, address, "#follow&a=corrected&b=pid&speed=40") as page:
        sample = run_to(page, 3.0)
        sentence = page.text_content("#measured").replace("−", "-")
    found = re.search(r"error of the rate A (\S+), B – rad/s; tracking error A (\S+), B (\S+) µm\.", sentence)
    assert found
    begin = max(0, sample - 20_000)  # a slow machine pauses later than asked
    bins = slice(10 * max(0, round((begin + 1) / 10) - 1), 10 * ((sample + 1) // 10))
    first = fg.simulate(fg.Scenario.paper()).isel(time=bins)
    second = fg.simulate(laws()["pid"][1]).isel(time=bins)
    expected = [
        np.sqrt((rate_error(first) ** 2).mean()),
        *(np.sqrt((run["error"].values ** 2).sum(axis=1).mean()) for run in (first, second)),
    ]
    assert [float(number) for number in found.groups()] == pytest.approx(expected, rel=1e-3)


def test_a_preset_chooses_the_large_plot_and_fills_it_in_three_seconds(
    browser: Any, address: str, data_file: Path
) -> None:
    code = """
    console.log(JSON.stringify(presets.map((preset) => {
      const of = state.stateOf(preset);
      const unit = 1e3 / (state.dataOf(data, presets, of).base.scales["plant.angular_rate"] ?? 1e3); // of time, ms
      return { ...of, seconds: (of.window * unit) / of.speed };
    })));
    """
    states = {each["preset"]: each for each in json.loads(in_node(data_file, code))}
    assert max(each["seconds"] for each in states.values()) <= 3.0
    titles = {"rate": "Angular rate", "error": "Tracking error", "force": "Force", "estimates": "Error of the"}
    views = {"spectrum": "Spectrum of the rate's error", "allan": "Allan deviation of the rate's error"}
    with opened(browser, address) as page:
        for key in ("follow", "lqg", "allan", "lqg&plot=force", "sensors&plot=spectrum", "long-step&plot=estimates"):
            page.evaluate(f"location.hash = '{key}'")
            preset, _, plot = key.partition("&plot=")
            page.wait_for_selector(f'a[href="#{preset}"][aria-current]')
            large = plot or states[preset]["plot"]
            title = (titles | views)[large]
            begins = f"innerText.startsWith({json.dumps(title)})"
            page.wait_for_function(f"document.querySelector('#plot-list .plot.tall').{begins}")
            assert page.locator("#plot-list .plot").first.inner_text().startswith(title)
            assert page.locator("#plot-list .plot").count() == len(titles) + (large in views)


def test_spectrum_and_allan_deviation_are_drawn_of_both_runs(browser: Any, address: str) -> None:
    for view in ("allan", "spectrum"):
        with opened(browser, address, f"#allan&plot={view}&speed=40", color_scheme="light") as page:
            run_to(page, 5.0)
            page.wait_for_timeout(100)
            assert min(page.query_selector(".plot.tall canvas").evaluate(DRAWN)) > 200


def test_slider_and_plot_are_seen_together_on_a_phone(browser: Any, address: str) -> None:
    with opened(browser, address, viewport={"width": 400, "height": 800}) as page:
        assert page.locator("#scene").bounding_box()["height"] == pytest.approx(9 * 16)
        for plot in (".plot.tall canvas", ".plot.timed canvas"):
            page.evaluate(f"document.querySelector('{plot}').scrollIntoView({{ block: 'end' }})")
            for what in ("#scene", "#rate", plot):
                box = page.locator(what).bounding_box()
                assert box["y"] >= 0, what
                assert box["y"] + box["height"] <= 800.5, what


def test_keys_play_step_tap_and_restart_and_reach_every_control(browser: Any, address: str) -> None:
    with opened(browser, address) as page:
        for _ in range(3):
            page.keyboard.press(".")
        page.wait_for_function("document.getElementById('clock').textContent.startsWith('t = 0.003 ms')")
        page.keyboard.press("k")
        page.keyboard.press(".")
        page.wait_for_function("document.getElementById('clock').textContent.startsWith('t = 0.004 ms')")
        run_to(page, 0.02)
        page.keyboard.press("r")
        page.wait_for_function("document.getElementById('clock').textContent.startsWith('t = 0.000 ms')")
        page.uncheck("#keys")
        page.focus("#plot-list")
        page.keyboard.press(".")
        page.check("#keys")
        page.wait_for_timeout(100)
        assert time(page) == 0.0
        page.click("h1")
        reached = set()
        for _ in range(80):
            page.keyboard.press("Tab")
            reached.add(page.evaluate("document.activeElement.id || document.activeElement.textContent"))
        assert {"play", "step", "restart", "kick", "rate", "speed", "plot-list", "window", "keys"} <= reached
        page.focus("#rate")
        page.keyboard.press("ArrowRight")
        page.wait_for_function("document.getElementById('rate-value').textContent === '101 rad/s'")


def test_the_address_brings_everything_back(browser: Any, address: str) -> None:
    with opened(browser, address, "#follow") as page:
        page.click("#rate-double")
        page.get_by_label("Controller").nth(0).select_option("joint")
        page.get_by_label("Sensors").select_option("positions")
        page.wait_for_function("location.hash.includes('a=joint') && location.hash.includes('sensors=positions')")
        page.get_by_label("Fractional order α").first.fill("0.7")
        page.get_by_label("seed").fill("12")
        page.keyboard.press("Enter")
        page.select_option("#window", "5")
        page.wait_for_function("location.hash.includes('window=5')")
        hash = page.evaluate("location.hash")
        shown = page.evaluate("[...document.querySelectorAll('input, select')].map((each) => each.value).join()")
        page.goto("about:blank")
        page.goto(address + hash)
        ready(page)
        again = page.evaluate("[...document.querySelectorAll('input, select')].map((each) => each.value).join()")
        assert again == shown
        assert page.evaluate("location.hash") == hash
    assert dict(pair.split("=") for pair in hash.split("&")[1:]) == {
        "a": "joint",
        "sensors": "positions",
        "window": "5",
        "plant.angular_rate": "200",
        "disturbance.seed": "12",
        "a.controller.order": "0.7",
    }


def test_what_is_typed_stays_while_another_setting_is_taken(browser: Any, address: str) -> None:
    with opened(browser, address, "#follow") as page:
        page.get_by_label("seed").fill("12")
        page.evaluate("document.getElementById('rate-double').click()")
        page.wait_for_function("document.getElementById('rate-value').textContent === '200 rad/s'")
        assert page.get_by_label("seed").input_value() == "12"
        page.keyboard.press("Enter")
        page.wait_for_function("location.hash.includes('disturbance.seed=12')")
        page.get_by_label("seed").fill("-1")
        page.keyboard.press("Enter")
        page.wait_for_function("document.getElementById('problem').textContent.includes('disturbance.seed is -1')")
        assert page.get_by_label("seed").input_value() == "12"


REFUSED = {
    "#nothing": "preset is nothing: it must be one of ",
    "#follow&a.controller.order=2": "controller.order is 2: it must be at most 1",
    "#follow&plant.angular_rate=fast": "plant.angular_rate is NaN: it must be a finite number",
    "#follow&sensors=positions&run.step=0.002": "run.step is 0.002: it must be 0.001, which the noise ",
    "#follow&a.controller.layer=cubic": "controller.layer is cubic: it must be one of linear, quadratic",
}


def test_an_address_that_cannot_be_run_shows_one_sentence_and_the_preset(browser: Any, address: str) -> None:
    for hash, sentence in REFUSED.items():
        with opened(browser, address, hash) as page:
            assert page.is_visible("#problem")
            assert page.text_content("#problem").startswith(sentence)
            assert float(value(page, "rate")) == 100.0
            page.keyboard.press(".")
            page.wait_for_function("document.getElementById('clock').textContent.startsWith('t = 0.001 ms')")


def test_a_setting_that_is_refused_is_named_and_the_old_one_stays(browser: Any, address: str) -> None:
    with opened(browser, address, "#follow&b=none") as page:
        page.get_by_text("All settings of this controller").click()
        field = page.get_by_label("layer_thickness")
        field.fill("-1")
        page.keyboard.press("Enter")
        page.wait_for_selector("#problem:visible")
        assert page.text_content("#problem") == "controller.layer_thickness is -1: it must be at least 0"
        assert field.input_value() == "0.06"
        page.click("#restart")  # not with the one that was refused
        page.wait_for_selector("#problem", state="hidden")
        field.fill("0.05")
        page.keyboard.press("Enter")
        page.wait_for_selector("#problem", state="hidden")


def test_a_worker_that_dies_shows_one_sentence(browser: Any, address: str) -> None:
    page = browser.new_page(**STILL)
    page.add_init_script(
        "const Real = Worker;"
        "window.Worker = class extends Real { constructor(...a) { super(...a); window.own = this; } };"
    )
    page.goto(address)
    ready(page)
    page.evaluate("own.dispatchEvent(new ErrorEvent('error', { message: 'out of memory', cancelable: true }))")
    assert page.text_content("#problem") == (
        "The simulation has stopped with an error. Reload the page to start again."
    )
    page.close()


def test_the_csv_file_has_the_numbers_of_the_run(browser: Any, address: str, tmp_path: Path) -> None:
    with opened(browser, address, "#follow&a=corrected&b=pid&speed=40") as page:
        run_to(page, 0.5)
        with page.expect_download() as saved:
            page.get_by_text("Save what is seen as CSV").click()
        saved.value.save_as(tmp_path / "seen.csv")
    names, *lines = (tmp_path / "seen.csv").read_text().splitlines()
    rows = np.array([[float(cell) for cell in line.split(",")] for line in lines])
    columns = dict(zip(names.split(","), rows.T, strict=True))
    samples = np.round(columns["time"] / 1e-3).astype(int)
    assert list(samples[:3]) == [9, 19, 29]
    for run, scenario in (("a", fg.Scenario.paper()), ("b", laws()["pid"][1])):
        expected = fg.simulate(scenario).isel(time=samples)
        np.testing.assert_array_equal(columns[f"{run}.error.x"], expected["error"].values[:, 0])
        np.testing.assert_array_equal(columns[f"{run}.control.y"], expected["control"].values[:, 1])


def test_the_picture_shows_the_scene_and_the_large_plot_and_the_page_links_back(
    browser: Any, address: str, tmp_path: Path
) -> None:
    with opened(browser, address, "#order&speed=40", color_scheme="light") as page:
        run_to(page, 0.5)
        with page.expect_download() as saved:
            page.get_by_text("Save a picture").click()
        saved.value.save_as(tmp_path / "seen.png")
        widths = [page.locator(canvas).bounding_box()["width"] for canvas in ("#scene", ".plot.tall canvas")]
        documentation = page.locator("footer a").get_attribute("href")
    picture = image.imread(tmp_path / "seen.png")
    assert picture.shape[1] == pytest.approx(sum(widths) + 48, abs=2)
    near = np.abs(picture[:, :, :3] - np.array([0x00, 0x64, 0xA6]) / 255).max(axis=2) < 0.1
    for part in (near[72:, : round(widths[0])], near[72:, round(widths[0]) + 100 :]):
        assert part.sum() > 100
    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert documentation == project["urls"]["Documentation"]


def test_the_copied_scenario_is_that_of_the_run(browser: Any, address: str) -> None:
    with opened(browser, address, "#follow&a=joint&b=none&sensors=positions&speed=40") as page:
        sample = run_to(page, 0.3)
        page.get_by_text("Copy A as TOML").click()
        scenario = fg.Scenario.from_toml(page.input_value("#text"))
        at = fg.simulate(scenario).isel(time=sample)
        assert str(float(value(page, "control.x"))) == digits(float(at["control"][0]))


def test_every_preset_is_an_address_and_plays(browser: Any, address: str, data_file: Path) -> None:
    keys = json.loads(in_node(data_file, "console.log(JSON.stringify(presets.map(({ key }) => key)));"))
    with opened(browser, address, reduced_motion="no-preference") as page:
        links = page.locator("#presets a")
        assert [link.get_attribute("href") for link in links.all()] == [f"#{key}" for key in keys]
        for link, key in zip(links.all(), keys, strict=True):
            assert page.query_selector(f"#{key}") is None, "the browser would go there"
            link.click()
            page.wait_for_selector(f'a[href="#{key}"][aria-current]')
            page.wait_for_function("parseFloat(document.getElementById('clock').textContent.slice(4)) > 0.05")
            assert page.is_hidden("#problem")
            assert page.evaluate("location.hash") == f"#{key}"


LATE_EVENTS = """
const listen = window.addEventListener.bind(window);
window.addEventListener = (name, act, ...rest) =>
  listen(name, name === "hashchange" ? () => setTimeout(act, 600) : act, ...rest);
"""


def test_a_link_is_followed_even_if_the_page_is_about_to_write_its_address(browser: Any, address: str) -> None:
    page = browser.new_page(viewport={"width": 1280, "height": 800}, **STILL)
    page.set_default_timeout(20_000)
    page.add_init_script(LATE_EVENTS)
    page.goto(address + "#first")
    ready(page)
    page.evaluate("document.querySelector('a[href=\"#moving\"]').click()")
    page.wait_for_selector('a[href="#moving"][aria-current]')
    page.evaluate("document.querySelector('a[href=\"#thrown\"]').click()")  # within the time of the page's writing
    page.wait_for_selector('a[href="#thrown"][aria-current]')
    page.wait_for_timeout(400)
    assert page.evaluate("location.hash") == "#thrown"
    page.close()


SLOW_WORKER = """
const Real = Worker;
window.Worker = class extends Real {
  postMessage(message) {
    setTimeout(() => super.postMessage(message), message.is === "start" ? 500 : 0);
  }
};
"""


def test_another_preset_may_begin_late(browser: Any, address: str) -> None:
    """Frames show one run until then, while the state has two already."""
    page = browser.new_page(viewport={"width": 1280, "height": 800})
    page.set_default_timeout(1000 * PATIENCE)
    faults = watched(page, address)
    page.add_init_script(SLOW_WORKER)
    page.goto(address + "#first")
    for preset in ("moving", "first", "allan", "thrown"):
        page.wait_for_function("parseFloat(document.getElementById('clock').textContent.slice(4)) > 0.2")
        page.click(f'a[href="#{preset}"]')
        page.hover("#plot-list canvas >> nth=0")  # draws a frame
        page.wait_for_selector(f'a[href="#{preset}"][aria-current]')
        shown = page.text_content("#clock")
        page.wait_for_function(f"document.getElementById('clock').textContent !== {json.dumps(shown)}")
    page.close()
    assert faults == []


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [360, 1280])
def test_it_is_accessible_and_fits(browser: Any, address: str, scheme: str, width: int) -> None:
    options = {"color_scheme": scheme, "viewport": {"width": width, "height": 800}}
    with opened(browser, address, **options) as page:
        page.evaluate("document.querySelectorAll('details').forEach((each) => (each.open = true))")
        assert violations(page) == []
        assert page.evaluate("document.scrollingElement.scrollWidth") <= width


def test_it_plays_by_itself_unless_motion_is_to_be_reduced_and_speaks(browser: Any, address: str) -> None:
    with opened(browser, address, "#lqg", reduced_motion="no-preference") as page:
        page.wait_for_function("document.getElementById('spoken').textContent.includes('estimate')")
        page.wait_for_function("parseFloat(document.getElementById('clock').textContent.slice(4)) > 0.1")
        said = page.text_content("#spoken")
        assert re.match(r"^t [\d.]+ ms: rate 100.0; run A estimate ", said)
    with opened(browser, address) as page:
        page.wait_for_timeout(300)
        assert time(page) == 0.0


# -- A function of the visitor's, and a figure

RESTING = "function force(s) {\n  return [0, 0];\n}\n"


def second(channel: str) -> str:
    return f"document.querySelector('td[data-run=b][data-channel=\"{channel}\"]').textContent"


def run_code(page: Any, text: str) -> None:
    page.fill("#code", text)
    page.click("#run-code")


def test_a_function_in_the_page_runs_like_a_callable_in_python(browser: Any, address: str) -> None:
    paper = fg.Scenario.paper()
    run = fg.simulate(paper, controller=Example(paper))
    with opened(browser, address, "#your-own&speed=40") as page:
        sample = run_to(page, 3.0)
        for channel, number in (
            ("rate_estimate", 1e3 * float(run["rate_estimate"][sample])),
            ("control.y", float(run["control"][sample, 1])),
        ):
            assert str(float(value(page, channel, "b"))) == digits(number)
        run_code(page, RESTING)
        page.wait_for_function("document.getElementById('play').textContent === 'Pause'")
        page.keyboard.press("Escape")
        page.click("#play")
        page.wait_for_function("document.getElementById('clock').textContent.includes('paused')")
        assert float(value(page, "control.y", "b")) == 0.0
        page.click("#example")
        page.focus("#code")
        page.keyboard.press("Control+Enter")
        page.wait_for_function(f"{second('rate_estimate')} !== '–'")


BROKEN = {
    "let a = 1;\nlet b = ;\n" + RESTING: r"Your function, line 2: Unexpected token ';'",
    "let q;\n\nfunction force(s) {\n  return [q.x, 0];\n}": r"Your function, line 4: Cannot read properties of ",
    "function force(s) {\n  if (s.time > 0.1)\n    throw new Error('no');\n  return [0, 0];\n}": (
        r"Your function, line 3: no"
    ),
    "let q = NaN;\nfunction force(s) {\n  return [0, q];\n}": (
        r"Your function, line 2: it returned \[0,NaN\] at t = 0: it must return two finite numbers"
    ),
    RESTING + "\nfunction report() {\n  return { error: 1 };\n}": r"Your function, line 5: report\(\) of the law has ",
    "let q;": r"Your function: there is no function force\(s\): it must be defined",
    "throw 'a word';": r"Your function: a word",
}


def test_a_function_that_fails_is_shown_with_its_line_and_another_one_runs(browser: Any, address: str) -> None:
    with opened(browser, address, "#follow") as page:
        page.get_by_text("Your own function", exact=True).last.click()
        for text, sentence in BROKEN.items():
            run_code(page, text)
            for place in ("problem", "code-note"):
                page.wait_for_function(
                    f"(sentence) => document.getElementById('{place}').textContent.search(sentence) === 0", arg=sentence
                )
            line = re.search(r"line (\d+)", sentence)
            numbers = page.text_content("#lines").split("\n")
            assert [number for number in numbers if number.startswith("▸")] == ([f"▸{line[1]}"] if line else [])
            if line:
                selected = page.evaluate("((at) => at.value.slice(at.selectionStart, at.selectionEnd))(code)")
                assert selected == text.split("\n")[int(line[1]) - 1]
        run_code(page, RESTING)
        page.wait_for_selector("#problem", state="hidden")
        page.wait_for_function("parseFloat(document.getElementById('clock').textContent.slice(4)) > 0.05")
        assert page.text_content("#code-note") == ""


def test_a_function_that_never_returns_is_ended_with_a_sentence(browser: Any, address: str) -> None:
    sentence = "Your function has not returned within 2 s, so it has been ended: change it and run it again"
    with opened(browser, address, "#your-own") as page:
        for text in ("for (;;);", "function force(s) {\n  while (s.time > 0.01);\n  return [0, 0];\n}"):
            run_code(page, text)
            page.wait_for_selector("#problem:visible")
            assert page.text_content("#problem") == sentence
            assert page.text_content("#play") == "Play"
            run_code(page, RESTING)
            page.wait_for_selector("#problem", state="hidden")
            page.wait_for_function("parseFloat(document.getElementById('clock').textContent.slice(4)) > 0.05")


# Ways out of a worker.
LEAKS = (
    "const asked = new XMLHttpRequest(); asked.open('GET', 'ADDRESS', false); asked.send();",
    "importScripts('ADDRESS');",
    "new WebSocket('ADDRESS'.replace('http', 'ws'));",
    "new EventSource('ADDRESS');",
    "fetch('ADDRESS').catch(() => {});",
    "new Worker('ADDRESS');",
)


def test_nothing_leaves_the_page(browser: Any, folder: Path) -> None:
    asked: list[str] = []

    class Listening(Quiet):
        def do_GET(self) -> None:
            asked.append(self.path)
            super().do_GET()

    tries = "\n".join(f"try {{ {leak} }} catch (error) {{ ++refused; }}" for leak in LEAKS)
    with served(folder, Listening) as address:
        page = browser.new_page(**STILL)
        page.set_default_timeout(1000 * PATIENCE)
        page.goto(address + "#your-own")
        ready(page)
        report = "function report() {\n  return { rate_estimate: refused };\n}\n"
        run_code(page, f"let refused = 0;\n{tries}\n{RESTING}{report}".replace("ADDRESS", f"{address}secret"))
        page.wait_for_function(f"parseFloat({second('rate_estimate')}) >= 1000")  # in rad/s, so 1 at least
        page.wait_for_timeout(500)
        page.close()
    assert asked == ["/"]


def test_a_function_that_came_with_the_address_runs_only_when_asked(browser: Any, address: str) -> None:
    with opened(browser, address, "#your-own") as page:
        run_code(page, RESTING)
        page.wait_for_function("location.hash.includes('code=')")
        hash = page.evaluate("location.hash")
        page.goto("about:blank")
        page.goto(address + hash)
        ready(page)
        assert page.input_value("#code") == RESTING
        assert "came with the address" in page.text_content("#code-note")
        page.keyboard.press(".")
        page.wait_for_function("document.getElementById('clock').textContent.startsWith('t = 0.001 ms')")
        assert float(value(page, "control.y", "b")) != 0.0  # the example's
        page.click("#run-code")
        page.wait_for_function(f"{second('control.y')} === '0.000'")
        assert page.text_content("#code-note") == ""
        page.click('a[href="#follow"]')
        page.wait_for_selector('a[href="#follow"][aria-current]')
        assert "code=" not in page.evaluate("location.hash")
        assert page.input_value("#code") == RESTING


def lobes(angle: Any) -> Any:
    """Radius of a figure without symmetry."""
    return 60.0 + 15.0 * np.cos(3.0 * angle) + 10.0 * np.sin(angle)


def draw_lobes(page: Any, send: Any) -> None:
    """Moves the pointer along them, from the right end on."""
    page.evaluate("document.getElementById('sketch').scrollIntoView({ block: 'end' })")
    box = page.locator("#sketch").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    for i in range(61):
        angle = np.pi * i / 30.5
        radius = lobes(angle)
        send(i, float(x + radius * np.cos(angle)), float(y - radius * np.sin(angle)))


@pytest.mark.parametrize("way", ["mouse", "touch"])
def test_a_figure_that_is_drawn_is_followed(browser: Any, address: str, way: str) -> None:
    with opened(browser, address, "#lqg&speed=40", has_touch=way == "touch", color_scheme="light") as page:
        page.get_by_text("Draw the motion", exact=True).last.click()
        if way == "mouse":

            def send(i: int, x: float, y: float) -> None:
                page.mouse.move(x, y)
                if i == 0:
                    page.mouse.down()

            draw_lobes(page, send)
            page.mouse.up()
        else:
            tablet = page.context.new_cdp_session(page)

            def send(i: int, x: float, y: float) -> None:
                kind = "touchStart" if i == 0 else "touchMove"
                tablet.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": [{"x": x, "y": y}]})

            draw_lobes(page, send)
            tablet.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
        page.wait_for_function("location.hash.includes('figure=')")
        points = np.array([[float(c) for c in p.split()] for p in page.input_value("#points").split(",")])
        assert page.input_value("#figures") == "drawn"
        size = page.locator("#sketch").bounding_box()["height"] / 2 / 1.4
        found = np.hypot(*points.T) * size
        expected = lobes(np.arctan2(points[:, 1], points[:, 0]))
        np.testing.assert_allclose(found, expected, atol=2.5)
        page.focus("#plot-list")
        sample = run_to(page, 3.0)
        page.get_by_text("Copy B as TOML").click()
        scenario = fg.Scenario.from_toml(page.input_value("#text"))
        assert scenario.reference.kinds == ("sines", "sines")
        at = fg.simulate(scenario).isel(time=sample)
        assert str(float(value(page, "control.x", "b"))) == digits(float(at["control"][0]))
        near = np.hypot(*(points - at["reference"].values).T).min()
        assert near < 0.15


def test_a_figure_can_be_chosen_or_typed_and_given_up(browser: Any, address: str) -> None:
    with opened(browser, address, "#follow") as page:
        page.get_by_text("Draw the motion", exact=True).last.click()
        page.select_option("#figures", "square")
        page.wait_for_function("location.hash.includes('figure=1+1')")
        page.wait_for_function("document.querySelector('#points').value === '1 1, -1 1, -1 -1, 1 -1'")
        page.fill("#points", "1 0, 0 1")
        page.keyboard.press("Enter")
        page.wait_for_selector("#problem:visible")
        assert page.text_content("#problem").startswith("figure has 2 points: it must have 3 to 200")
        page.wait_for_function("document.getElementById('points').value === '1 1, -1 1, -1 -1, 1 -1'")
        page.fill("#points", "1 0, 0 1, -1 -0.5")
        page.keyboard.press("Enter")
        page.wait_for_function("document.getElementById('figures').value === 'drawn'")
        assert page.is_hidden("#problem")
        page.select_option("#figures", "")
        page.wait_for_function("!location.hash.includes('figure=')")
        assert page.input_value("#points") == ""
    with opened(browser, address, "#dual-mass") as page:
        assert page.is_hidden("#drawing")


# -- The page of one scenario ----------------------------------------------------------------------------------------

TABLE = np.linspace(0.0, 30.0, 61)
PAPER = fg.Scenario.paper()
OWN = {
    "dual_mass": fg.Scenario.shipped("dual_mass"),
    "dual_mass_volts": fg.Scenario.shipped("dual_mass_volts"),
    "a step": PAPER.replace({"reference": {"kind": "step", "amplitude": [3.0, -1.0], "start": 0.1, "smoothing": 0.05}}),
    "a chirp": PAPER.replace(
        {"reference": {"kind": "chirp", "frequency": [1.0, 2.0], "final_frequency": [5.0, 6.0], "end": 20.0}}
    ),
    "a table, disturbances that add up": PAPER.replace(
        {
            "reference": {
                "kind": "table",
                "points": np.column_stack([TABLE, np.cos(TABLE), np.sin(2 * TABLE)]).tolist(),
            },
            "disturbance": [
                {"kind": "sine", "amplitude": [0.7, -0.3], "frequency": [2.0, 7.0]},
                {"kind": "pulse", "amplitude": [30.0, 4.0], "start": 0.2, "width": 0.1},
            ],
        }
    ),
    "force rebalance, a rate that moves": PAPER.replace(
        {
            "controller.kind": "force_rebalance",
            "reference.kind": ["sine", "rest"],
            "device.sensing": "position",
            "rate.kind": "sine",
            "rate.amplitude": 10.0,
            "rate.frequency": 30.0,
        }
    ),
}
CHANGES = {
    "dual_mass": "disturbance.standard_deviation=2e-7&disturbance.seed=4&plant.angular_rate=2.5",
    "dual_mass_volts": "disturbance.standard_deviation=2e-7&disturbance.seed=4&plant.angular_rate=2.5",
    "a step": "run.step=0.0005&reference.amplitude.x=2&a.controller.order=0.8&a.adaptation.bound_gain[1]=2",
    "a chirp": "disturbance.hold_steps=3&plant.stiffness_deviation.xx=2.5",
    "a table, disturbances that add up": "plant.angular_rate=50&a.controller.force_limit=2000",
    "force rebalance, a rate that moves": "plant.angular_rate=50&a.controller.force_limit=2000",
}


@pytest.mark.parametrize("name", OWN)
def test_the_page_of_a_scenario_copies_that_scenario(name: str, tmp_path: Path) -> None:
    """With and without changes, of its own controller and of another: as TOML and as a command."""
    need("WebAssembly")
    file = tmp_path / "my own.toml"
    OWN[name].save(file)
    (tmp_path / "data.json").write_text(json.dumps(scenario_data(OWN[name], str(file))), encoding="utf-8")
    code = f"""
    const of = state.fromHash(data, data.presets, "#scenario&{CHANGES[name]}");
    const other = state.fromHash(data, data.presets, "#scenario&a=pid");
    console.log(JSON.stringify([state.stateOf(data.presets[0]), of, other].map((each) => ({{
      scenario: state.scenarioOf(data, each, "a"),
      toml: state.toToml(data, each, "a"),
      command: state.toCommand(data, each, "a"),
    }}))));
    """
    texts = json.loads(in_node(tmp_path / "data.json", code))
    assert fg.Scenario.from_toml(texts[0]["toml"]).content_hash() == OWN[name].content_hash()
    for said in texts:
        program, verb, given, *words = shlex.split(said["command"])
        assert (program, verb, given) == ("fracgyro", "simulate", str(file))
        copies = (
            fg.Scenario.from_toml(said["toml"]),
            fg.Scenario.load(file).replace(dict(map(_change, words[1::2]))),
        )
        for made in copies:
            found, expected = document(made), said["scenario"]
            found.get("volts", {}).pop("refusal", None)
            assert acting(found["settings"]) == acting(expected["settings"])
            for part in ("device", "reference", "disturbance", "volts"):
                assert found.get(part) == expected.get(part)


@pytest.mark.parametrize("name", OWN)
def test_the_page_of_a_scenario_runs_it(browser: Any, folder: Path, name: str, tmp_path: Path) -> None:
    scenario = OWN[name]
    (tmp_path / "index.html").write_text(
        page(scenario_data(scenario, "my.toml"), folder.parent / "fracgyro.wasm"), encoding="utf-8"
    )
    with opened(browser, (tmp_path / "index.html").as_uri(), color_scheme="light") as shown:
        step = 1e3 * scenario.run.step * scenario.plant.scales.time
        run_to(shown, 1000 * step)
        sample = round(time(shown) / step)
        run = fg.simulate(scenario.replace({"run.record_every": 1})).isel(time=sample)
        assert str(float(value(shown, "control.x"))) == digits(float(run["control"][0]))
        length = 1e6 * scenario.plant.scales.length
        assert str(float(value(shown, "error.y"))) == digits(length * abs(float(run["error"][1])))
        for canvas in shown.query_selector_all(".plot.tall canvas, #scene"):
            assert canvas.evaluate(DRAWN)[0] > 20
        assert violations(shown) == []


def test_the_command_writes_a_page_or_opens_it(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from click.testing import CliRunner
    from fracgyro.cli import cli

    wasm = (folder.parent / "fracgyro.wasm").read_bytes()  # takes a minute to build
    monkeypatch.setitem(fg.export.live.__globals__, "build_module", lambda path, **_: path.write_bytes(wasm))
    out = tmp_path / "page.html"
    assert CliRunner().invoke(cli, ["live", "dual_mass", "--out", str(out)]).output == f"{out}: open it in a browser\n"
    assert "Drive the gyroscope" in out.read_text(encoding="utf-8")
    seen: list[str] = []
    monkeypatch.setattr("webbrowser.open", lambda address: not seen.append(address))
    said = CliRunner().invoke(cli, ["live", "dual_mass"]).output
    (address,) = seen
    path = Path(address.removeprefix("file://"))
    assert said == f"{path}: opened in the browser\n"
    assert path.read_text(encoding="utf-8") == out.read_text(encoding="utf-8")


def test_a_plant_that_the_module_lacks_is_refused(tmp_path: Path) -> None:
    duffing = PAPER.replace({"plant.kind": "duffing"})
    with pytest.raises(fg.ScenarioError, match=r"^plant.kind is duffing: it must be gyroscope"):
        fg.export.live(duffing, tmp_path / "page.html")
    assert not list(tmp_path.iterdir())
