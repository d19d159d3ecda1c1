"""The WebAssembly module, as a page would use it: in node, through its wrapper."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any

import fracgyro as fg
import numpy as np
import pytest
from children import PATIENCE
from embedded import need
from every_disturbance import ENTRIES
from fracgyro import _core
from fracgyro.export.web import build, web
from fracgyro.scenario.device_core import device_channels
from fracgyro.scenario.kinds import KINDS, columns
from fracgyro.scenario.to_core import core_setup
from loop_in_volts import IN_VOLTS

SHORT = fg.Scenario.paper().replace({"run.duration": 3.0})

# `fracgyro`: the loaded module; `inSingle`: that of single precision; `own`: the exported scenario; `write`: for
# arrays, read back by numpy.
PRELUDE = """
import { readFileSync, writeFileSync } from "node:fs";
const { load } = await import(process.argv[1] + "/fracgyro.mjs");
const read = (name) => readFileSync(process.argv[1] + "/" + name);
const [fracgyro, inSingle] = await Promise.all(["fracgyro.wasm", "fracgyro-single.wasm"].map(
  (name) => load({ wasm: read(name), data: JSON.parse(read("fracgyro.json")) })));
const write = (name, array) => writeFileSync(process.argv[2] + "/" + name, array);
const own = JSON.parse(readFileSync(process.argv[2] + "/own.json"));
"""


@pytest.fixture(scope="session")
def module(tmp_path_factory: pytest.TempPathFactory) -> Path:
    need("WebAssembly")
    folder = tmp_path_factory.mktemp("web")
    build(folder)
    return folder


def in_node(module: Path, folder: Path, code: str, scenario: fg.Scenario = SHORT) -> str:
    """Output of `code`."""
    (folder / "own.json").unlink(missing_ok=True)
    web(scenario, folder / "own.json", unbounded=True)
    command = ["node", "--input-type=module", "-e", PRELUDE + code, str(module), str(folder)]
    ran = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE)
    assert ran.returncode == 0, ran.stderr
    return ran.stdout


def recorded(scenario: fg.Scenario) -> np.ndarray:
    more = columns(device_channels(scenario))
    rows: np.ndarray = _core.record_runs([core_setup(scenario)], scenario.run.record_every, 1, more)[0][0]
    return rows


def assert_same_bits(got: np.ndarray, expected: np.ndarray) -> None:
    np.testing.assert_array_equal(got.reshape(expected.shape).view(np.uint64), expected.view(np.uint64))


def test_the_module_is_small_and_imports_only_the_callers_law(module: Path, tmp_path: Path) -> None:
    assert (module / "fracgyro.wasm").stat().st_size < 460_000
    assert (module / "fracgyro-single.wasm").stat().st_size < 380_000
    assert sum(file.stat().st_size for file in module.iterdir() if "single" not in file.name) < 620_000
    imports = 'console.log(JSON.stringify(WebAssembly.Module.imports(new WebAssembly.Module(read("fracgyro.wasm")))))'
    (imported,) = json.loads(in_node(module, tmp_path, imports))
    assert imported == {"module": "caller", "name": "law", "kind": "function"}


def test_the_module_of_single_precision_has_no_loop(module: Path, tmp_path: Path) -> None:
    code = """
    for (const start of ["simulate", "loop"]) {
      await inSingle[start](own).catch((refusal) => console.log(refusal.message));
    }
    """
    refusal = "fracgyro-single.wasm has no loop: load fracgyro.wasm for runs and loops"
    assert in_node(module, tmp_path, code).splitlines() == [refusal, refusal]


# Every kind of disturbance; the first part is a sine.
LIST = SHORT.replace({"disturbance": ENTRIES})
SCENARIOS = {
    "the paper's, whole": fg.Scenario.paper(),
    "as printed": fg.Scenario.paper("printed").replace({"run.duration": 3.0}),
    "any c, held noise": SHORT.replace({"controller.terminal_exponent": 0.7, "disturbance.hold": 4e-3}),
    "fractional": SHORT.replace({"controller.kind": "fractional", "controller.order": 0.35}),
    "composite adaptation behind an observer, moving rate": SHORT.replace(
        {
            "adaptation.kind": "composite",
            "device.sensing": "position",
            "rate.kind": "table",
            "rate.points": [[0.0, 95.0], [1e-3, 105.0]],
        }
    ),
    "joint adaptation of a device": SHORT.replace(
        {
            "adaptation.kind": "joint",
            "device.sensing": "position",
            "device.position_noise": 1e-11,
            "device.actuator_limit": 1e-5,
            "device.actuator_bits": 24,
            "device.delay": 1,
            "device.damping_drift": 5e3,
            "device.temperature_ramp": 1e4,
            "device.bias_instability": 0.3,
            "run.record_every": 3,
        }
    ),
    "PID, which reports nothing": SHORT.replace({"controller.kind": "pid", "controller.force_limit": 6000.0}),
    "PID behind the filter": SHORT.replace(
        {"controller.kind": "pid", "controller.filter": "kalman", "controller.force_limit": 6000.0}
    ),
    "sliding mode behind the filter of positions": SHORT.replace(
        {"controller.filter": "kalman", "device.sensing": "position", "device.position_noise": 1e-11, "device.delay": 1}
    ),
    "pick-offs that the controller knows": SHORT.replace(
        {
            "device.pickoff_gain_error": (0.01, -0.02),
            "device.pickoff_misalignment": 0.03,
            "datasheet.pickoff_gain_error": (0.01, -0.02),
            "datasheet.pickoff_misalignment": 0.03,
        }
    ),
    "PID whose force is sent by events": SHORT.replace(
        {"controller.kind": "pid", "controller.event_threshold": 5.0, "controller.event_share": 0.02}
    ),
    "a PD with the lacking force taken off": SHORT.replace(
        {"controller.kind": "pid", "controller.integral_frequency": 0.0, "controller.compensation_bandwidth": 50.0}
    ),
    **{kind: SHORT.replace({"controller.kind": kind}) for kind in KINDS},
    "disturbances that add up": LIST,
    "a device in volts": IN_VOLTS,
    "integer order": SHORT.replace({"controller.order": 1.0}),
    "order zero": SHORT.replace({"controller.order": 0.0}),
    "known parameters, sine": SHORT.replace(
        {
            "controller.kind": "fast_terminal",
            "controller.adaptive": False,
            "disturbance.kind": "sine",
            "disturbance.amplitude": (0.7, -0.3),
            "disturbance.frequency": (2.0, 7.0),
            "run.record_every": 7,
        }
    ),
    "another gyroscope, everything on": SHORT.replace(
        {
            "controller.kind": "linear",
            "controller.force_limit": 900.0,
            "controller.switching_limit": 0.02,
            "plant.mass": 2.3e-7,
            "plant.stiffness_deviation": {"xx": 1.0, "xy": 0.1, "yy": -1.0},
            "plant.centrifugal": True,
            "adaptation.leakage": 0.1,
            "adaptation.dead_zone": 0.01,
            "adaptation.projection": 0.5,
            "disturbance.seed": 2**53 - 1,
        }
    ),
}


@pytest.mark.parametrize("name", SCENARIOS)
def test_a_run_has_the_bits_of_simulate(module: Path, tmp_path: Path, name: str) -> None:
    in_node(module, tmp_path, 'write("rows", (await fracgyro.simulate(own)).rows);', SCENARIOS[name])
    assert_same_bits(np.fromfile(tmp_path / "rows"), recorded(SCENARIOS[name]))


CHANGES = {
    "an order that no table has": ({"controller.order": 0.81234567}, 3.0),
    "a tiny order": ({"controller.order": 1e-300}, 3.0),
    "a finer step": ({"controller.order": 0.6, "run.step": 5e-4}, 3.0),
    "a longer run": ({"controller.order": 0.05, "run.duration": 120.0}, 120.0),
    "a coarse tolerance": ({"run.kernel_tolerance": 1e-2}, 3.0),
    "few steps": ({"run.duration": 0.005}, 0.005),
    "positions only": ({"device.sensing": "position", "controller.observer_bandwidth": 200.0}, 3.0),
    "the filter": ({"controller.filter": "kalman", "controller.observer_bandwidth": 200.0}, 3.0),
}


@pytest.mark.parametrize("name", CHANGES)
def test_order_step_and_length_can_be_changed_in_the_browser_and_keep_the_bits(
    module: Path, tmp_path: Path, name: str
) -> None:
    changes, duration = CHANGES[name]
    scenario = SHORT.replace({"disturbance.hold": None, **changes})
    assert scenario.run.duration == duration
    code = f"""
    const run = await fracgyro.simulate(own, {json.dumps(changes)});
    write("rows", run.rows);
    write("time", run.time);
    """
    in_node(module, tmp_path, code, SHORT.replace({"disturbance.hold": None}))
    assert_same_bits(np.fromfile(tmp_path / "rows"), recorded(scenario))
    expected = scenario.run.step * np.arange(scenario.run.steps + 1)
    np.testing.assert_allclose(np.fromfile(tmp_path / "time"), expected, rtol=1e-15)


# -- The loop in parts


def loop_rows(scenario: fg.Scenario, samples: list[int], sets: list[dict[str, Any]]) -> np.ndarray:
    """Steps as for fg.Loop: after each number of samples except the last, something is set."""
    loop, parts = fg.Loop(scenario), []
    for count, changes in zip(samples, [*sets, {}], strict=True):
        found = loop.run(count)
        parts.append(np.hstack([values.values.reshape(count, -1) for values in found.values()]))
        loop.set(changes)
    return np.vstack(parts)


@pytest.mark.parametrize("name", SCENARIOS)
def test_a_loop_in_parts_has_the_bits_of_simulate(module: Path, tmp_path: Path, name: str) -> None:
    scenario = SCENARIOS[name]
    code = f"""
    const loop = await fracgyro.loop(own);
    const every = own.settings["run.record_every"];
    const rows = [loop.run(1, every), loop.run(999, every), loop.run({scenario.run.steps - 999}, every)];
    write("rows", Buffer.concat(rows.map((part) => new Uint8Array(part.buffer, 0, part.byteLength))));
    console.log(loop.time);
    """
    expected = recorded(scenario)
    assert float(in_node(module, tmp_path, code, scenario)) == (scenario.run.steps + 1) * scenario.run.step
    assert_same_bits(np.fromfile(tmp_path / "rows"), expected)


TUNED: dict[str, Any] = {
    "plant.angular_rate": 50.0,
    "plant.stiffness_deviation": {"xx": 2.0, "xy": 0.5, "yy": -3.0},
    "disturbance.standard_deviation": 3.0,
    "reference.amplitude": [0.9, 0.8],
    "controller.force_limit": 2000.0,
}
LAW: dict[str, Any] = {
    "controller.fractional_gain": [12.0, 9.0],
    "controller.layer_thickness": 0.03,
    "controller.rate_law": "printed",
    "adaptation.rate_gain": 80.0,
    "adaptation.rate_forgetting": 0.4,
}
TUNABLE = {
    "the paper's": ("the paper's, whole", TUNED | LAW),
    "composite, positions only, a moving rate": (
        "composite adaptation behind an observer, moving rate",
        {key: value for key, value in (TUNED | LAW).items() if key != "plant.angular_rate"},
    ),
    "joint, a real device": ("joint adaptation of a device", TUNED | LAW),
    "PID": ("PID, which reports nothing", TUNED | {"controller.damping_ratio": 0.9}),
    "force rebalance": ("force_rebalance", TUNED | {"controller.rebalance_bandwidth": 0.03}),
}


def parts(changes: dict[str, Any]) -> dict[str, Any]:
    """By the names of their parts."""
    found: dict[str, Any] = {}
    for name, value in changes.items():
        if isinstance(value, list):
            found |= {f"{name}.{axis}": number for axis, number in zip("xy", value, strict=True)}
        else:
            found |= {f"{name}.{part}": n for part, n in value.items()} if isinstance(value, dict) else {name: value}
    return found


@pytest.mark.parametrize("name", TUNABLE)
def test_what_is_set_while_it_runs_acts_as_in_python(module: Path, tmp_path: Path, name: str) -> None:
    of, changes = TUNABLE[name]
    scenario = SCENARIOS[of].replace({"run.record_every": 1, "run.duration": 2.0})
    code = f"""
    const changes = {json.dumps(parts(changes))};
    const back = Object.fromEntries(Object.keys(changes).map((name) => [name, own.settings[name]]));
    const loop = await fracgyro.loop(own);
    const rows = [loop.run(700)];
    loop.set(changes);
    rows.push(loop.run(600));
    loop.set(back);
    rows.push(loop.run(701));
    write("rows", Buffer.concat(rows.map((part) => new Uint8Array(part.buffer, 0, part.byteLength))));
    """
    in_node(module, tmp_path, code, scenario)
    tables = scenario.model_dump()
    back = {path: tables[path.split(".")[0]][path.split(".")[1]] for path in changes}
    expected = loop_rows(scenario, [700, 600, 701], [changes, back])
    assert not np.array_equal(expected[:2001], recorded(scenario)[:2001])
    assert_same_bits(np.fromfile(tmp_path / "rows"), expected)


def test_a_kick_adds_to_the_velocity_and_nothing_else_at_once(module: Path, tmp_path: Path) -> None:
    code = """
    const [kicked, plain] = [await fracgyro.loop(own), await fracgyro.loop(own)];
    kicked.run(100), plain.run(100);
    kicked.kick([0.25, -3]);
    const [a, b] = [kicked.run(50), plain.run(50)];
    console.log(JSON.stringify([...a.subarray(0, 4)].map((number, i) => number - b[i])));
    console.log(JSON.stringify(kicked.columns.slice(0, 4)), a.every((number, i) => number === b[i]));
    try { kicked.kick([1, NaN]); } catch (e) { console.log(e.message); }
    """
    difference, rest, refused = in_node(module, tmp_path, code).splitlines()
    assert json.loads(difference) == pytest.approx([0.0, 0.0, 0.25, -3.0], abs=1e-12)
    assert rest == '["position.x","position.y","velocity.x","velocity.y"] false'
    assert refused == "velocity is 1,NaN: it must be two finite numbers"


@pytest.mark.parametrize("name", ["the paper's, whole", "joint adaptation of a device", "force_rebalance"])
def test_a_saved_loop_resumes_to_the_bit_with_what_was_set(module: Path, tmp_path: Path, name: str) -> None:
    code = """
    const loop = await fracgyro.loop(own);
    loop.run(300);
    loop.set({ "plant.angular_rate": 60, "controller.force_limit": null });
    loop.kick([0.1, 0]);
    const { state } = loop;
    const expected = loop.run(500);
    loop.set({ "plant.angular_rate": 80 });
    loop.state = state;
    const same = (a, b) => Buffer.compare(Buffer.from(a.buffer), Buffer.from(b.buffer)) === 0;
    console.log(same(loop.run(500), expected));
    const other = await fracgyro.loop(own);
    other.state = state;
    console.log(other.time, same(other.run(500), expected));
    """
    scenario = SCENARIOS[name].replace({"run.record_every": 1})
    assert in_node(module, tmp_path, code, scenario).splitlines() == ["true", "0.3 true"]


def test_a_loop_takes_no_other_state_and_goes_on(module: Path, tmp_path: Path) -> None:
    code = """
    const loop = await fracgyro.loop(own);
    loop.run(20);
    const { state } = loop;
    const reported = (bytes) => {
      try { loop.state = bytes; } catch (e) { console.log(`${e.name}: ${e.message}`); }
    };
    reported((await fracgyro.loop(own, { "controller.layer_thickness": 0.05 })).state);
    reported((await fracgyro.loop(own, { "run.duration": 90 })).state);
    reported("state");
    reported(state.slice(0, -1));
    for (const place of [1, 5000, state.length - 300]) {
      const bad = state.slice();
      bad[bad.length - place] ^= 1;
      reported(bad);
    }
    const again = loop.state;
    console.log(again.length === state.length && again.every((byte, i) => byte === state[i]));
    """
    other = "RangeError: state was saved by another version, or by a loop of another scenario"
    none = "TypeError: state must be a Uint8Array, as it was saved"
    damaged = "RangeError: state is damaged: it is not as it was saved"
    assert in_node(module, tmp_path, code).splitlines() == [other, other, none, *4 * [damaged], "true"]


NOT_SET = {
    '{ "reference.frequency.x": 1 }': "reference.frequency.x cannot be set while the loop runs: "
    "it acts only at the start",
    '{ "run.step": 2e-3 }': "run.step cannot be set while the loop runs: it acts only at the start",
    '{ "disturbance.seed": 3 }': "disturbance.seed cannot be set while the loop runs: it acts only at the start",
    '{ "controller.order": 0.8 }': "controller.order cannot be set while the loop runs: it acts only at the start",
    '{ "controller.kind": "linear" }': "controller.kind cannot be set while the loop runs: it acts only at the start",
    '{ "adaptation.kind": "joint" }': "adaptation.kind cannot be set while the loop runs: "
    "the controller would be another one",
    '{ "controller.layer_thickness": -1 }': "controller.layer_thickness is -1: it must be at least 0",
    '{ "controller.nothing": 1 }': "controller.nothing is not a known setting; see fracgyro.fields",
    '{ "controller.damping_ratio": 1 }': "controller.damping_ratio is not a setting of the controller "
    "fractional_fast_terminal",
}


def test_what_cannot_be_set_is_refused_in_one_sentence_and_changes_nothing(module: Path, tmp_path: Path) -> None:
    code = f"""
    const [loop, plain] = [await fracgyro.loop(own), await fracgyro.loop(own)];
    loop.run(50), plain.run(50);
    for (const wrong of [{", ".join(NOT_SET)}]) {{
      try {{ loop.set(wrong); }} catch (e) {{ console.log(e.message); }}
    }}
    const [a, b] = [loop.run(50), plain.run(50)];
    console.log(a.every((number, i) => number === b[i]));
    try {{ loop.run(0); }} catch (e) {{ console.log(e.message); }}
    """
    few = "samples is 0: it must be a whole number from 1 to 1000000000"
    assert in_node(module, tmp_path, code).splitlines() == [*NOT_SET.values(), "true", few]


def test_a_loop_that_is_tuned_again_and_again_takes_no_more_memory(module: Path, tmp_path: Path) -> None:
    """With points of a rate, which its setup keeps in memory of its own."""
    code = """
    let taken;
    const { instantiate } = WebAssembly;
    WebAssembly.instantiate = async (...given) => {
      const instance = await instantiate(...given);
      taken = instance.exports.memory;
      return instance;
    };
    const loop = await fracgyro.loop(own);
    const tune = (times) => {
      for (let i = 0; i < times; ++i) {
        loop.set({ "disturbance.standard_deviation": i % 7 });
        loop.run(1);
      }
      return taken.buffer.byteLength;
    };
    console.log(tune(10) === tune(2000));
    """
    scenario = SCENARIOS["composite adaptation behind an observer, moving rate"]
    assert in_node(module, tmp_path, code, scenario) == "true\n"


def test_a_loop_that_diverges_says_when(module: Path, tmp_path: Path) -> None:
    coarse = SHORT.replace({"run.step": 1e-2, "disturbance.hold": None, "run.duration": 20.0})
    code = """
    const loop = await fracgyro.loop(own);
    console.log(loop.diverged);
    const rows = loop.run(2001);
    console.log(loop.diverged, rows.length / loop.columns.length * own.settings["run.step"], loop.run(5).length);
    """
    before, after = in_node(module, tmp_path, code, coarse).splitlines()
    with pytest.raises(fg.DivergedError) as raised:
        fg.simulate(coarse)
    diverged, rows, more = map(float, after.split())
    assert before == "null"
    assert diverged == pytest.approx(rows) == pytest.approx(coarse.run.step * raised.value.run.sizes["time"])
    assert more == 0


# -- The controller


def check_controller_alone(module: Path, tmp_path: Path, scenario: fg.Scenario) -> tuple[dict[str, Any], fg.Controller]:
    """Return the final values in JavaScript and in Python."""
    run = fg.simulate(scenario)
    motion = np.hstack([run["position"].values, run["velocity"].values])
    motion.tofile(tmp_path / "motion")
    code = """
    const motion = new Float64Array(readFileSync(process.argv[2] + "/motion").buffer);
    const steps = motion.length / 4;
    for (const module of [fracgyro, inSingle]) {
      let controller = await module.controller(own);
      const forces = new Float64Array(2 * steps);
      for (let n = 0; n < steps; ++n) {
        if (n === 1000) {
          const { state } = controller;
          controller = await module.controller(own);
          controller.state = state;
        }
        const [x, y, vx, vy] = motion.subarray(4 * n, 4 * n + 4);
        forces.set(controller.step([x, y], [vx, vy]), 2 * n);
      }
      write(module.single ? "single" : "double", forces);
      console.log(JSON.stringify(controller.report));
    }
    """
    double, single = map(json.loads, in_node(module, tmp_path, code, scenario).splitlines())
    expected = run["control"].values.copy()
    assert_same_bits(np.fromfile(tmp_path / "double"), expected)
    difference = np.fromfile(tmp_path / "single").reshape(-1, 2) - expected
    assert 0 < np.abs(difference).max() < 1e-2 * np.abs(expected).max()

    controller = fg.Controller(scenario)
    for n, (x, y, vx, vy) in enumerate(motion):
        controller.step(n * scenario.run.step, [x, y], [vx, vy])
    assert double["stiffness_estimate"] == list(controller.estimates.stiffness)
    assert double["bound_estimate"] == list(controller.estimates.bound)
    rel = 1e-3 if scenario.adaptation.kind == "gradient" else 1e-2  # a quarter of the estimate's own deviation
    assert single["rate_estimate"] == pytest.approx(controller.estimates.rate, rel=rel)
    return double, controller


def test_the_controller_alone_has_the_bits_of_the_python_one_and_resumes(module: Path, tmp_path: Path) -> None:
    double, _ = check_controller_alone(module, tmp_path, SHORT)
    assert "rate_trusted" not in double


def test_so_has_the_controller_with_composite_adaptation_from_positions(module: Path, tmp_path: Path) -> None:
    scenario = SHORT.replace({"adaptation.kind": "composite", "device.sensing": "position"})
    double, controller = check_controller_alone(module, tmp_path, scenario)
    assert double["rate_deviation"] == controller.estimates.rate_deviation
    assert double["rate_trusted"] == 1
    assert controller.estimates.rate_trusted


def test_an_absurd_sample_is_not_believed_and_leaves_no_force_without_end(module: Path, tmp_path: Path) -> None:
    code = """
    const controller = await fracgyro.controller(own);
    for (const x of [0.5, 1e300, 0.5, NaN, -Infinity, 7, 0.5]) {
      const force = controller.step([x, 0.5], [0, 0]);
      console.log(controller.status, force.every((f) => Math.abs(f) <= 6000));
    }
    try { controller.step([0.5, "0.5"], [0, 0]); } catch (e) { console.log(e.message); }
    """
    scenario = SHORT.replace({"controller.force_limit": 6000.0})
    refused = "position and velocity are 0.5,0.5,0,0: each must be two numbers"
    held = ["ok true", "out_of_range true", "ok true", "not_finite true", "not_finite true"]
    reported = [*held, "saturated true", "saturated true", refused]
    assert in_node(module, tmp_path, code, scenario).splitlines() == reported
    lost = ["ok true", "out_of_range true", *["lost true"] * 5, refused]
    assert in_node(module, tmp_path, code, scenario.replace({"guard.checked": True})).splitlines() == lost


WRONG = {
    '{ "plant.stiffness.xx": -1 }': "plant.stiffness is -1,12.779,95.92: it must be positive definite",
    '{ "plant.damping.xx": -1 }': "plant.damping is -1,3.6e-7,0.0000018: it must be positive semidefinite",
    '{ "plant.stiffness_deviation.yy": -2e3 }': "plant.stiffness plus plant.stiffness_deviation is "
    "63.955,12.779,-1904.08: it must be positive definite",
    '{ "controller.oder": 0.8 }': "controller.oder is not a known setting; see fracgyro.fields",
    '{ "controller.order": 1.5 }': "controller.order is 1.5: it must be at most 1",
    '{ "run.step": 1e-201, "run.duration": 1e-200 }': "run.step is 1e-201: it must lie between 1e-200 and 1e200",
    '{ "controller.order": 1, "run.duration": 1e7 }': "run.duration is 10000000: "
    "it must be 1 to 1000000000 times run.step",
    '{ "controller.terminal_exponent": 1 }': "controller.terminal_exponent is 1: it must be less than 1",
    '{ "controller.kind": "sliding" }': f"controller.kind is sliding: it must be one of {', '.join(KINDS)}",
    '{ "controller.natural_frequency": 1 }': "controller.natural_frequency is not a setting of the controller "
    "fractional_fast_terminal",
    '{ "controller.kind": "pid" }': "controller.natural_frequency is missing: it must be given",
    '{ "device.sensing": "velocity" }': "device.sensing is velocity: it must be one of full, position",
    '{ "controller.filter": "kalman", "adaptation.kind": "joint" }': (
        "controller.filter is kalman: fractional_fast_terminal filters the measurements itself; it must be none"
    ),
    '{ "controller.observer_bandwidth": 0 }': "controller.observer_bandwidth is 0: it must be greater than 0",
    '{ "controller.adaptive": 1 }': "controller.adaptive is 1: it must be one of false, true",
    '{ "plant.angular_rate": NaN }': "plant.angular_rate is NaN: it must be a finite number",
    '{ "run.record_every": 2**32 + 1 }': "run.record_every is 4294967297: it must be at most 1000000000",
    '{ "disturbance.hold_steps": 2**40 }': "disturbance.hold_steps is 1099511627776: it must be at most 1000000000",
    '{ "reference.frequency.x": 1e19 }': "reference.frequency.x is 10000000000000000000: it must be at most 1000000",
    "{ toString: 1 }": "toString is not a known setting; see fracgyro.fields",
    "{ constructor: 1 }": "constructor is not a known setting; see fracgyro.fields",
    "{ hasOwnProperty: 1 }": "hasOwnProperty is not a known setting; see fracgyro.fields",
    "JSON.parse('{ \"__proto__\": 1 }')": "__proto__ is not a known setting; see fracgyro.fields",
    '{ "controller.order": 1, "run.duration": 1e5 }': "run.record_every is 1: it must be larger, "
    "as 100000001 samples do not fit into memory",
    '{ "disturbance.seed": 0.5 }': "disturbance.seed is 0.5: it must be a whole number below 2^53",
}


def test_wrong_settings_are_refused_in_one_sentence(module: Path, tmp_path: Path) -> None:
    tries = ", ".join(WRONG)
    code = f"for (const wrong of [{tries}]) await fracgyro.simulate(own, wrong).catch((e) => console.log(e.message));"
    assert in_node(module, tmp_path, code).splitlines() == list(WRONG.values())


def test_a_scenario_that_is_none_is_refused_in_one_sentence(module: Path, tmp_path: Path) -> None:
    code = """
    const reported = (scenario) => fracgyro.simulate(scenario).catch((e) => console.log(`${e.name}: ${e.message}`));
    const { "disturbance.seed": seed, ...others } = own.settings;
    await reported({ ...own, settings: others });
    """
    missing = "RangeError: disturbance.seed is missing: it must be given"
    assert in_node(module, tmp_path, code).splitlines() == [missing]


def test_the_noise_of_a_device_is_for_one_step(module: Path, tmp_path: Path) -> None:
    code = 'await fracgyro.simulate(own, { "run.step": 5e-4 }).catch((e) => console.log(e.message));'
    refused = "run.step is 0.0005: it must be 0.001, which the noise and times of its device are for\n"
    assert in_node(module, tmp_path, code, SCENARIOS["joint adaptation of a device"]) == refused


def test_terms_of_a_disturbance_are_for_one_step_and_checked(module: Path, tmp_path: Path) -> None:
    code = """
    const run = (changes, term = {}) => {
      const disturbance = own.disturbance.map((each) => ({ ...each, ...term }));
      return fracgyro.simulate({ ...own, disturbance }, changes).catch((e) => console.log(e.message));
    };
    await run({ "run.step": 5e-4 });
    await run({}, { numbers: { ...own.disturbance[0].numbers, "disturbance.hold_steps": 0 } });
    await run({}, { numbers: {} });
    await run({}, { rows: [[1], [1], []] });
    await run({}, { rows: [[1], [1], [null]] });
    """
    rows = "disturbance has rows of different lengths, or with numbers that are not finite"
    assert in_node(module, tmp_path, code, LIST).splitlines() == [
        "run.step is 0.0005: it must be 0.001, which the times of its disturbance are for",
        "disturbance.hold_steps is 0: it must be at least 1",
        "disturbance.kind is missing: it must be given",
        rows,
        rows,
    ]


def test_numbers_of_a_device_are_checked(module: Path, tmp_path: Path) -> None:
    code = """
    const run = (name, value) => {
      const numbers = { ...own.device.numbers, [name]: value };
      const device = { ...own.device, numbers };
      return fracgyro.simulate({ ...own, device }).then(() => console.log("runs"), (e) => console.log(e.message));
    };
    await run("device.delay", 2);
    await run("device.delay", 5000);
    await run("device.delay", 1.5);
    await run("device.position_range.x", null);
    await run("device.position_noise", NaN);
    await run("rate.kind", 6);
    """
    assert in_node(module, tmp_path, code, SCENARIOS["joint adaptation of a device"]).splitlines() == [
        "runs",
        "device.delay is 5000: it must be at most 1000",
        "device.delay is 1.5: it must be a whole number below 2^53",
        "runs",
        "device.position_noise is NaN: it must be a finite number",
        "rate.kind is 6: it must be at most 5",
    ]


def test_a_state_of_another_controller_is_refused(module: Path, tmp_path: Path) -> None:
    code = """
    const controller = await fracgyro.controller(own);
    const reported = (state) => {
      try { controller.state = state; } catch (e) { console.log(`${e.name}: ${e.message}`); }
    };
    reported((await fracgyro.controller(own, { "controller.layer_thickness": 0.05 })).state);
    reported((await inSingle.controller(own)).state);
    const { state } = controller;
    reported("state");
    reported(state.slice(0, -1));
    state[state.length - 9] ^= 1;
    reported(state);
    """
    other = "RangeError: state was saved by another version, or by a controller of another scenario or precision"
    damaged = "RangeError: state is damaged: it is not as it was saved"
    none = "TypeError: state must be a Uint8Array, as it was saved"
    assert in_node(module, tmp_path, code).splitlines() == [other, other, none, damaged, damaged]


def test_divergence_is_told_and_the_samples_until_then_are_kept(module: Path, tmp_path: Path) -> None:
    coarse = SHORT.replace({"run.step": 1e-2, "disturbance.hold": None, "run.duration": 20.0})
    code = 'const run = await fracgyro.simulate(own); console.log(run.diverged); write("rows", run.rows);'
    reported = float(in_node(module, tmp_path, code, coarse))
    with pytest.raises(fg.DivergedError, match=f"t = {reported:.6g}"):
        fg.simulate(coarse)
    rows = recorded(coarse)
    assert_same_bits(np.fromfile(tmp_path / "rows"), rows[~np.isnan(rows[:, 0])].copy())


def test_a_page_can_change_the_kind_and_gives_the_settings_that_it_has(module: Path, tmp_path: Path) -> None:
    changes = {"controller.natural_frequency": 150.0, "controller.damping_ratio": 0.9}
    scenario = SHORT.replace({"controller.kind": "pid", **changes})
    given = {
        "controller.kind": "pid",
        "controller.integral_frequency": scenario.controller.integral_frequency,
        **changes,
    }
    code = f"""
    const run = await fracgyro.simulate(own, {json.dumps(given)});
    write("rows", run.rows);
    const controller = await fracgyro.controller(own, {json.dumps(given)});
    console.log(JSON.stringify(controller.step([0.5, 0.5], [0, 0])), JSON.stringify(controller.report));
    """
    force, report = in_node(module, tmp_path, code).split()
    assert_same_bits(np.fromfile(tmp_path / "rows"), recorded(scenario))
    assert json.loads(force) == list(fg.Controller(scenario).step(0.0, [0.5, 0.5], [0.0, 0.0]))
    assert report == "{}"


class Learning:
    """Feedback that adapts a rate, from every part of a sample."""

    def __init__(self) -> None:
        self.rate = 0.0
        self.last = (0.0, 0.0)

    def __call__(self, s: fg.Sample) -> tuple[float, float]:
        (x, y), (vx, vy), (ex, ey), (dx, dy) = s.position, s.velocity, s.error, s.error_rate
        self.rate += 0.1 * ((dx + 100.0 * ex) * vy - (dy + 100.0 * ey) * vx)
        ux = s.reference_acceleration[0] + 355.0 * s.reference[0] + x - 4e4 * ex - 280.0 * dx - 2.0 * self.rate * vy
        uy = s.reference_acceleration[1] + 532.0 * s.reference[1] + y - 4e4 * ey - 280.0 * dy + 2.0 * self.rate * vx
        self.last = (s.time, s.reference_velocity[1])
        return ux, uy

    def report(self) -> dict[str, Any]:
        return {"rate_estimate": self.rate, "last": self.last}


LEARNING = """
const law = () => {
  let [rate, last] = [0, [0, 0]];
  return {
    force(s) {
      const [[x, y], [vx, vy], [ex, ey], [dx, dy]] = [s.position, s.velocity, s.error, s.error_rate];
      rate += 0.1 * ((dx + 100 * ex) * vy - (dy + 100 * ey) * vx);
      last = [s.time, s.reference_velocity[1]];
      return [
        s.reference_acceleration[0] + 355 * s.reference[0] + x - 4e4 * ex - 280 * dx - 2 * rate * vy,
        s.reference_acceleration[1] + 532 * s.reference[1] + y - 4e4 * ey - 280 * dy + 2 * rate * vx,
      ];
    },
    report: () => ({ rate_estimate: rate, last }),
  };
};
"""


@pytest.mark.parametrize("name", ["exact", "real"])
def test_a_law_of_the_callers_runs_like_a_callable_in_python(module: Path, tmp_path: Path, name: str) -> None:
    real = {"device.sensing": "position", "device.position_noise_density": 1e-14, "controller.force_limit": 900.0}
    scenario = SHORT.replace({"run.duration": 2.0, **(real if name == "real" else {})})
    code = """
    const run = await fracgyro.simulate(own, {}, { law: law() });
    const loop = await fracgyro.loop(own, {}, { law: law() });
    const parts = [loop.run(700), (loop.kick([0, 0]), loop.run(1301))];
    write("rows", run.rows);
    write("parts", new Float64Array(parts.flatMap((part) => [...part])));
    console.log(JSON.stringify(run.columns));
    """
    columns = json.loads(in_node(module, tmp_path, LEARNING + code, scenario))
    rows = np.fromfile(tmp_path / "rows").reshape(-1, len(columns))
    assert_same_bits(np.fromfile(tmp_path / "parts"), rows)
    run = fg.simulate(scenario, controller=Learning())
    for channel in ("position", "control", "rate_estimate", "last"):
        values = run[channel].values.reshape(len(rows), -1)
        places = [i for i, column in enumerate(columns) if column.split(".")[0] == channel]
        assert_same_bits(np.ascontiguousarray(rows[:, places]), np.ascontiguousarray(values))


WRONG_LAWS = {
    "(s) => [NaN, 1]": "LawError: the law returned [NaN,1] at t = 0: it must return two finite numbers",
    "(s) => (s.time < 0.0015 ? [0, 0] : [1])": "LawError: the law returned [1] at t = 0.002: it must return two finite",
    "(s) => undefined": "LawError: the law returned undefined at t = 0: it must return two finite numbers",
    "(s) => 'ab'": "LawError: the law returned ab at t = 0: it must return two finite numbers",
    "(s) => { throw new Error('mine'); }": "Error: mine",
    "{ report: () => ({}) }": "LawError: the law must be a function, or have a function force",
    "{ force: (s) => [0, 0], report: () => ({ position: 1 }) }": "LawError: report() of the law has position, which ",
    "{ force: (s) => [0, 0], report: () => ({ a: 'x' }) }": "LawError: report() of the law has a x: it must be a num",
    "{ n: 0, force: (s) => [0, 0], report() { return this.n++ > 5 ? {} : { a: [1, 2] }; } }": (
        "LawError: report() of the law has a undefined: it must be two numbers"
    ),
}


def test_a_law_that_returns_no_force_ends_the_run_with_one_sentence(module: Path, tmp_path: Path) -> None:
    code = f"""
    for (const text of {json.dumps(list(WRONG_LAWS))}) {{
      const law = eval(`(${{text}})`);
      await fracgyro.simulate(own, {{}}, {{ law }}).then(
        () => console.log("ran"),
        (error) => console.log(`${{error.constructor.name}}: ${{error.message}}`),
      );
    }}
    const filtered = fracgyro.simulate(own, {{ "controller.filter": "kalman" }}, {{ law: law() }});
    await filtered.catch((error) => console.log(error.message));
    const sent = fracgyro.simulate(own, {{ "controller.event_threshold": 3 }}, {{ law: law() }});
    await sent.catch((error) => console.log(error.message));
    const loop = await fracgyro.loop(own, {{}}, {{ law: law() }});
    try {{ loop.state; }} catch (error) {{ console.log(error.message); }}
    """
    *found, filtered, sent, state = in_node(module, tmp_path, LEARNING + code).splitlines()
    for said, sentence in zip(found, WRONG_LAWS.values(), strict=True):
        assert said.startswith(sentence)
    assert filtered == "controller.filter is kalman: with a law of your own it is none"
    assert sent == "controller.event_threshold is 3: with a law of your own it is 0"
    assert state == "state cannot be saved or set: the memory of a law of your own is not in it"
