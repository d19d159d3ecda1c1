"""The exported firmware: its files, its safety, and the same bits on every processor."""

from __future__ import annotations

import math
import os
import re
import subprocess
import sys
from itertools import product
from pathlib import Path
from typing import Any

import fracgyro as fg
import numpy as np
import pytest
from children import PATIENCE
from command_server import fracgyro
from embedded import STRICT, need
from fracgyro import _core
from fracgyro.export.clock import clock_of
from fracgyro.export.compilers import SOURCES, Number, compiler, make
from fracgyro.export.host import SCALARS, Host, flags, plant_of, rmse
from fracgyro.export.replay import first_difference
from fracgyro.export.settings import columns
from fracgyro.export.targets import BOARDS, DTYPES, EMULATOR
from fracgyro.scenario import kinds
from fracgyro.scenario.to_core import core_setup, guard
from nightly import nightly_unless
from shared import shared

ROOT = Path(__file__).resolve().parents[2]
PAPER = fg.Scenario.paper().replace({"controller.switching_limit": 0.5})
LIMITED = PAPER.replace({"controller.force_limit": 1000.0})
CHECKED = LIMITED.replace({"guard.checked": True})
KINDS = {
    **{kind: {"controller.kind": kind} for kind in kinds.KINDS},
    "fractional_of_order_one": {"controller.order": 1.0},
    "composite": {"adaptation.kind": "composite", "adaptation.rate_forgetting": 2.0},
    "joint": {"adaptation.kind": "joint", "adaptation.rate_forgetting": 2.0},
    "joint, divided": {"adaptation.kind": "joint", "adaptation.covariance_steps": 4},
}
OK, SATURATED, NOT_FINITE, OUT_OF_RANGE, RESTARTED, REFUSED, IMPLAUSIBLE, LOST = range(8)
NAN, INF = math.nan, math.inf


@pytest.fixture(scope="session")
def limited_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    def fill(folder: Path) -> None:
        fg.export.firmware(LIMITED, folder)
        Host(folder, "float")  # compiles it

    return shared(tmp_path_factory, "limited firmware", fill)


@pytest.fixture(scope="session")
def checked_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    def fill(folder: Path) -> None:
        fg.export.firmware(CHECKED, folder)
        Host(folder, "float")  # compiles it

    return shared(tmp_path_factory, "checked firmware", fill)


@pytest.fixture
def limited(limited_folder: Path) -> Host:
    return Host(limited_folder, "float")


# -- Files ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("scenario", "field"),
    [
        (fg.Scenario.shipped("dual_mass").replace({"datasheet.force_noise": 1e20}), "datasheet.force_noise is 1e+20"),
        (
            fg.Scenario.shipped("dual_mass").replace({"datasheet.stiffness_drift": 1e30}),
            "datasheet.stiffness_drift is 1e+30",
        ),
        (PAPER.replace({"adaptation.rate_gain": 1e60}), "adaptation.rate_gain is 1e+60"),
    ],
)
def test_what_float_cannot_hold_is_refused(scenario: fg.Scenario, field: str, tmp_path: Path) -> None:
    scenario = scenario.replace({"controller.force_limit": 1000.0, "controller.switching_limit": 0.5})
    fg.Controller(scenario)  # double can
    for take in (
        lambda: fg.Controller(scenario, single_precision=True),
        lambda: fg.measure_many([scenario], single_precision=True),
        lambda: fg.export.firmware(scenario, tmp_path / "made", unbounded=True),
        lambda: fg.export.fmu(scenario, tmp_path / "made", content="controller", number="float", unbounded=True),
    ):
        with pytest.raises(ValueError, match=rf"^{re.escape(field)}, nondimensional: it makes a coefficient of "):
            take()
    assert not (tmp_path / "made").exists()


