"""The class for MATLAB, in Octave: its files, its results, equal to Python's, and refused input."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import fracgyro as fg
import numpy as np
import pytest
from children import PATIENCE
from embedded import need
from fracgyro import _core
from fracgyro.export.compilers import Number, run
from fracgyro.export.host import flags
from fracgyro.export.replay import first_difference
from fracgyro.export.targets import OCTAVE, answer_columns, answers
from fracgyro.scenario import kinds
from fracgyro.scenario.to_core import core_setup

ROOT = Path(__file__).resolve().parents[2]
LIMITED = fg.Scenario.paper().replace(
    {"controller.switching_limit": 0.5, "controller.force_limit": 1e5, "adaptation.kind": "composite"}
)
POSITIONS = {"device.sensing": "position"}
PID = LIMITED.replace({"controller.kind": "pid"})


def octave(code: str, folder: Path) -> str:
    """Output of Octave."""
    need("Octave")
    ran = subprocess.run([*OCTAVE, code], cwd=folder, capture_output=True, text=True, timeout=PATIENCE)
    assert ran.returncode == 0, ran.stderr
    return ran.stdout


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of two packages, compiled: +limited and +pid, which has no sensor of velocity."""
    folder = tmp_path_factory.mktemp("two scenarios")  # with a space in its name
    fg.export.matlab(LIMITED, folder / "+limited")
    fg.export.matlab(PID.replace(POSITIONS), folder / "+pid", "float")
    octave("limited.build(); pid.build()", folder)
    return folder


# -- Files ---------------------------------------------------------------------------------------------------


def test_the_same_scenario_gives_the_same_bytes_and_the_firmware_of_it(tmp_path: Path) -> None:
    for name in "ab":
        fg.export.matlab(LIMITED, tmp_path / name, "float")
    fg.export.firmware(LIMITED, tmp_path / "firmware")
    a, b, firmware = (
        {p.relative_to(f): p.read_bytes() for p in f.rglob("*") if p.is_file()}
        for f in (tmp_path / "a", tmp_path / "b", tmp_path / "firmware")
    )
    assert a == b
    compiled = {path: data for path, data in a.items() if path.parts[0] == "firmware"}
    assert compiled == {
        Path("firmware") / path: data
        for path, data in firmware.items()
        if path.suffix in {".hpp", ".h"} or path.name == "fracgyro.cpp"
        if path.parts[0] != "cortex_m"
    }
    assert " ".join(flags(tmp_path / "firmware", "BITS")) in a[Path("build.m")].decode()


def test_what_would_not_stay_bounded_is_refused_and_nothing_is_written(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="switching_limit"):
        fg.export.matlab(fg.Scenario.paper(), tmp_path / "out")
    assert not list(tmp_path.iterdir())
    fg.export.matlab(fg.Scenario.paper(), tmp_path / "out", unbounded=True)
    with pytest.raises(ValueError, match=r"out cannot be written: it already exists; name an empty or a new folder$"):
        fg.export.matlab(LIMITED, tmp_path / "out")


# -- Results -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("scenario", "number"), [(PID, "double"), (fg.Scenario.shipped("dual_mass"), "float")], ids=["pid", "dual"]
)
def test_replay_has_the_bits_of_python(scenario: fg.Scenario, number: Number) -> None:
    need("Octave")
    ideal = scenario.replace({"run.duration": 1000 * scenario.run.step, "run.units": "nondimensional"})
    run = fg.simulate(ideal.replace({"run.record_every": 1}))
    motion = np.hstack([run["position"].values, run["velocity"].values])
    expected = answers("python", ideal, number, motion)
    difference = first_difference(answers("octave", ideal, number, motion), expected, answer_columns(ideal))
    assert difference is None
    assert len(expected) == 1001


