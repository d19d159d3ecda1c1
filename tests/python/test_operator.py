"""A fractional operator as C99: the same bits as Python on every processor, and nothing that firmware lacks."""

from __future__ import annotations

import ctypes
import re
from pathlib import Path
from typing import Any, cast

import fracgyro as fg
import numpy as np
import pytest
from click.testing import CliRunner
from embedded import need
from fracgyro.cli import cli
from fracgyro.export.compilers import Number, run
from fracgyro.export.targets import DTYPES
from fracgyro.fractional import Sampled, design, pid
from numpy.typing import NDArray
from operator_c import STRICT_C99, built

KERNEL = design(0.9, shortest=1e-3, longest=10.0, tolerance=1e-6)
OPERATORS = {
    "derivative": KERNEL.sampled(1e-3, derivative=True),
    "integral": KERNEL.sampled(1e-3),
    "pid": pid(3.0, -5.0, 0.4, 0.7, 0.6, step=1e-2, longest=10.0),
    "plain_pid": pid(3.0, 5.0, 1.0, 0.7, 1.0, step=1e-2, longest=10.0),
    "parabolas": pid(3.0, 5.0, 0.4, 0.7, 0.6, step=1e-2, longest=10.0, between="parabolas"),
    "gain": pid(3.0, 0.0, 1.0, 0.0, 1.0, step=1e-2, longest=10.0),
}
operators = pytest.mark.parametrize("name", OPERATORS)
numbers = pytest.mark.parametrize("number", ["float", "double"])


def signal(number: Number) -> NDArray[Any]:
    """Noise of all sizes, then zeros until its memory vanishes."""
    rng = np.random.default_rng(5)
    loud = rng.normal(size=600) * 10.0 ** rng.uniform(-6, 3, 600)
    return np.append(loud, np.zeros(20_000)).astype(DTYPES[number])


def answered(command: list[str], samples: NDArray[Any], folder: Path) -> NDArray[Any]:
    samples.tofile(folder / "samples")
    run(command, folder)
    return np.fromfile(folder / "answer", samples.dtype)