def test_the_same_scenario_gives_the_same_bytes_and_the_cores_headers_unchanged(tmp_path: Path) -> None:
    for name in "ab":
        fg.export.firmware(PAPER, tmp_path / name)
    a, b = (
        {p.relative_to(f): p.read_bytes() for p in f.rglob("*") if p.is_file()}
        for f in (tmp_path / "a", tmp_path / "b")
    )
    assert a == b
    layers = [ROOT / "include/fracgyro" / layer for layer in ("core", "control")]
    headers = {p.relative_to(ROOT): p.read_bytes() for layer in layers for p in layer.rglob("*.hpp")}
    assert {path: a.get(path) for path in headers} == headers
    text = a[Path("fracgyro_coefficients.h")].decode()
    assert PAPER.content_hash() in text
    commented = [line.removeprefix("//").removeprefix(" ") for line in text.splitlines() if line.startswith("//")]
    toml = "\n".join(commented[commented.index(PAPER.to_toml().splitlines()[0]) :]) + "\n"
    assert fg.Scenario.from_toml(toml) == PAPER


def test_another_scenario_gives_another_key(tmp_path: Path) -> None:
    for name, scenario in {"a": PAPER, "b": PAPER.replace({"controller.order": 0.8})}.items():
        fg.export.firmware(scenario, tmp_path / name)
    keys = {re.findall(r"KEY (\S+)", (tmp_path / name / "fracgyro_coefficients.h").read_text())[0] for name in "ab"}
    assert len(keys) == 2


@pytest.mark.parametrize(
    ("kind", "number"),
    nightly_unless(
        lambda kind, number: (number == "float") == (list(KINDS).index(kind) % 2 == 0), product(KINDS, SCALARS)
    ),
)
def test_every_kind_of_controller_answers_as_the_simulator_does(kind: str, number: Number, tmp_path: Path) -> None:
    scenario = PAPER.replace({**KINDS[kind], "run.duration": 0.5})
    if scenario.controller.kind in kinds.kinds_with("controller.terminal_exponent"):
        scenario = scenario.replace({"controller.terminal_exponent": 0.6})
    if kind == "lqg" or kind.startswith("joint"):  # beyond what only float allows for, its rounding
        scenario = scenario.replace({"datasheet.position_noise": 1e-6, "datasheet.velocity_noise": 1e-5})
    fg.export.firmware(scenario, tmp_path / "out", number)
    host, ours = Host(tmp_path / "out", number), fg.Controller(scenario)
    run = fg.simulate(scenario)
    for n in range(run.sizes["time"]):
        q, v = run["position"].values[n], run["velocity"].values[n]
        host.step(tuple(q), tuple(v))
        wanted = ours.step(n * 1e-3, q, v)
        if number == "double":
            assert host.force == tuple(wanted)
        else:  # κ, a difference over a step, has some 1e-7/1e-3 of rounding error, which λ1 I^ν amplifies
            # The joint filter's first estimates, of few samples, are the more sensitive to it.
            # For lqg they are multiplied by its gain of 1e5.
            atol = 20.0 if kind == "lqg" else 5.0 if kind.startswith("joint") else 0.5
            np.testing.assert_allclose(host.force, wanted, rtol=1e-2, atol=atol)
    if kind == "composite":
        report = ours.estimates
        expected = [report.rate, report.rate_deviation, report.rate_trusted]
        found = [host.report[name][0] for name in ("rate_estimate", "rate_deviation", "rate_trusted")]
        np.testing.assert_allclose(
            found, expected, rtol=0, atol=0.0 if number == "double" else 0.1 * report.rate_deviation
        )
        assert report.rate_trusted
    if number == "double":
        assert list(np.hstack([np.array([]), *host.report.values()])) == list(ours._core.report)


@pytest.mark.parametrize("number", SCALARS)
def test_without_a_sensor_of_velocity_it_observes_it_and_looks_at_none(number: Number, tmp_path: Path) -> None:
    scenario = PAPER.replace({"device.sensing": "position", "run.duration": 0.5})
    fg.export.firmware(scenario, tmp_path / "out", number)
    host = Host(tmp_path / "out", number)
    run = fg.simulate(scenario)
    for n, q in enumerate(run["position"].values):
        assert host.step(tuple(q), (NAN, 1e30)) == OK
        wanted = run["control"].values[n]
        if number == "double":
            assert host.force == tuple(wanted)
        else:  # the observer's gains, 175/h⁰ and 2e4, amplify 1e-7 of rounding; λ1 and the layer what comes of it
            np.testing.assert_allclose(host.force, wanted, rtol=1e-2, atol=0.5)


