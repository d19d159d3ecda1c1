"""SVG pictures: letters are text, and a title and a description say what a picture shows."""

from __future__ import annotations

import base64
import html
import math
import re
from pathlib import Path
from urllib.parse import unquote
from xml.etree import ElementTree

import fracgyro as fg
import pytest
from figure_data import LINK, read
from fracgyro.analysis.html import csv_text, data_link, embedded
from fracgyro.analysis.plots import COLUMNS, write_plot
from fracgyro.analysis.style import own_style, svg
from matplotlib.figure import Figure

SVG = "{http://www.w3.org/2000/svg}"


def texts(picture: ElementTree.Element) -> list[str]:
    return ["".join(each.itertext()).strip() for each in picture.iter(f"{SVG}text")]


def test_the_letters_of_a_run_are_text_in_fonts_that_stand_in_for_one_another(tmp_path: Path) -> None:
    path = tmp_path / "run.svg"
    write_plot(fg.simulate(fg.Scenario.paper().replace({"run.duration": 1.0})), path)
    picture = ElementTree.parse(path).getroot()
    assert {"position", "|error|", "(q0)", "time (1/ω0)", "reference"} <= set(texts(picture))
    families = set(re.findall(r"font-family: ([^;\"]+)", path.read_text(encoding="utf-8")))
    assert families == {"'DejaVu Sans', 'Verdana', sans-serif"}
    assert picture.findtext(f"{SVG}title") == "A run"
    assert "|error| (q0): x, y" in str(picture.findtext(f"{SVG}desc"))


def test_a_compact_picture_has_every_point_and_joins_only_lines_that_look_the_same() -> None:
    with own_style():
        figure = Figure()
        panel = figure.add_axes((0, 0, 1, 1))
        panel.axis("off")
        panel.set(xlim=(0, 1), ylim=(0, 1))
        width, height = 72 * figure.get_size_inches()
        for x in (0.25, 0.5):
            panel.plot([x, x], [0, 1], color="black")
        for x in (0.25, 0.5):
            panel.plot([x, 0.75], [0, 1], color="red", alpha=0.5)
        picture = ElementTree.fromstring(svg(figure, "a"))
    drawn = {each.get("d", ""): each.get("style", "") for each in picture.iter(f"{SVG}path")}
    paths = [path for path in drawn if "stroke: " in drawn[path]]
    black, *red = ([float(each) for each in re.findall(r"[\d.]+", path)] for path in paths)
    assert black == pytest.approx(
        [0.25 * width, height, 0.25 * width, 0, 0.5 * width, height, 0.5 * width, 0], abs=0.05
    )
    assert red == [pytest.approx([x * width, height, 0.75 * width, 0.0], abs=0.05) for x in (0.25, 0.5)], (
        "where they cross, they are darker"
    )


def test_numbers_are_saved_as_they_are_whatever_is_in_their_names() -> None:
    names = ['a, "b" (%41)', "ω & <1> #2"]
    link = data_link(csv_text(names, [[1 / 3, math.nan], [1e-12, "x\ny"]]), "numbers")
    (found,) = LINK.findall(link)
    assert found[0] == "numbers"
    assert not re.search(r"[\s#<>]", found[1]), "an address ends there, or loses it"
    assert read(unquote(html.unescape(found[1]))) == [
        dict(zip(names, ["0.333333333", ""], strict=True)),
        dict(zip(names, ["1e-12", "x\ny"], strict=True)),
    ]


def test_a_picture_is_described_by_its_axes_and_curves_unless_it_says_itself() -> None:
    with own_style():
        figure = Figure()
        panel = figure.add_subplot()
        panel.plot([0, 1], [0, 1], label="R & D < 1")
        panel.set_xlabel("time")
        panel.set_ylabel("noise")
        described = ElementTree.fromstring(svg(figure, "a < b"))
        own = ElementTree.fromstring(svg(figure, "a", "said"))
        source = embedded(figure, "a")
    assert described.findtext(f"{SVG}title") == "a < b"
    assert described.findtext(f"{SVG}desc") == "noise over time: R & D < 1"
    assert own.findtext(f"{SVG}desc") == "said"
    again = base64.b64decode(re.sub("^data:.*base64,", "", source))
    assert ElementTree.fromstring(again).findtext(f"{SVG}title") == "a"


# -- The plot of runs ----------------------------------------------------------------------------------------

SI = fg.Scenario.paper().replace({"run.units": "SI", "run.duration": 20.0})


