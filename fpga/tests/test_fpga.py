"""A controller as hardware: its graph is the core, its units compute as processors do."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from itertools import pairwise
from pathlib import Path

import fracgyro as fg
import numpy as np
import pytest
from click.testing import CliRunner
from embedded import need
from fracgyro.cli import cli
from fracgyro.export import parity, targets
from fracgyro.export.compilers import SOURCES, make
from fracgyro.export.compilers import run as run_command
from fracgyro.export.host import answers
from fracgyro.export.replay import parity_hash
from fracgyro.simulation.dataset import write_run
from fracgyro_fpga import fpga
from fracgyro_fpga.arithmetic import ARITHMETICS, HardwareNumber
from fracgyro_fpga.desk import IN_FIXED, on_the_desk
from fracgyro_fpga.folder import VERILOG, compiled
from fracgyro_fpga.graph import CPP, Graph, members, trace
from fracgyro_fpga.interpreter import Interpreter
from fracgyro_fpga.microcode import Microcode
from fracgyro_fpga.proof import check
from nightly import nightly_unless
from shared import compile_once, shared

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
# Verilator's own sources and what runs once are not optimized: compiling them would take most of the time.
QUICK = ["-MAKEFLAGS", "OPT_GLOBAL=-O0 OPT_SLOW=-O0"]
STEPS = 400
# Settings that make each path through the law short.
SHORT = fg.Scenario.paper().replace({"run.kernel_tolerance": 2e-2, "run.duration": STEPS * 1e-3})
GUARDED = {
    "guard.checked": True,
    "guard.force_tolerance": 3000.0,
    "guard.patience": 5,
    "guard.saturation_patience": 12,
    "controller.force_limit": 1000.0,
}
SCENARIOS = {
    "the paper's": {},
    "samples checked, forces limited": GUARDED,
    "another power": {"controller.terminal_exponent": 0.6},
    "PID": {"controller.kind": "pid"},
    "resonant": {"controller.kind": "resonant", "controller.force_limit": 1000.0},
    "composite": {"adaptation.kind": "composite"},
    "open loop": {"controller.kind": "open_loop"},
    "super-twisting, positions only": {"controller.kind": "super_twisting", "device.sensing": "position"},
}


@pytest.fixture(scope="session", autouse=True)
def compiled_once(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Programs that trace or answer depend on the controller's type, not on its numbers: one serves many tests."""

    def run(command: list[str], folder: Path | None = None) -> str:
        if "-o" not in command:
            return run_command(command, folder)
        compile_once(tmp_path_factory, command, run_command)
        return ""

    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(trace.__globals__, "run", run)
        yield


@pytest.fixture
def guarded(tmp_path_factory: pytest.TempPathFactory, tmp_path: Path) -> Callable[[HardwareNumber], Path]:
    """A copy of exported hardware with its compiled simulation."""
    need("FPGA")

    def copied(number: HardwareNumber) -> Path:
        def fill(folder: Path) -> None:
            fpga(SHORT.replace(GUARDED), folder, number, unbounded=True)
            make(folder, "build/controller")

        return shutil.copytree(shared(tmp_path_factory, f"guarded_{number}", fill), tmp_path / "fpga")

    return copied


def faulty_motion(scenario: fg.Scenario) -> np.ndarray:
    """A recorded one in float, with samples of every kind that is refused."""
    run = fg.simulate(scenario)
    motion = np.hstack([run["position"].values, run["velocity"].values]).astype(np.float32)
    motion[0] = np.nan
    motion[80, 0] += 1e3
    motion[90, 3] = 1e30
    motion[91:95] = np.inf
    motion[160, 2] += 0.5
    motion[200:230] = motion[200]
    motion[300:350, :2] *= -1
    return motion


@cache
def traced(name: str, number: HardwareNumber = "float") -> Graph:
    return trace(SHORT.replace(SCENARIOS[name]), number)


def of_the_core(scenario: fg.Scenario, number: HardwareNumber, motion: np.ndarray, folder: Path) -> np.ndarray:
    """Status, force and report of each step, from a new folder, as int32 or int64."""
    folder.mkdir()
    if number == "fixed":
        return ARITHMETICS["fixed"].words(on_the_desk(scenario, motion, folder))
    return answers(scenario, motion, folder).view(np.int32)