def example(folder: Path) -> str:
    """Output of `make`."""
    cc = os.environ.get("CC", "cc")
    warnings = ["WARNINGS=-Wall -Wextra -Wconversion -Wdouble-promotion -Werror"] if STRICT else []
    return make(folder, "host", f"CC={cc}", f"CXX={' '.join(compiler())}", *warnings)


def test_the_header_is_clean_c99(tmp_path: Path) -> None:
    fg.export.firmware(PAPER, tmp_path / "out")
    cc = os.environ.get("CC", "cc")
    strict = ["-std=c99", "-pedantic-errors", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-fsyntax-only", "-xc"]
    subprocess.run([*cc.split(), *strict, "fracgyro.h"], cwd=tmp_path / "out", check=True)


@pytest.mark.parametrize(
    ("scenario", "number", "at_first"),
    [
        (PAPER, "double", OK),
        (fg.Scenario.shipped("hardware"), "float", OK),
        (fg.Scenario.shipped("dual_mass"), "float", SATURATED),  # until the estimates, 0.1 % off, are better
        (PAPER.replace({"controller.kind": "pid"}), "float", OK),
    ],
    ids=["paper", "hardware", "dual_mass", "pid"],
)
def test_the_example_closes_the_loop_on_the_gyroscope_and_prints_what_is_reported(
    scenario: fg.Scenario, number: Number, at_first: int, tmp_path: Path
) -> None:
    fg.export.firmware(scenario, tmp_path / "out", number)
    said = example(tmp_path / "out")
    assert [int(status) for status in re.findall(r"tick \d+: status (\d)", said)] == [at_first, *[OK] * 10]
    # After a thousand steps the motion is that of the simulator, which has noise.
    run = fg.simulate(scenario.replace({"run.duration": 1000 * scenario.run.step, "run.record_every": 1}))
    last = re.search(r"tick 1000: status 0, position (\S+) (\S+),", said)
    assert last is not None
    np.testing.assert_allclose(list(map(float, last.groups())), run["position"].values[-1], atol=0.02)
    shown = re.findall(r"^([a-z_]+(?:\.\w+|\[\d\])?): \S+$", said, re.MULTILINE)
    assert shown == [name for channel in kinds.persistent_channels(core_setup(scenario)) for name in columns(channel)]
    if scenario.adaptation.kind == "joint":
        rate = re.search(r"^rate_estimate: (\S+)$", said, re.MULTILINE)
        assert rate is not None
        assert float(rate[1]) == pytest.approx(scenario.plant.nondimensional()[2], rel=0.01)


def test_the_readme_has_every_status_with_its_number() -> None:
    folder = ROOT / "integrations/firmware"
    listed = re.findall(r"^    (FRACGYRO_\w+) = (\d),?", (folder / "fracgyro.h").read_text(), re.MULTILINE)
    shown = re.findall(r"^\| (\d) \| `(FRACGYRO_\w+)` \|", (folder / "README.md").read_text(), re.MULTILINE)
    assert sorted((name, number) for number, name in shown) == sorted(listed)
    assert len(listed) == 8


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["nowhere.toml", "--out", "out"], "nowhere.toml cannot be read: No such file or directory"),
        (["my.toml", "--out", "full"], "full cannot be written: it already exists; name an empty or a new folder"),
        (["my.toml", "--out", "my.toml"], "my.toml cannot be written: it already exists"),
        (["my.toml", "--out", "out", "--number", "half"], "'half' is not one of 'float', 'double'"),
    ],
)
def test_bad_input_ends_with_one_sentence_and_nothing_written(tmp_path: Path, words: list[str], expected: str) -> None:
    PAPER.save(tmp_path / "my.toml")
    (tmp_path / "full").mkdir()
    (tmp_path / "full/mine").touch()
    ran = fracgyro("export", "firmware", *words, cwd=tmp_path)
    assert (ran.returncode, ran.stdout) == (2, "")
    assert expected in ran.stderr
    assert len(ran.stderr.splitlines()) == 1
    assert sorted(p.name for p in tmp_path.iterdir()) == ["full", "my.toml"]