def test_a_curve_keeps_its_extremes_in_few_points() -> None:
    run = fg.simulate(fg.Scenario.paper())
    figure = fg.plot(run, Figure())
    position, error, control, rate = figure.axes
    for panel, name in ((position, "position"), (control, "control")):
        for line, values in zip(panel.lines, run[name].values.T, strict=False):
            assert len(line.get_xdata()) <= 2 * COLUMNS + 2
            assert (min(line.get_ydata()), max(line.get_ydata())) == (values.min(), values.max())
    assert max(error.lines[1].get_ydata()) == abs(run["error"].values[:, 1]).max()
    assert [panel.get_ylabel() for panel in figure.axes] == [
        "position\n(q0)",
        "|error|\n(q0)",
        "force\n(m ω0² q0)",
        "rate\n(ω0)",
    ]
    assert rate.get_xlabel() == "time (1/ω0)"


def test_an_error_of_zero_does_not_stretch_the_logarithmic_axis() -> None:
    at_rest = {"reference.kind": "step", "reference.start": 1.0, "reference.smoothing": 0.1}
    quiet = {"disturbance.kind": "none", "run.initial_position": (0.0, 0.0), "run.duration": 3.0}
    run = fg.simulate(fg.Scenario.paper().replace({**at_rest, **quiet}))
    sizes = abs(run["error"].values)
    assert (sizes == 0).any()
    panel = fg.plot(run, Figure(), channels=["error"]).axes[0]
    for line, largest in zip(panel.lines, sizes.max(axis=0), strict=True):
        assert min(line.get_ydata()) == pytest.approx(1e-12 * largest)
    fg.plot(run.assign(error=0.0 * run["error"]), Figure(), channels=["error"]).canvas.draw()


def test_a_fast_oscillation_is_drawn_as_a_band() -> None:
    run = fg.simulate(fg.Scenario.shipped("dual_mass").replace({"run.units": "SI", "run.duration": 4000.0}))
    panel = fg.plot(run, Figure(), channels=["position"]).axes[0]
    assert not panel.lines
    for area, values in zip(panel.collections, run["position"].values.T, strict=True):
        edges = area.get_paths()[0].vertices[:, 1] * 1e-6
        assert (edges.min(), edges.max()) == pytest.approx((values.min(), values.max()), rel=1e-12)


def test_units_on_the_axes_have_the_prefix_of_the_values() -> None:
    figure = fg.plot(fg.simulate(SI), Figure(), channels=["position", "control", "rate_estimate", "stiffness_estimate"])
    labels = [panel.get_ylabel() for panel in figure.axes]
    assert labels == ["position\n(µm)", "force\n(µN)", "rate\n(rad/s)", "stiffness estimate\n(N/m)"]
    assert figure.axes[-1].get_xlabel() == "time (ms)"
    assert max(figure.axes[0].lines[0].get_ydata()) == pytest.approx(1.0, abs=0.05)


def test_several_runs_share_panels_and_have_names(tmp_path: Path) -> None:
    runs = {"paper": fg.simulate(SI), "PID": fg.simulate(SI.replace({"controller.kind": "pid"}))}
    figure = fg.plot(runs, Figure(), channels=["error", "rate_estimate"])
    x, y, rate = figure.axes
    assert [x.get_ylabel()[:9], y.get_ylabel()[:9]] == ["|error| x", "|error| y"]
    assert x.get_legend_handles_labels()[1] == ["paper", "PID"]
    assert "PID" not in rate.get_legend_handles_labels()[1], "it has no such estimate"
    write_plot(runs, tmp_path / "column.svg", width="89 mm")
    picture = ElementTree.parse(tmp_path / "column.svg").getroot()
    assert float(picture.get("width", "").removesuffix("pt")) == pytest.approx(89 / 25.4 * 72, abs=0.1)
    sizes = {float(size) for size in re.findall(r"font(?:-size)?: ([\d.]+)px", (tmp_path / "column.svg").read_text())}
    assert sizes - {4.9} == {7.0}, "readable in a column; exponents are smaller"


def test_what_cannot_be_drawn_is_refused() -> None:
    run = fg.simulate(SI.replace({"run.duration": 1.0}))
    with pytest.raises(ValueError, match="channels has 'speed': it must have some of position, velocity, "):
        fg.plot(run, channels=["speed"])
    for width in ("wide", "89", "2 m", "1 mm"):
        with pytest.raises(ValueError, match=f"width is '{width}': it must be from 30 mm to 1000 mm"):
            fg.plot(run, width=width)
    with pytest.raises(ValueError, match="the runs have units SI and nondimensional: they must be the same"):
        fg.plot({"a": run, "b": fg.simulate(fg.Scenario.paper().replace({"run.duration": 1.0}))})