@operators
@numbers
@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_the_c_code_has_the_bits_of_python(
    name: str, number: Number, compiler: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    need(compiler)
    monkeypatch.setenv("CC", compiler)
    samples, folder = signal(number), tmp_path / "c"
    found = answered(built(OPERATORS[name], number, folder, "host", "answer"), samples, folder)
    expected = OPERATORS[name].run(samples)
    assert expected.dtype == samples.dtype
    assert found.tobytes() == expected.tobytes()
    assert np.ptp(expected[:600]) > 0.0


@numbers
@pytest.mark.parametrize("target", ["m4f", "m7"])
@pytest.mark.parametrize("name", ["derivative", "pid"])
def test_a_cortex_m_has_the_bits_of_python(name: str, target: str, number: Number, tmp_path: Path) -> None:
    need("Cortex-M")
    samples, folder = signal(number)[:2000], tmp_path / "c"
    found = answered(built(OPERATORS[name], number, folder, target, "answer"), samples, folder)
    assert found.tobytes() == OPERATORS[name].run(samples).tobytes()


@operators
def test_the_c_code_needs_nothing_but_memset(name: str, tmp_path: Path) -> None:
    need("gcc")
    fg.export.operator(OPERATORS[name], tmp_path / "c")
    run(["gcc", *STRICT_C99, "-O3", "-c", "operator.c"], tmp_path / "c")
    undefined = re.findall(r" U (\w+)", run(["nm", "operator.o"], tmp_path / "c"))
    assert set(undefined) <= {"memset"}  # which every compiler may call, with or without a library


def test_two_operators_in_one_program_do_not_meet_and_reset_forgets(tmp_path: Path) -> None:
    need("gcc")
    names = ["derivative", "integral"]
    for name in names:
        fg.export.operator(OPERATORS[name], tmp_path / name, "double", name=name)
    sources = [str(tmp_path / name / f"{name}.c") for name in names]
    run(["gcc", *STRICT_C99, "-O2", "-shared", "-fPIC", *sources, "-o", "both.so"], tmp_path)
    library, samples = ctypes.CDLL(str(tmp_path / "both.so")), signal("double")[:50]
    for name in names:
        step, state = library[f"{name}_step"], (ctypes.c_double * (OPERATORS[name].count + 2))(*[7.0] * 9)
        step.restype, step.argtypes = ctypes.c_double, [ctypes.c_void_p, ctypes.c_double]
        for _ in range(2):
            library[f"{name}_reset"](state)
            assert [step(state, sample) for sample in samples] == OPERATORS[name].run(samples).tolist()


@operators
def test_a_run_is_the_steps_and_keeps_none(name: str) -> None:
    sampled, samples = OPERATORS[name], signal("double")[:300]
    sampled.reset()
    found = sampled.run(samples)
    assert [sampled.step(sample) for sample in samples[:150]] == found[:150].tolist()
    channels = sampled.run(np.stack([samples, -2.0 * samples], axis=1))
    assert channels[:, 0].tolist() == found.tolist()
    assert channels[:, 1] == pytest.approx(-2.0 * found)
    assert [sampled.step(sample) for sample in samples[150:]] == found[150:].tolist()


def test_an_empty_signal_has_an_empty_output() -> None:
    assert OPERATORS["pid"].run([]).shape == (0,)
    assert OPERATORS["pid"].run(np.zeros((0, 3))).shape == (0, 3)


def test_what_is_no_operator_is_refused_in_one_sentence(tmp_path: Path) -> None:
    sampled: Any = OPERATORS["pid"]
    for call, message in (
        (lambda: sampled.step("a"), "sample is 'a': it must be a number"),
        (lambda: sampled.step([1.0, 2.0]), r"sample is \[1.0, 2.0\]: it must be a number"),
        (lambda: sampled.plus(3), "other is 3: it must be Sampled"),
        (lambda: sampled.times("a"), "gain is 'a': it must be a number"),
        (lambda: design(cast(Any, [0.9]), 1e-3, 1.0, 1e-6), r"order is \[0.9\]: it must be a number"),
        (lambda: KERNEL.sampled(cast(Any, "a")), "step is 'a': it must be a number"),
        (lambda: KERNEL.frequency_error(cast(Any, None), 1.0), "lowest is None: it must be a number"),
        (lambda: pid(cast(Any, "a"), 1, 1, 1, 1, step=1, longest=2), "kp is 'a': it must be a number"),
        (lambda: fg.export.operator(cast(Any, "x"), tmp_path / "x"), "sampled is 'x': it must be Sampled, for example"),
    ):
        with pytest.raises(TypeError, match=f"^{message}"):
            call()
    with pytest.raises(ValueError, match=r"^name is 3: it must be a letter"):
        fg.export.operator(sampled, tmp_path / "x", name=cast(Any, 3))
    with pytest.raises(ValueError, match=r"^other has interval 0.001: it must be 0.01$"):
        sampled.plus(OPERATORS["derivative"])


@pytest.mark.parametrize("samples", [np.zeros((2, 2, 2)), 1.0])
def test_samples_of_another_shape_are_refused(samples: Any) -> None:
    with pytest.raises(ValueError, match=r"^samples has shape .*: it must be \(samples,\) or \(samples, channels\)$"):
        OPERATORS["pid"].run(samples)


@pytest.mark.parametrize(("derivative", "allowed"), [(True, 3.0), (False, 30.0)])
def test_single_precision_loses_little_over_80_000_samples(derivative: bool, allowed: float) -> None:
    """In roundings of the largest output: slow exponentials neither drift nor stall."""
    sampled = design(0.9, shortest=1e-3, longest=80.0, tolerance=1e-6).sampled(1e-3, derivative=derivative)
    samples = (1.0 + np.sin(1e-3 * np.arange(80_000))).astype(np.float32)
    exact = sampled.run(samples.astype(np.float64))
    rounding = abs(exact).max() * 2.0**-24
    assert abs(sampled.run(samples) - exact).max() < allowed * rounding


def test_the_same_operator_gives_the_same_bytes_and_says_what_it_is(tmp_path: Path) -> None:
    words = ["export", "operator", "--order", "0.9", "--longest", "10", "--name", "rate"]
    for folder in "ab":
        ran = CliRunner().invoke(cli, [*words, "--out", str(tmp_path / folder)])
        assert ran.exit_code == 0, ran.output
    assert ran.output.endswith(f"rate.c: {KERNEL.count} exponentials, float, one sample every 0.001\n")
    files = [{p.name: p.read_bytes() for p in (tmp_path / folder).iterdir()} for folder in "ab"]
    assert files[0] == files[1]
    assert sorted(files[0]) == ["rate.c", "rate.h"]
    header = files[0]["rate.h"].decode()
    assert header.startswith(
        "/* Derivative of order 0.9 of a signal that starts from 0, its kernels to 1e-06 up to times of 10, "
        "lines between samples.\n"
    )
    assert f"/* {4 * (KERNEL.count + 2)} bytes. */" in header
    fg.export.operator(OPERATORS["derivative"], tmp_path / "c", name="rate")
    assert (tmp_path / "c/rate.c").read_bytes() == files[0]["rate.c"]


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["--order", "-0.1"], design(0.9, 1e-3, 100.0, 1e-6).sampled(1e-3)),
        (["--order", "1"], pid(0.0, 0.0, 1.0, 1.0, 1.0, step=1e-3, longest=1.0)),
        (
            ["--order", "0.9", "--between", "parabolas"],
            design(0.9, 1e-3, 100.0, 1e-6).sampled(1e-3, derivative=True, between="parabolas"),
        ),
        (["--order", "-1"], pid(0.0, 1.0, 1.0, 0.0, 1.0, step=1e-3, longest=1.0)),
        (["--pid", "1", "2", "0.3", "4", "0.5"], pid(1.0, 2.0, 0.3, 4.0, 0.5, step=1e-3, longest=100.0)),
    ],
)
def test_the_command_line_names_what_is_exported(words: list[str], expected: Sampled, tmp_path: Path) -> None:
    ran = CliRunner().invoke(cli, ["export", "operator", *words, "--number", "double", "--out", str(tmp_path / "a")])
    assert ran.exit_code == 0, ran.output
    fg.export.operator(expected, tmp_path / "b", "double")
    assert (tmp_path / "a/operator.c").read_text() == (tmp_path / "b/operator.c").read_text()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "exactly one of --order and --pid must be given"),
        (["--order", "0.5", "--pid", "1", "1", "1", "1", "1"], "exactly one of --order and --pid must be given"),
        (["--order", "0"], "--order is 0: it must be above 0 and at most 1, or at least -1 and below 0"),
        (["--order", "nan"], "--order is nan: it must be above 0"),
        (["--order", "0.5", "--step", "-1"], "step must be positive and finite, got -1.0"),
        (["--order", "0.5", "--name", "2nd"], "name is '2nd': it must be a letter followed by at most 30 letters"),
        (["--order", "0.5", "--tolerance", "2"], "tolerance must lie in [1e-11, 0.1], got 2.0"),
        (["--order", "0.5", "--name", "Math"], "name is 'Math': it must not be the name of a standard C header"),
        (["--pid", "1e300", "1", "0.5", "1", "0.5"], "a weight of the operator is 1e+300: it must fit float"),
        (["--pid", "0", "1e-46", "0.5", "0", "1"], "it must fit float; scale the gains"),
        (["--pid", "1e308", "1e308", "0.5", "1e308", "0.5"], "a weight of the operator is not finite: the gains must"),
    ],
)
def test_what_cannot_be_exported_is_refused_in_one_sentence(words: list[str], message: str, tmp_path: Path) -> None:
    ran = CliRunner().invoke(cli, ["export", "operator", *words, "--out", str(tmp_path / "a")])
    assert ran.exit_code != 0
    assert message in ran.output + str(ran.exception)
    assert not (tmp_path / "a").exists()