# -- Safe in the loop ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("bad", "status"),
    [(NAN, NOT_FINITE), (INF, NOT_FINITE), (-INF, NOT_FINITE), (1e7, OUT_OF_RANGE), (-3e38, OUT_OF_RANGE)],
)
@pytest.mark.parametrize("place", range(4))
def test_what_was_not_measured_holds_force_and_estimates_until_measurements_come(
    limited: Host, bad: float, status: int, place: int
) -> None:
    motion = [0.3, 0.8, 0.5, -0.5]
    for _ in range(20):
        assert limited.step(motion[:2], motion[2:]) in (OK, SATURATED)
    force, estimates = limited.force, limited.report
    broken = [*motion[:place], bad, *motion[place + 1 :]]
    for _ in range(50):
        assert limited.step(broken[:2], broken[2:]) == status
        assert (limited.force, limited.report) == (force, estimates)
    limited.step(motion[:2], motion[2:])
    assert limited.report != estimates
    assert all(abs(f) <= 1000.0 for f in limited.force)


def test_before_the_first_measurement_the_force_is_zero_and_time_does_not_start(
    limited: Host, limited_folder: Path
) -> None:
    fresh = Host(limited_folder, "float")
    for _ in range(3):
        assert limited.step((NAN, 0.0), (0.0, 0.0)) == NOT_FINITE
        assert limited.force == (0.0, 0.0)
    for n in range(40):
        for host in (limited, fresh):
            host.step((0.01 * n, 0.9), (0.1, 0.1))
        assert limited.force == fresh.force


def test_the_loop_survives_a_sensor_that_fails_for_a_while(tmp_path: Path) -> None:
    scenario = LIMITED.replace({"run.duration": 20.0, "disturbance.standard_deviation": 0.1})
    fg.export.firmware(scenario, tmp_path / "out")
    # Closed here by hand: 40 samples, 0.04 units of time, are lost at t = 5, a quarter of a natural period later on.
    host, plant = Host(tmp_path / "out", "float"), plant_of(scenario)
    x, y, v, w = 0.5, 0.5, 0.0, 0.0
    errors = []
    for n in range(20_000):
        lost = 5000 <= n < 5040
        status = host.step((NAN, NAN) if lost else (x, y), (v, w))
        assert status == NOT_FINITE if lost else status in (OK, SATURATED)
        fx, fy = host.force
        x, y, v, w = (a * x + b * y + c * v + e * w + f * fx + g * fy for a, b, c, e, f, g in plant)
        t = (n + 1) * 1e-3
        errors.append(math.hypot(x - math.sin(math.pi * t), y - math.cos(math.pi / 2 * t)))
    assert max(errors[5000:5500]) > 0.01, "the outage was felt"
    assert max(errors[15_000:]) < 1e-3, "and overcome"


def test_at_the_limit_the_estimates_rest_where_they_would_wind_up(limited: Host) -> None:
    # Far off, the force is at its limit against the error, and learning could only demand more force.
    for _ in range(3000):
        status = limited.step((20.0, 0.0), (0.0, 0.0))
    wound = limited.report
    for _ in range(1000):
        assert limited.step((20.0, 0.0), (0.0, 0.0)) == status == SATURATED
    assert limited.report == wound
    limited.step((0.0, 0.0), (0.1, 0.1))
    assert limited.report != wound


@pytest.mark.parametrize("place", range(4))
def test_a_sample_that_the_plant_cannot_have_moved_to_is_held_through(place: int, checked_folder: Path) -> None:
    host, run = Host(checked_folder, "float"), fg.simulate(CHECKED.replace({"run.duration": 0.2}))
    motion = np.hstack([run["position"].values, run["velocity"].values])
    for n, (x, y, v, w) in enumerate(motion.tolist()):
        broken = [x, y, v, w]
        force, estimates = host.force, host.report
        if n == 100:
            broken[place] += 1.0
        status = host.step(broken[:2], broken[2:])
        if n == 100:
            assert status == IMPLAUSIBLE
            assert (host.force, host.report) == (force, estimates)
        else:
            assert status in (OK, SATURATED)