@pytest.mark.parametrize(
    ("name", "number"),
    nightly_unless(
        lambda name, number: (name, number) == ("the paper's", "float"),
        [*((name, "float") for name in SCENARIOS), ("samples checked, forces limited", "fixed")],
    ),
)
def test_the_graph_computes_what_the_core_computes(name: str, number: HardwareNumber, tmp_path: Path) -> None:
    scenario = SHORT.replace(SCENARIOS[name])
    motion = faulty_motion(scenario)
    graph = traced(name, number)
    interpreter, rows = Interpreter(graph), []
    for sample in motion:
        force, reported = interpreter.step(sample)
        rows.append([graph.arithmetic.values(np.array([interpreter.status]))[0], *force, *reported])
    expected = of_the_core(scenario, number, motion, tmp_path / "core")
    assert len(interpreter.programs) >= 4  # nothing yet, the start, and those of other samples
    found = np.array(rows, graph.arithmetic.rows)
    assert {2.0} <= set(graph.arithmetic.numbers(found)[:, 0])
    np.testing.assert_array_equal(found.view(expected.dtype), expected)


def test_numbers_with_a_fixed_point_end_at_the_ends_and_take_the_nearest() -> None:
    fixed = ARITHMETICS["fixed"]
    assert fixed.values(np.array([1.0, -0.5, 1e300, -np.inf, np.nan, 2.0**-29, -(2.0**-29), 2.0**-30])) == [
        1 << 28,
        -(1 << 27),
        2**47 - 1,
        1 - 2**47,
        2**47 - 1,
        1,
        -1,
        0,
    ]
    numbers = np.array([524287.5, -0.75, 0.0])
    np.testing.assert_array_equal(fixed.numbers(fixed.words(numbers)), numbers)


def test_the_core_with_a_fixed_point_has_its_published_hash() -> None:
    motion, _ = parity.parity_run()
    assert parity_hash(parity.SCENARIO, targets.expected("fpga", parity.SCENARIO, "fixed", motion)) == IN_FIXED
    log = (ROOT / "benchmarks/results/parity.md").read_text(encoding="utf-8")
    assert f"## fixed: `{IN_FIXED}`" in log


@pytest.mark.nightly
def test_a_power_is_refused_in_one_sentence_where_the_point_is_fixed() -> None:
    with pytest.raises(
        ValueError,
        match=r"^controller\.terminal_exponent is 0\.6: it cannot be exported as hardware: powers other than",
    ) as report:
        traced("another power", "fixed")
    assert "\n" not in str(report.value)
    with pytest.raises(ValueError, match=r"^controller\.kind is 'nonsingular_terminal': .* powers other than"):
        trace(SHORT.replace({"controller.kind": "nonsingular_terminal"}), "fixed")
    with pytest.raises(ValueError, match=r"^controller\.kind is 'prescribed': .* exponentials and logarithms"):
        trace(SHORT.replace({"controller.kind": "prescribed"}), "fixed")


def test_a_steady_step_has_no_operation_twice_and_none_that_nobody_needs() -> None:
    graph = traced("the paper's")
    assert len(set(graph.nodes)) == len(graph.nodes)
    needed = {operand.node for program in graph.programs for operand in program}
    needed |= {predicate.of for predicate in graph.predicates if predicate.question == 0}
    found = {node for one in needed for node in members(graph.needs[one])}
    starts = {word.initial for word in graph.words if word.varies and not word.bits}
    for place, node in enumerate(graph.nodes):
        assert place in found or (node.op == "constant" and node.bits in starts)


@pytest.mark.nightly
def test_a_controller_whose_integers_decide_is_refused_in_one_sentence() -> None:
    with pytest.raises(
        ValueError, match=r"^controller\.kind is 'lqg': it cannot be exported as hardware: counters"
    ) as report:
        trace(SHORT.replace({"controller.kind": "lqg"}))
    assert "\n" not in str(report.value)


def test_the_joint_filter_is_refused_before_anything_is_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(trace.__globals__, "compiled_for", lambda *words: pytest.fail("it was compiled"))
    with pytest.raises(ValueError, match=r"^adaptation\.kind is 'joint': it cannot be exported as hardware: counters"):
        trace(SHORT.replace({"adaptation.kind": "joint"}))
    with pytest.raises(
        ValueError, match=r"^controller\.kind is 'lock_in': it cannot be exported as hardware: counters"
    ):
        trace(SHORT.replace({"controller.kind": "lock_in"}))