def test_it_says_what_the_scenario_is(built: Path) -> None:
    said = octave(
        "c = limited.Fracgyro(); p = pid.Fracgyro();"
        "printf('%s %s %d %d\\n', c.number, p.number, c.velocity_sensed, p.velocity_sensed);"
        "printf('%.17g\\n', c.units.step, c.units.length, c.units.velocity, c.units.force, c.units.damping,"
        "       c.units.stiffness, c.units.rate, [c.gyroscope.A c.gyroscope.B]', c.gyroscope.initial);"
        "printf('%s\\n', c.statuses{:}); printf('%s\\n', fieldnames(c.estimates()){:});"
        "printf('%d\\n', numel(fieldnames(p.estimates())))",
        built,
    ).splitlines()
    scales, numbers = LIMITED.plant.scales, list(map(float, said[1:36]))
    assert said[0] == "double single 1 0"
    seconds = LIMITED.run.step * scales.time
    units = [scales.length, scales.velocity, scales.force, scales.damping, scales.stiffness, scales.rate]
    assert numbers[:7] == [seconds, *units]
    assert numbers[7:31] == [float(entry) for row in _core.plant_map(core_setup(LIMITED)) for entry in row]
    assert numbers[31:] == [0.5, 0.5, 0.0, 0.0]
    assert said[36:44] == [
        "ok",
        "saturated",
        "not_finite",
        "out_of_range",
        "restarted",
        "refused",
        "implausible",
        "lost",
    ]
    named = {status.value: status.name for status in _core.Status}
    assert all(said[36 + value] == name for value, name in named.items())
    assert said[44:-1] == [channel.name for channel in kinds.persistent_channels(core_setup(LIMITED))]
    assert said[-1] == "0"


def test_controllers_are_apart_and_a_restored_one_goes_on_bit_for_bit(built: Path) -> None:
    said = octave(
        "a = limited.Fracgyro(); b = limited.Fracgyro(); p = pid.Fracgyro();"
        "first = a.step([.5 .5], [0 0]); for k = 1:9, a.step([.5; .5], single([0 0])); end;"
        "saved = a.save(); rate = a.estimates().rate_estimate; on = a.step([.4 .4], [0 0]);"
        "printf('%d\\n', isequal(b.step([.5 .5], [0 0]), first), isequal(size(first), [2 1]));"
        "b.restore(saved);"
        "printf('%d\\n', b.estimates().rate_estimate == rate, isequal(b.step([.4 .4], [0 0]), on));"
        "a.reset(); printf('%d\\n', isequal(a.step([.5 .5], [0 0]), first));"
        "clear b; printf('%d\\n', ~isequal(a.step([.5 .5], [0 0]), first), any(p.step([.5 .5]) ~= first));"
        "printf('%d\\n', isequal(class(saved), 'uint8'))",
        built,
    )
    assert said.split() == ["1"] * 8


def test_a_bad_sample_is_a_status_and_the_force_stays_finite(built: Path) -> None:
    said = octave(
        "c = limited.Fracgyro(); good = {[.5 .5], [0 0]};"
        "for bad = {[NaN 0], [Inf 0], [1e30 0], [.5 .5]},"
        "  [u, status] = c.step(bad{1}, [0 0]); printf('%s %d\\n', status, all(abs(u) <= 1e5));"
        "end",
        built,
    )
    assert said.splitlines() == ["not_finite 1", "not_finite 1", "out_of_range 1", "ok 1"]


# -- Refused input -------------------------------------------------------------------------------------------

TWO = "it must be two real numbers [x y], double or single"
GONE = "the controller was deleted, or cleared with fracgyro_mex: make a new one"
BYTES = r"it must be the \d+ bytes (uint8) that save returned"


@pytest.mark.parametrize(
    ("code", "identifier", "sentence"),
    [
        ("c.step([1 2 3], [0 0])", "argument", f"position is 1x3 double: {TWO}"),
        ("c.step([1 2], zeros(2, 2, 2))", "argument", f"velocity is 2x2x2 double: {TWO}"),
        ("c.step([], [0 0])", "argument", f"position is 0x0 double: {TWO}"),
        ("c.step([1 2i], [0 0])", "argument", f"position is 1x2 complex double: {TWO}"),
        ("c.step(sparse([1 2]), [0 0])", "argument", f"position is 1x2 sparse double: {TWO}"),
        ("c.step(int32([1 2]), [0 0])", "argument", f"position is 1x2 int32: {TWO}"),
        ("c.step('ab', [0 0])", "argument", f"position is 1x2 char: {TWO}"),
        ("c.step([1 2])", "argument", "an argument is missing: call step(position, velocity)"),
        ("p.step()", "argument", "an argument is missing: call step(position, velocity)"),
        ("c.restore(uint8(1:5))", "argument", f"saved is 1x5 uint8: {BYTES}"),
        ("c.restore(double(c.save()))", "argument", f"saved is \\d+x1 double: {BYTES}"),
        ("s = c.save(); s(99) = bitxor(s(99), 1); c.restore(s)", "refused", "damaged"),
        ("s = c.save(); s(1) = bitxor(s(1), 1); c.restore(s)", "refused", "saved by another controller"),
        ("delete(c); c.step([1 2], [0 0])", "cleared", GONE),
        ("delete(c); delete(c); c.save()", "cleared", GONE),
        ("limited.fracgyro_mex('new', 1)", "argument", "fracgyro_mex is called by Fracgyro only: use c = Fracgyro()"),
        ("limited.fracgyro_mex(1)", "argument", "fracgyro_mex is called by Fracgyro only: use c = Fracgyro()"),
        ("limited.fracgyro_mex('save', uint64(1))", "cleared", GONE),
        ("limited.fracgyro_mex('delete', uint64([])); c.save(); limited.fracgyro_mex('save', 1)", "cleared", GONE),
    ],
)
def test_what_is_wrong_is_one_sentence_with_an_identifier(
    built: Path, code: str, identifier: str, sentence: str
) -> None:
    said = octave(
        f"c = limited.Fracgyro(); p = pid.Fracgyro(); try, {code}; catch e, disp(e.identifier), disp(e.message), end",
        built,
    )
    found, message = said.splitlines()
    assert found == f"fracgyro:{identifier}"
    assert re.search(re.escape(sentence).replace(r"\\d\+", r"\d+"), message), message


