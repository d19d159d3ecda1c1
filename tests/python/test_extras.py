"""Lazy loading, and the message if an optional library is missing."""

from __future__ import annotations

import importlib
import json
import subprocess
import sys
from pathlib import Path
from types import ModuleType
from typing import Any, cast

import fracgyro as fg
import fracgyro_lab as lab
import numpy as np
import pint_xarray
import pytest
import xarray as xr
from pint import UnitRegistry
from scipy.io import loadmat

# Modules that only this extra installs.
MODULES = {
    "netcdf": ["h5netcdf", "h5py"],
    "report": ["jinja2", "matplotlib", "scipy"],
    "rate": ["jinja2", "matplotlib", "pyarrow", "scipy"],
    "identify": ["jinja2", "matplotlib", "pyarrow", "scipy"],
    "study": ["cmaes", "jinja2", "matplotlib", "optuna", "pyarrow", "scipy", "sqlalchemy"],
    "export": ["fmpy", "jinja2", "ziglang"],
    "cluster": ["dask", "distributed", "psycopg"],
    "pdf": ["pypdf"],
    "interop": ["control", "gymnasium", "pint", "pint_xarray", "scipy"],
}
ALL = sorted({module for modules in MODULES.values() for module in modules})


def without(modules: list[str], code: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run the code as if the modules were not installed."""
    lines = [f"import sys; sys.modules.update(dict.fromkeys({modules!r}))", code]
    return subprocess.run([sys.executable, "-c", "\n".join(lines)], cwd=folder, capture_output=True, text=True)


def command(words: str) -> str:
    return f"import sys; sys.argv = {['fracgyro', *words.split()]!r}\nfrom fracgyro.cli import main; main()"


def test_importing_the_package_loads_no_library_that_takes_long(tmp_path: Path) -> None:
    code = "import json, sys; import fracgyro; dir(fracgyro); print(json.dumps(sorted(sys.modules)))"
    loaded = json.loads(without([], code, tmp_path).stdout)
    assert "fracgyro.extras" in loaded
    slow = {"numpy", "pandas", "pydantic", "rich", "scipy", "xarray", *ALL}
    assert not slow & {name.partition(".")[0] for name in loaded}


@pytest.mark.parametrize("package", [fg, fg.export, fg.fractional, fg.rate, fg.study, lab])
def test_every_public_name_is_there_and_described(package: ModuleType) -> None:
    names = package.__all__
    assert names
    for name in names:
        assert getattr(package, name).__doc__, name


def test_a_function_is_not_hidden_by_its_module() -> None:
    for module in ("export.fmu", "rate.allan", "study.sweep.run"):
        importlib.import_module(f"fracgyro.{module}")
    assert all(map(callable, (fg.export.fmu, fg.rate.allan, fg.study.sweep)))


@pytest.mark.parametrize(
    ("missing", "words"),
    [
        ("netcdf", "simulate --set run.duration=1.0 --out run.nc"),
        ("netcdf", "replay run.nc --target host"),
        ("netcdf", "reproduce --quick --out out"),
        ("study", "simulate --set run.duration=1.0 --out run.parquet"),
        ("interop", "simulate --set run.duration=1.0 --out run.mat"),
        ("report", "simulate --set run.duration=1.0 --plot run.svg"),
        ("report", "simulate --set run.duration=1.0 --seeds 3"),
        ("report", "reproduce --quick --out out"),
        ("rate", "rate my.toml --out out"),
        ("rate", "allan record.csv"),
        ("identify", "identify record.csv"),
        ("study", "sweep study.toml --out out"),
        ("study", "tune study.toml --out out"),
        ("study", "compare track --quick --out out"),
        ("study", "enter linear --out entry.json"),
        ("export", "export fmu my.toml --out my.fmu --unbounded"),
        ("pdf", "zoo new 10.1000/mine --pdf paper.pdf --out mine.toml"),
        ("cluster", "sweep study.toml --out out --scheduler tcp://127.0.0.1:1"),
    ],
)
def test_a_command_without_its_extra_says_what_to_install_and_writes_nothing(
    missing: str, words: str, tmp_path: Path
) -> None:
    fg.Scenario.paper().replace({"controller.force_limit": 1e3}).save(tmp_path / "my.toml")
    (tmp_path / "study.toml").write_text("[vary]\ncontroller.order = [0.5, 0.9]\n", encoding="utf-8")
    before = sorted(tmp_path.iterdir())
    said = without(MODULES[missing], command(words), tmp_path)
    assert said.returncode == 2, said.stderr
    assert said.stdout == ""
    (line,) = said.stderr.splitlines()
    assert line.startswith("fracgyro: ")
    assert line.endswith(f": install the extra {missing}; in your clone, pip install '.[{missing}]'")
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize(
    "words",
    [
        "simulate --set run.duration=1.0",
        "scenario paper",
        "selfcheck",
        "export firmware my.toml --out f --unbounded",
        "export matlab my.toml --out m --unbounded",
    ],
)
def test_these_commands_need_no_extra(words: str, tmp_path: Path) -> None:
    fg.Scenario.paper().save(tmp_path / "my.toml")
    said = without(ALL, command(words), tmp_path)
    warned = "Warning: this is close to the limit" if words.startswith("export firmware") else ""
    assert (said.returncode, said.stderr.partition(":")[0]) == (0, warned.partition(":")[0])
    assert said.stderr.startswith(warned)
    assert said.stderr.count("\n") == (1 if warned else 0)


def test_in_python_too_a_missing_library_is_named_with_its_extra(tmp_path: Path) -> None:
    code = "import fracgyro as fg\ntry: fg.plot\nexcept ImportError as error: print(error)"
    said = without(["matplotlib"], code, tmp_path)
    assert (
        said.stdout == "matplotlib is not installed: install the extra report; in your clone, pip install '.[report]'\n"
    )


def test_a_run_knows_its_metrics_and_its_scenario(tmp_path: Path) -> None:
    scenario = fg.Scenario.paper().replace({"run.duration": 1.0})
    run = fg.simulate(scenario)
    assert run.fracgyro.scenario == scenario
    xr.testing.assert_identical(run.fracgyro.rmse(window=(0.5, None)), fg.metrics.rmse(run, window=(0.5, None)))
    assert {"chattering", "plot", "rmse", "scenario"} <= set(dir(run.fracgyro))
    with pytest.raises(AttributeError, match="rsme is not a metric: it must be one of chattering, "):
        _ = run.fracgyro.rsme
    neither = "the Dataset has neither an attribute nor a coordinate scenario: it is not a run of fracgyro"
    with pytest.raises(ValueError, match=neither):
        _ = xr.Dataset().fracgyro.scenario


def test_a_mat_file_has_every_number_of_a_run_with_its_unit(tmp_path: Path) -> None:
    scenario = fg.Scenario.paper().replace({"run.duration": 1.0, "run.units": "SI"})
    run = fg.simulate(scenario)
    run.fracgyro.to_mat(tmp_path / "run.mat")
    found = loadmat(tmp_path / "run.mat", squeeze_me=True)
    for name in ("time", *run):
        np.testing.assert_array_equal(found[name], run[name].values)
        if unit := run[name].attrs.get("units"):
            assert found["units"][name].item() == unit
    assert found["units"]["position"].item() == "m"
    assert fg.Scenario.from_toml(str(found["scenario"])) == scenario
    with pytest.raises(ValueError, match=r"run\.mat cannot be written: No such file or directory$"):
        run.fracgyro.to_mat(tmp_path / "none" / "run.mat")


def test_a_mat_file_without_scipy_says_what_to_install(tmp_path: Path) -> None:
    code = """
import fracgyro as fg
run = fg.simulate(fg.Scenario.paper().replace({"run.duration": 1.0}))
try: run.fracgyro.to_mat("run.mat")
except ImportError as error: print(error)
"""
    said = without(["scipy"], code, tmp_path)
    assert said.stdout == "scipy is not installed: install the extra interop; in your clone, pip install '.[interop]'\n"
    assert not list(tmp_path.iterdir())


def test_pint_reads_the_units_of_a_run() -> None:
    registry: UnitRegistry = pint_xarray.setup_registry(UnitRegistry(force_ndarray_like=True))
    for units in ("SI", "nondimensional"):
        run = fg.simulate(fg.Scenario.paper().replace({"run.duration": 1.0, "run.units": units}))
        with_units = run.pint.quantify(unit_registry=registry)
        for product, unit in (
            (with_units["control"] * with_units["velocity"], "W"),
            (with_units["damping_estimate"], "kg/s"),
            (with_units["rate_estimate"] * with_units["time"], "rad"),
        ):
            assert registry.Quantity(1, product.pint.units).to(unit if units == "SI" else "").magnitude == 1


def test_the_plot_of_a_run_shows_the_rate_where_it_is_estimated() -> None:
    from matplotlib.figure import Figure

    scenario = fg.Scenario.paper().replace({"run.duration": 1.0})
    for kind, panels in (("fractional_fast_terminal", 4), ("pid", 3)):
        run = fg.simulate(scenario.replace({"controller.kind": kind}))
        figure = Figure()
        assert fg.plot(run, figure) is figure
        assert len(figure.axes) == panels
        assert run.fracgyro.plot(Figure()).axes[0].get_ylabel() == "position\n(q0)"


def test_what_to_cite_names_the_paper_and_the_source_of_the_controller() -> None:
    paper = fg.Scenario.paper()
    assert fg.cite().count("@") == fg.cite(paper).count("@") == 2
    assert f"version = {{{fg.__version__}}}" in fg.cite()
    assert "10.1155/2020/8542961" in fg.cite()
    assert "@book{composite," in fg.cite(paper.replace({"adaptation.kind": "composite"}))
    assert "10.1109/JMEMS.2002.807468" in fg.cite(paper.replace({"controller.kind": "park_horowitz"}))
    with pytest.raises(TypeError, match="scenario is 'paper': it must be a Scenario"):
        fg.cite(cast(Any, "paper"))