def test_sensors_that_are_lost_leave_the_force_of_the_reference_until_enough_samples_agree(
    checked_folder: Path,
) -> None:
    host, run = Host(checked_folder, "float"), fg.simulate(CHECKED.replace({"run.duration": 1.0}))
    motion, stiffness = np.hstack([run["position"].values, run["velocity"].values]), CHECKED.plant.nondimensional()[1]
    patience = guard(CHECKED).patience
    assert patience == 8
    reported = [host.step((NAN, 0.0) if 500 <= n < 600 else m[:2], m[2:]) for n, m in enumerate(motion.tolist())]
    assert reported[500:507] == [NOT_FINITE] * 7
    assert reported[507 : 600 + 4 * patience - 1] == [LOST] * (600 + 31 - 507)
    assert {*reported[:500], reported[631]} <= {OK, SATURATED}
    fresh, wanted = Host(checked_folder, "float"), []
    for n, m in enumerate(motion[:560].tolist()):
        fresh.step((NAN, 0.0) if n >= 500 else m[:2], m[2:])
        r = np.array([math.sin(math.pi * n * 1e-3), math.cos(math.pi / 2 * n * 1e-3)])
        wanted = [stiffness[0] * r[0] + stiffness[1] * r[1], stiffness[1] * r[0] + stiffness[2] * r[1]]
    np.testing.assert_allclose(fresh.force, wanted, rtol=0.2)  # the estimates are off, and r'' counts


def test_long_at_the_limit_the_controller_starts_anew_in_time(tmp_path: Path) -> None:
    fg.export.firmware(LIMITED.replace({"guard.saturation_patience": 100}), tmp_path / "out")
    host = Host(tmp_path / "out", "float")
    before = host.report
    reported = [host.step((20.0, 0.0), (0.0, 0.0)) for _ in range(200)]
    assert reported == ([SATURATED] * 99 + [RESTARTED]) * 2
    assert host.report == before


@pytest.mark.parametrize("number", SCALARS)
def test_nothing_is_called_but_arithmetic(number: Number, tmp_path: Path) -> None:
    need("Cortex-M")
    fg.export.firmware(LIMITED.replace({"controller.terminal_exponent": 0.6}), tmp_path / "out", number)
    for target in ("m4f", "m7"):
        make(tmp_path / "out", f"build/{target}/fracgyro.o")
        command = ["arm-none-eabi-nm", "--undefined-only", "--format=just-symbols", f"build/{target}/fracgyro.o"]
        called = set(subprocess.run(command, cwd=tmp_path / "out", capture_output=True, text=True).stdout.split())
        soft = {name for name in called if name.startswith("__aeabi_")}  # arithmetic that this processor lacks
        # IEEE 754 fixes every bit of a square root; Cortex-M4F has none in double.
        copies = {"memcpy", "memmove", "memset"}  # which GCC expects of every system
        assert called - soft <= {*copies, *(["sqrt"] if (target, number) == ("m4f", "double") else [])}
        frames = (tmp_path / "out/build" / target / "fracgyro.su").read_text()
        assert set(re.findall(r"\t(\w+)$", frames, re.MULTILINE)) == {"static"}, "a stack of fixed size"


@pytest.mark.parametrize(
    "scenario",
    [
        pytest.param(LIMITED, marks=pytest.mark.nightly, id="limited"),
        pytest.param(CHECKED, marks=pytest.mark.nightly, id="checked"),
        pytest.param(CHECKED.replace(KINDS["composite"]), marks=pytest.mark.nightly, id="composite"),
        pytest.param(
            CHECKED.replace({**KINDS["joint"], "device.sensing": "position", "device.position_noise_density": 1e-13}),
            id="positions",
        ),
    ],
)
def test_no_bits_of_memory_are_misused_whatever_the_input(scenario: fg.Scenario, tmp_path: Path) -> None:
    """The corpus of the fuzzer, under the sanitizers."""
    fg.export.firmware(scenario, tmp_path / "out")
    sanitize = ["-O1", "-g1", "-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize-recover=all"]
    sources = ["fracgyro.cpp", ROOT / "tests/firmware/fuzz.cpp", ROOT / "tests/firmware/replay_corpus.cpp"]
    command = [
        *compiler(),
        "-std=c++20",
        *sanitize,
        *flags(tmp_path / "out", "BITS"),
        "-I.",
        "-Iinclude",
        *sources,
        "-o",
        "replay",
    ]
    subprocess.run(command, cwd=tmp_path / "out", check=True)
    corpus = ROOT / "tests/firmware/corpus.jsonl"
    ran = subprocess.run(["./replay", corpus], cwd=tmp_path / "out", capture_output=True, text=True, timeout=PATIENCE)
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout == f"{len(corpus.read_text(encoding='utf-8').splitlines())} inputs\n"


