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
    assert {"position", "tracking error", "time (nondimensional)", "reference"} <= set(texts(picture))
    families = set(re.findall(r"font-family: ([^;\"]+)", path.read_text(encoding="utf-8")))
    assert families == {"'DejaVu Sans', 'Verdana', sans-serif"}
    assert picture.findtext(f"{SVG}title") == "A run"
    assert "tracking error: x, y" in str(picture.findtext(f"{SVG}desc"))


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