def test_an_observer_around_the_controller_is_refused_by_name() -> None:
    with pytest.raises(
        ValueError, match=r"^controller\.compensation_bandwidth is 40\.0: it must be 0\.0 for this target"
    ):
        trace(SHORT.replace({"controller.kind": "pid", "controller.compensation_bandwidth": 40.0}))


def test_every_unit_computes_the_bits_of_this_processor(tmp_path: Path) -> None:
    output = compared_units("units.v", "bench.v", "units.cpp", tmp_path)
    rows = re.findall(r"^(.*): (\d+) vectors, (\d+) differ, (\d+) subnormal$", output, re.MULTILINE)
    assert [name for name, *_ in rows] == [
        "add",
        "multiply",
        "divide",
        "square root",
        "exponent",
        "choose",
        "less",
        "from integer",
    ]
    for name, vectors, differences, subnormal in rows:
        assert int(vectors) > (25_000 if name in ("divide", "square root") else 140_000)
        assert int(differences) == 0
        assert int(subnormal) > 1000 or name in ("square root", "exponent", "less", "from integer")


def compared_units(units: str, bench: str, program: str, folder: Path) -> str:
    """Output of a program of this folder."""
    need("FPGA")
    sources = [VERILOG / units, VERILOG / "digits.v", HERE / bench, HERE / program]
    flags = f"-std=c++20 -O1 -I{CPP} -I{SOURCES / 'include'}"
    options = ["-O3", "-CFLAGS", flags, *QUICK, "--top-module", "bench", "-Mdir", str(folder)]
    run_command(["verilator", "--cc", "--exe", "--build", *options, *map(str, sources), "-o", "units"])
    return run_command([str(folder / "units"), "600000", "1"])


def test_every_unit_with_a_fixed_point_computes_the_bits_of_the_core(tmp_path: Path) -> None:
    output = compared_units("fixed_units.v", "fixed_bench.v", "fixed_units.cpp", tmp_path)
    rows = re.findall(r"^(.*): (\d+) vectors, (\d+) differ, (\d+) at an end$", output, re.MULTILINE)
    assert [name for name, *_ in rows] == [
        "add",
        "multiply",
        "divide",
        "square root",
        "choose",
        "less",
        "from integer",
    ]
    for name, vectors, differences, ends in rows:
        assert int(vectors) > (25_000 if name in ("divide", "square root") else 290_000)
        assert int(differences) == 0
        assert int(ends) > 1000 or name in ("square root", "less")


# Half a minute each: the same controller in fixed point answers over SPI below, and the units of floats have a test.
@pytest.mark.nightly
@pytest.mark.parametrize("number", ["float", "fixed"])
def test_exported_hardware_answers_a_run_with_faults_with_the_bits_of_the_core(
    number: HardwareNumber, guarded: Callable[[HardwareNumber], Path], tmp_path: Path
) -> None:
    scenario, folder, arithmetic = SHORT.replace(GUARDED), guarded(number), ARITHMETICS[number]
    motion = faulty_motion(scenario)
    expected = of_the_core(scenario, number, motion, tmp_path / "core")
    arithmetic.words(motion).tofile(folder / "motion")
    printed = make(folder, "sim")
    found = np.fromfile(folder / "answer", arithmetic.rows).reshape(len(motion), -1)
    assert set(arithmetic.numbers(found)[:, 0]) >= {0.0, 1.0, 2.0, 6.0, 7.0}
    np.testing.assert_array_equal(found.view(expected.dtype), expected)
    cycles = re.findall(r"from start to (\w+): (\d+) to (\d+) cycles", printed)
    assert [what for what, *_ in cycles] == ["force", "ready"]