# -- The same bits -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("number", "adaptation"),
    nightly_unless(
        lambda number, adaptation: (number, adaptation) == ("float", "joint"),
        [("float", "gradient"), ("double", "composite"), ("float", "joint"), ("double", "joint")],
    ),
)
def test_a_fault_on_the_way_changes_no_bit_between_processors_and_compilers(
    number: Number, adaptation: str, tmp_path: Path
) -> None:
    """Comparison as in test_parity.py, which covers only motions, with statuses."""
    need("Cortex-M")
    need("gcc")
    need("clang")
    steps = 800
    change = {"controller.terminal_exponent": 0.6, "run.duration": steps * 1e-3, "adaptation.kind": adaptation}
    scenario = LIMITED.replace(change)
    out = tmp_path / "out"
    fg.export.firmware(scenario, out, number)
    run = fg.simulate(scenario)
    motion = np.hstack([run["position"].values, run["velocity"].values])[:steps].astype(DTYPES[number])
    motion[400:410, 2] = NAN
    motion.tofile(out / "motion")
    reported = [name for channel in kinds.persistent_channels(core_setup(scenario)) for name in columns(channel)]
    names, answers = ["status", "control.x", "control.y", *reported], {}
    for target, choice in {
        "gcc": ("CC=gcc", "CXX=g++"),
        "clang": ("CC=clang", "CXX=clang++"),
        "m4f": (),
        "m7": (),
    }.items():
        image = f"build/{target if target in BOARDS else 'host'}/replay"
        make(out, "clean")
        make(out, image, *choice)
        (out / "answer").unlink(missing_ok=True)
        command = [*EMULATOR, "-M", BOARDS[target], "-kernel", image] if target in BOARDS else [image]
        subprocess.run(command, cwd=out, check=True, timeout=PATIENCE)
        answers[target] = np.fromfile(out / "answer", DTYPES[number]).reshape(-1, len(names))
        assert len(answers[target]) == steps
    assert set(answers["gcc"][400:410, 0]) == {NOT_FINITE}
    for target, answer in answers.items():
        assert first_difference(answer, answers["gcc"], names) is None, target


# -- Single precision does not stall -------------------------------------------------------------------------


def test_in_single_precision_a_constant_reaches_its_exact_answer_and_stays_there_for_ten_million_steps() -> None:
    from fracgyro.fractional.kernel import core_kernel

    steps = 10_000_000
    kernel = core_kernel(0.9, 1e-3, 80.0, 1e-6)  # the paper's; the slowest has s h = 1e-6 and is settled at the end
    ones, zeros = np.ones((steps, 1)), np.zeros((steps, 1))
    exact = _core.apply_operator(ones, zeros, kernel, 1e-3)[0]
    single = _core.apply_operator_single(ones.astype(np.float32), zeros.astype(np.float32), kernel, 1e-3)[0]
    assert np.abs(single[1000::1000] / exact[1000::1000] - 1).max() < 1e-4
    assert float(single[-1, 0]) == pytest.approx(float(exact[-1, 0]), rel=1e-4)


def test_in_single_precision_estimates_of_some_355_still_follow_increments_of_a_millionth(tmp_path: Path) -> None:
    # Resting at x = 0.1 on a linear surface with r = 0: s = λ1 x = 1, and K̂xx loses h N x s = 1e-6 a step.
    gains = {"adaptation.stiffness_gain": 0.01, "controller.kind": "linear"}
    scenario = PAPER.replace({**gains, "reference.amplitude": (0.0, 0.0)})
    fg.export.firmware(scenario, tmp_path / "out")
    host = Host(tmp_path / "out", "float")
    before = host.report["stiffness_estimate"][0]
    assert before == pytest.approx(0.95 * 355.3, rel=1e-3)
    for _ in range(200_000):
        host.step((0.1, 0.0), (0.0, 0.0))
    assert before - host.report["stiffness_estimate"][0] == pytest.approx(0.2, rel=0.01)


