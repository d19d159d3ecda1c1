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
import numpy as np
import pytest
from figure_data import LINK, read
from fracgyro.analysis.html import csv_text, data_link, embedded
from fracgyro.analysis.panels import COLUMNS
from fracgyro.analysis.plots import write_plot
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


def test_a_fast_oscillation_is_drawn_as_a_band_on_axes_of_its_own_within_its_reference() -> None:
    run = fg.simulate(fg.Scenario.shipped("dual_mass").replace({"run.units": "SI", "run.duration": 4000.0}))
    panels = fg.plot(run, Figure(), channels=["position"]).axes
    assert [panel.get_ylabel() for panel in panels] == ["position x\n(µm)", "position y\n(µm)"]
    for panel, axis in zip(panels, "xy", strict=True):
        (area,), values, reference = (
            panel.collections,
            *(run[n].sel(axis=axis).values for n in ("position", "reference")),
        )
        edges = area.get_paths()[0].vertices[:, 1] * 1e-6
        assert (edges.min(), edges.max()) == pytest.approx((values.min(), values.max()), rel=1e-12)
        low, high = (1e-6 * line.get_ydata() for line in panel.lines)
        assert (low.min(), high.max()) == pytest.approx((reference.min(), reference.max()), rel=1e-12)


def test_the_noise_of_a_settled_position_does_not_make_it_a_band() -> None:
    step = {"reference.kind": "step", "run.initial_position": (0.0, 0.0), "controller.kind": "pid"}
    run = fg.simulate(fg.Scenario.paper().replace({**step, "run.duration": 10.0}))
    panel = fg.plot(run, Figure(), channels=["position"]).axes[0]
    assert not panel.collections
    assert len(panel.lines) == 4


def test_a_first_spike_of_the_force_is_clipped_and_stated() -> None:
    run = fg.simulate(SI)
    panel = fg.plot(run, Figure(), channels=["control"]).axes[0]
    forces = 1e6 * run["control"].values
    row = int(abs(forces).max(axis=1).argmax())
    peak = max(forces[row], key=abs)
    bottom, top = panel.get_ylim()
    assert not bottom <= peak <= top
    assert bottom < forces[100:].min() < forces[100:].max() < top
    stated = re.fullmatch(r"clipped peak: (.*) at t = (.*)", panel.get_title(loc="left"))
    assert stated
    assert float(stated[1].replace("\N{MINUS SIGN}", "-")) == pytest.approx(peak, rel=5e-3)
    assert float(stated[2]) == pytest.approx(1e3 * float(run["time"][row]), rel=0.05)
    without = run.assign(control=run["control"] * (run["time"] > 1e-3))
    assert not fg.plot(without, Figure(), channels=["control"]).axes[0].get_title(loc="left")


CHIRP = SI.replace(
    {"reference.kind": ["chirp", "rest"], "reference.final_frequency": (8.0, 0.0), "reference.end": 18.0}
)


def test_a_chirp_has_an_axis_of_its_own_and_its_frequency_response_below() -> None:
    run = fg.simulate(CHIRP)
    response = fg.metrics.frequency_response(run).sel(axis="x")
    figure = fg.plot(run, Figure())
    *above, gain, phase = figure.axes
    labels = [panel.get_ylabel().split("\n")[0] for panel in above]
    assert labels == ["position x", "position y", "|error|", "force x", "force y"]
    assert above[-1].get_xlabel() == "time (ms)"
    assert (gain.get_ylabel(), phase.get_ylabel()) == ("gain\n(dB)", "phase\n(deg)")
    assert phase.get_xlabel() == "frequency (rad/s)"
    assert gain.get_xscale() == phase.get_xscale() == "log"
    (decibels,), (degrees,) = gain.lines, phase.lines
    assert 10 ** (decibels.get_ydata() / 20) == pytest.approx(response.gain.values)
    assert degrees.get_ydata() == pytest.approx(np.degrees(response.phase.values))
    assert decibels.get_xdata() == pytest.approx(response.frequency.values)
    assert len(fg.plot(run, Figure(), channels=["error"]).axes) == 1, "only what is asked for"


def test_frequency_responses_are_drawn_together_in_a_column(tmp_path: Path) -> None:
    both = CHIRP.replace({"reference.kind": "chirp", "reference.final_frequency": (8.0, 8.0)})
    runs = {"paper": fg.simulate(both), "PID": fg.simulate(both.replace({"controller.kind": "pid"}))}
    responses = {name: fg.metrics.frequency_response(run) for name, run in runs.items()}
    assert [line.get_label() for line in fg.plot(responses["PID"], Figure()).axes[0].lines] == ["x", "y"]
    figure = fg.plot(responses, Figure(), width="89 mm")
    assert len(figure.axes) == 2
    names = ["paper, x", "paper, y", "PID, x", "PID, y"]
    assert [line.get_label() for line in figure.axes[0].lines] == names
    looks = {(line.get_color(), line.get_linestyle()) for line in figure.axes[0].lines}
    assert len(looks) == 4, "each looks different"
    write_plot(responses, tmp_path / "bode.svg", width="89 mm")
    picture = ElementTree.parse(tmp_path / "bode.svg").getroot()
    assert {"frequency (rad/s)", "gain", "(dB)", "phase", "(deg)", *names} <= set(texts(picture))
    with pytest.raises(ValueError, match="run has a frequency response and a run: it must have only one of these"):
        fg.plot({"response": responses["PID"], "run": runs["PID"]}, Figure())


def test_a_conventional_gyroscope_shows_its_drive_and_not_an_error() -> None:
    drive = {"controller.kind": "force_rebalance", "reference.kind": ["sine", "rest"], "run.duration": 600.0}
    scenario = fg.Scenario.shipped("dual_mass").replace(drive)
    run = fg.simulate(scenario)
    figure = fg.plot(run, Figure())
    words = [panel.get_ylabel().split("\n")[0] for panel in figure.axes]
    assert words == ["drive amplitude", "drive frequency", "quadrature", "force x", "force y", "rate"]
    amplitude, set_point = figure.axes[0].lines
    assert (amplitude.get_ydata().min(), amplitude.get_ydata().max()) == (
        run["drive_amplitude"].min(),
        run["drive_amplitude"].max(),
    )
    assert set_point.get_label() == "set point"
    assert list(set_point.get_ydata()) == [scenario.reference.amplitude[0]] * 2
    other = fg.simulate(scenario.replace({"controller.kind": "open_loop"}))
    assert len(fg.plot({"rebalance": run, "open loop": other}, Figure()).axes) == 6


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