@pytest.mark.parametrize("number", nightly_unless(lambda number: number == "fixed", ["float", "fixed"]))
def test_over_spi_it_answers_the_same_and_goes_on_from_a_state_that_was_saved(
    number: HardwareNumber, tmp_path: Path
) -> None:
    need("FPGA")
    scenario, folder = SHORT.replace({"controller.kind": "pid", **GUARDED}), tmp_path / "fpga"
    arithmetic = ARITHMETICS[number]
    motion = faulty_motion(scenario)[:110]
    expected = of_the_core(scenario, number, motion, tmp_path / "core")
    fpga(scenario, folder, number, unbounded=True)
    sources = ["units.v", "digits.v", "controller.v", "spi.v", str(HERE / "spi.cpp")]
    options = ["-O3", "-CFLAGS", f"-std=c++20 -O1 -I{folder}", *QUICK, "--top-module", "fracgyro_spi"]
    options += ["-Mdir", "build"]
    run_command(["verilator", "--cc", "--exe", "--build", *options, "-Wno-fatal", *sources, "-o", "spi"], folder)
    arithmetic.words(motion).tofile(folder / "motion")
    saved_after = 92  # while samples are refused
    assert run_command(["build/spi", str(saved_after)], folder) == ""
    found = np.fromfile(folder / "answer", arithmetic.rows).reshape(len(motion), -1)
    assert set(arithmetic.numbers(found)[:, 0]) >= {0.0, 2.0}
    np.testing.assert_array_equal(found.view(expected.dtype), expected)


@pytest.mark.nightly
@pytest.mark.parametrize(("kind", "seeds"), [("force_rebalance", (1, 3, 39)), ("pid", (14, 19, 56))])
def test_the_ports_take_words_as_soon_as_they_are_ready_and_registers_may_begin_at_random(
    kind: str, seeds: tuple[int, ...], tmp_path: Path
) -> None:
    need("FPGA")
    scenario, folder = SHORT.replace({"controller.kind": kind, **GUARDED}), tmp_path / "fpga"
    motion = faulty_motion(scenario)
    expected = of_the_core(scenario, "float", motion, tmp_path / "core")
    fpga(scenario, folder, unbounded=True)
    sources = ["units.v", "digits.v", "controller.v", str(HERE / "ports.cpp")]
    options = ["-CFLAGS", f"-std=c++20 -O1 -I{folder}", "--x-initial", "unique", "--x-assign", "unique"]
    names = ["--top-module", "fracgyro_controller", "-Mdir", "build", "-o", "ports"]
    run_command(["verilator", "--cc", "--exe", "--build", *options, *names, "-Wno-fatal", *sources], folder)
    motion.tofile(folder / "motion")
    for seed in seeds:  # with which each register that begins at 0 has to
        assert run_command(["build/ports", f"+verilator+seed+{seed}"], folder) == ""
        found = np.fromfile(folder / "answer", np.int32).reshape(len(motion), -1)
        np.testing.assert_array_equal(found, expected)


@pytest.mark.nightly
def test_a_motion_that_is_cut_short_is_refused(guarded: Callable[[HardwareNumber], Path]) -> None:
    folder = guarded("float")
    (folder / "motion").write_bytes(b"123")
    with pytest.raises(ValueError, match="the file motion has 3 bytes: a sample has 16"):
        make(folder, "sim")


def test_the_same_scenario_gives_the_same_bytes_from_the_command_and_from_python(tmp_path: Path) -> None:
    scenario = SHORT.replace({"controller.kind": "pid"})
    fpga(scenario, tmp_path / "one")
    (tmp_path / "own.toml").write_text(scenario.to_toml(), encoding="utf-8")
    said = CliRunner().invoke(cli, ["export", "fpga", str(tmp_path / "own.toml"), "--out", str(tmp_path / "two")])
    assert (said.exit_code, said.output) == (0, f"{tmp_path / 'two'}: add it to your design; see its README.md\n")
    files = sorted(path.name for path in (tmp_path / "one").iterdir())
    assert "controller.v" in files
    for file in files:
        assert (tmp_path / "one" / file).read_bytes() == (tmp_path / "two" / file).read_bytes()


@pytest.fixture(scope="module")
def small() -> Microcode:
    return compiled(traced("PID"))


def test_what_cannot_be_written_is_refused_in_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    (tmp_path / "there" / "file").touch()
    with pytest.raises(ValueError, match=r"there cannot be written: .*empty") as report:
        fpga(SHORT.replace({"controller.kind": "pid"}), tmp_path / "there")
    assert "\n" not in str(report.value)
    with pytest.raises(ValueError, match=r"^controller\.switching_limit is inf"):
        fpga(SHORT, tmp_path / "unbounded")
    assert not (tmp_path / "unbounded").exists()


def test_microcode_that_reads_too_early_is_found(small: Microcode) -> None:
    check(small)
    word, name = next(
        (word, name) for word in small.words for name, source in word.items() if name.endswith("_source") and source % 2
    )
    with (
        changed(word, {name: word[name] ^ 2}),
        pytest.raises(ValueError, match=r"before it is there|does not write|writes nothing"),
    ):
        check(small)