def test_in_single_precision_the_late_error_is_that_of_double(tmp_path: Path) -> None:
    fg.export.firmware(PAPER, tmp_path / "out")
    double = fg.metrics.rmse(fg.simulate(PAPER), window=(10, None)).values
    np.testing.assert_allclose(rmse(PAPER, Host(tmp_path / "out", "float"), start=10.0), double, rtol=0.05)


# -- Saved and restored --------------------------------------------------------------------------------------


def test_a_restored_controller_goes_on_as_the_saved_one(limited: Host, limited_folder: Path) -> None:
    other = Host(limited_folder, "float")
    for n in range(50):
        limited.step((0.01 * n, 0.9), (0.1, 0.1))
    assert other.restore(limited.save()) == OK
    for n in range(50):
        for host in (limited, other):
            host.step((0.5 - 0.01 * n, 0.9), (0.1, 0.1))
        assert (limited.force, limited.report) == (other.force, other.report)


def test_what_is_damaged_or_of_another_controller_is_refused_and_changes_nothing(limited: Host, tmp_path: Path) -> None:
    fg.export.firmware(LIMITED.replace({"controller.order": 0.8}), tmp_path / "other")
    limited.step((0.5, 0.9), (0.1, 0.1))
    saved = limited.save()
    damaged = bytearray(saved)
    damaged[-40] ^= 1
    for refused in (bytes(damaged), Host(tmp_path / "other", "float").save()):
        assert limited.restore(refused) == REFUSED
        assert limited.save() == saved


# -- Budgets -------------------------------------------------------------------------------------------------


@pytest.mark.nightly  # benchmarks/sources.py lists the table if it is outdated
@pytest.mark.takes_a_minute
def test_the_committed_table_of_instructions_is_what_is_counted() -> None:
    need("Cortex-M")
    ran = subprocess.run(
        [sys.executable, "benchmarks/firmware.py", "--check"], cwd=ROOT, capture_output=True, text=True
    )
    assert ran.returncode == 0, ran.stdout + ran.stderr
    if ran.stdout:
        pytest.skip(ran.stdout.strip())


# -- Cost ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "row"),
    [
        ({"device.sensing": "position"}, "linear, joint, positions"),
        ({"device.sensing": "position", "adaptation.covariance_steps": 8}, "linear, joint, positions, divided by 8"),
        ({"device.sensing": "full"}, "linear, joint, velocities too"),
    ],
)
def test_the_joint_filter_is_exported_with_the_clock_that_it_asks_for(changes: dict[str, Any], row: str) -> None:
    scenario = fg.Scenario.shipped("dual_mass").replace({"adaptation.kind": "joint", **changes})
    table = (SOURCES / "integrations/firmware/measured.md").read_text(encoding="utf-8").splitlines()
    cells = next(line for line in table if line.startswith(f"| {row} | 0 | float |")).split("|")
    most = int(cells[4].split("/")[1])
    step = scenario.run.step * scenario.plant.scales.time
    clock = clock_of(scenario)
    assert clock is not None
    assert clock.instructions == most
    assert f"need {most / step / 1e6:.0f} million instructions per second" in clock.sentence
    times = next(line for line in table if line.startswith(f"| {row} | 0 | ") and " to " in line).split("|")[-2]
    low, high = map(float, times.split(" to "))
    assert f"takes an estimated {low:g} to {high:g} µs per step" in clock.warning
    for microseconds, words in ((0.99 * low, "no listed"), (1.01 * low, "this is close"), (1.01 * high, "")):
        scale = microseconds * 1e-6 / step
        slower = scenario.replace({"plant.reference_frequency": scenario.plant.reference_frequency / scale})
        found = clock_of(slower)
        assert found is not None
        assert found.warning.startswith(words)
        assert bool(found.warning) == bool(words)


def test_the_cost_is_that_of_a_similar_controller_with_as_many_exponentials() -> None:
    table = (SOURCES / "integrations/firmware/measured.md").read_text(encoding="utf-8")
    for scenario in (PAPER, PAPER.replace({"controller.kind": "linear"}), fg.Scenario.shipped("hardware")):
        clock = clock_of(scenario)
        assert clock is not None
        assert f"| {clock.row} |" in table
    assert clock_of(PAPER.replace({"controller.kind": "pid"})) is None, "no such controller was measured"
    assert clock_of(PAPER.replace({"run.kernel_tolerance": 1e-9})) is None, "none had as many exponentials"