def test_a_class_that_is_not_compiled_says_what_to_do(tmp_path: Path) -> None:
    fg.export.matlab(LIMITED, tmp_path / "out")
    said = octave("try, Fracgyro(); catch e, disp(e.identifier), disp(e.message), end", tmp_path / "out")
    assert said == f"fracgyro:unbuilt\nfracgyro_mex is not compiled: run build in {tmp_path / 'out'}\n"


def test_a_compiler_that_fails_is_quoted(tmp_path: Path) -> None:
    fg.export.matlab(LIMITED, tmp_path / "out")
    (tmp_path / "out/firmware/fracgyro_coefficients.h").write_text("#error none\n", encoding="utf-8")
    said = octave("try, build(); catch e, disp(e.identifier), disp(e.message), end", tmp_path / "out")
    assert said == "fracgyro:build\nmkoctfile failed: what the compiler said stands above\n"
    with pytest.raises(ValueError, match=r"^octave-cli failed: .*#error none"):
        run([*OCTAVE, "build()"], tmp_path / "out")


# -- Documents -----------------------------------------------------------------------------------------------


def blocks(text: str) -> list[tuple[str, str]]:
    return re.findall(r"^```(matlab|python|sh|text)\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)


@pytest.mark.nightly
def test_the_guide_prints_what_it_says(tmp_path: Path) -> None:
    need("Octave")
    printed = ""
    page = (ROOT / "docs/matlab.md").read_text(encoding="utf-8").partition("## Python from MATLAB")[0]
    programs = {"sh": ["bash", "-e", "-c"], "python": [sys.executable, "-c"], "matlab": OCTAVE}
    environment = {"PATH": f"{Path(sys.executable).parent}:/usr/local/bin:/usr/bin:/bin", "HOME": str(tmp_path)}
    languages = []
    for language, content in blocks(page):
        languages.append(language)
        if language == "text":
            assert printed == content
            continue
        ran = subprocess.run(
            [*programs[language], content],
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
            timeout=PATIENCE,
        )
        assert ran.returncode == 0, ran.stderr
        printed = ran.stdout
    assert languages == ["sh", "matlab", "text", "sh", "python", "matlab", "text"]


def test_python_has_the_names_that_the_guide_uses_from_matlab() -> None:
    ((_, code),) = blocks((ROOT / "docs/matlab.md").read_text(encoding="utf-8").partition("## Python from MATLAB")[2])
    names = re.findall(r"\bpy\.fracgyro\.([\w.]+)", code)
    assert names == ["Scenario.load", "simulate", "metrics.rmse"]
    for name in names:
        found = fg
        for part in name.split("."):
            found = getattr(found, part)
    run = fg.simulate(fg.Scenario.paper().replace({"run.duration": 1.0}))
    assert set(re.findall(r'run\{"(\w+)"\}', code)) <= set(run.variables)


@pytest.mark.nightly
def test_the_readme_of_the_folder_runs(tmp_path: Path) -> None:
    fg.export.matlab(LIMITED, tmp_path / "out")
    readme = (tmp_path / "out/README.md").read_text(encoding="utf-8")
    ((_, code),) = blocks(readme)
    said = octave(code + "fprintf('%s %.2f\\n', status, norm(m(1:2)))", tmp_path / "out")
    assert "rate_estimate = " in said
    assert re.search(r"^ok \d\.\d\d$", said, re.MULTILINE)
    for status in kinds_of_status():
        assert f"`{status}`" in readme


def kinds_of_status() -> list[str]:
    return [status.name for status in _core.Status]