@pytest.mark.parametrize("bank", ["mul0", "other"])
def test_microcode_that_overwrites_a_result_is_found(small: Microcode, bank: str) -> None:
    written = [word for word in small.words[: small.bases[1]] if word.get(f"{bank}_write")]
    first, second = next(pair for pair in pairwise(written) if pair[0][f"{bank}_place"] != pair[1][f"{bank}_place"])
    message = "before it is there|does not write|writes nothing"
    with changed(second, {f"{bank}_place": first[f"{bank}_place"]}), pytest.raises(ValueError, match=message):
        check(small)


def test_microcode_that_writes_a_word_of_the_state_twice_is_found(small: Microcode) -> None:
    first, second = [word for word in small.words[: small.bases[1]] if word.get("kept_write")][:2]
    with changed(second, {"kept_place": first["kept_place"]}), pytest.raises(ValueError, match=r"does not write|twice"):
        check(small)


def test_microcode_that_reads_from_the_wrong_half_is_found(small: Microcode) -> None:
    word, name = next(
        (word, name) for word in small.words for name, value in word.items() if name.endswith("_relative") and value
    )
    with changed(word, {name: 0}), pytest.raises(ValueError, match="from the wrong half"):
        check(small)


def test_microcode_that_changes_a_sign_is_found(small: Microcode) -> None:
    word = next(word for word in small.words if word.get("add0_b_negative") == 1)
    with changed(word, {"add0_b_negative": 0}), pytest.raises(ValueError, match=r"before it is there|does not write"):
        check(small)


@pytest.mark.nightly
def test_microcode_that_begins_a_quotient_before_the_last_one_has_ended_is_found() -> None:
    code = compiled(traced("the paper's"))
    words = code.words[: code.bases[1]]
    first = next(place for place, word in enumerate(words) if word.get("square_root0_load"))
    with changed(words[first + 1], {"square_root0_load": 1}), pytest.raises(ValueError, match="before it has ended"):
        check(code)


def test_microcode_that_leaves_a_decision_open_is_found(small: Microcode) -> None:
    word = next(word for word in small.words if word.get("flag_write"))
    with changed(word, {"flag_write": 0}), pytest.raises(ValueError, match="leaves a decision open"):
        check(small)


def test_microcode_that_lets_go_of_a_force_too_early_is_found(small: Microcode) -> None:
    first = next(place for place, word in enumerate(small.words) if word.get("settled"))
    with changed(small.words[first - 1], {"settled": 1}), pytest.raises(ValueError, match=r"open|too early"):
        check(small)


@contextmanager
def changed(word: dict[str, int], changes: dict[str, int]) -> Iterator[None]:
    before = dict(word)
    word |= changes
    try:
        yield
    finally:
        word.clear()
        word |= before


def test_a_constant_is_inside_what_the_hardware_makes_of_it() -> None:
    inside = ARITHMETICS["float"].encoded
    assert inside(0x3F800000) == 256 << 23
    assert inside(0x80000000) == 1 << 32
    assert inside(0x00000001) == 107 << 23
    assert inside(0x7F800000) == 511 << 23
    assert inside(0xFFC00000) == 511 << 23 | 1 << 22


@pytest.fixture
def recorded(tmp_path: Path) -> Path:
    write_run(fg.simulate(SHORT.replace({"controller.kind": "pid"})), tmp_path / "run.nc")
    return tmp_path / "run.nc"


@pytest.mark.nightly
def test_replay_on_the_simulated_hardware_has_the_parity_hash_of_float(recorded: Path) -> None:
    need("FPGA")
    found, expected = (fg.export.replay(recorded, target, "float") for target in ("fpga", "host"))
    assert found.difference is None
    assert (found.steps, found.hash) == (STEPS + 1, expected.hash)


def test_hardware_has_number_types_of_its_own(recorded: Path) -> None:
    with pytest.raises(ValueError, match=r"^number is double: it must be float or fixed for fpga$"):
        fg.export.replay(recorded, "fpga")
    with pytest.raises(
        ValueError, match=r"^number is fixed: it must be float or double for host; only fpga has fixed$"
    ):
        fg.export.replay(recorded, "host", "fixed")
