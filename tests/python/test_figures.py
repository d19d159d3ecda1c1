"""Figures 3 to 19: complete, readable as SVG and PNG, the same from the same runs, true to the extremes."""

from __future__ import annotations

import multiprocessing
import re
import struct
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import fracgyro as fg
import numpy as np
import pytest
import xarray as xr
from fracgyro.analysis.decimation import decimate
from fracgyro_lab.paper import drawing, figures
from hypothesis import given
from hypothesis import strategies as st

KINDS = {"proposed": "fractional_fast_terminal", "fractional": "fractional", "conventional": "fast_terminal"}
Runs = dict[tuple[str, str], xr.Dataset]


@pytest.fixture(scope="module")
def runs() -> Runs:
    changes = {"run.duration": 12.0}
    return {
        (variant, name): fg.simulate(fg.Scenario.paper(variant).replace({**changes, "controller.kind": kind}))
        for variant in ("printed", "corrected")
        for name, kind in KINDS.items()
    }


@pytest.fixture(scope="module")
def drawn(runs: Runs, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("figures")
    with figures.workers(2) as pool:
        started = figures.start_all(runs, folder, pool)
        paths = [path for figure in started for path in figure.result()]
    assert len(started) == 17
    assert sorted(paths) == sorted(folder.iterdir()), "what is returned is what is there, and nothing half-written is"
    return folder


def texts(svg: Path) -> list[str]:
    """Formulas follow their letters as comments."""
    found = re.findall(r"<!-- (.*?) -->|<text[^>]*>([^<]+)</text>", svg.read_text(encoding="utf-8"))
    return [formula or text for formula, text in found]


def test_the_papers_figures_are_three_to_nineteen() -> None:
    assert list(figures.FIGURES) == list(range(3, 20))
    rows = {number: len(spec.rows) for number, spec in figures.FIGURES.items()}
    assert [rows[n] for n in range(3, 20)] == [2] * 7 + [3] * 6 + [1] * 3 + [3]
    by_controller = {name: [n for n, spec in figures.FIGURES.items() if spec.controller == name] for name in KINDS}
    assert by_controller["fractional"] == [5, 11, 14, 17]
    assert by_controller["conventional"] == [6, 8, 12, 15, 18]


def test_every_figure_is_a_small_svg_and_a_png_fit_for_print(drawn: Path) -> None:
    for spec in figures.FIGURES.values():
        svg, png = drawn / f"{spec.stem}.svg", drawn / f"{spec.stem}.png"
        root = ElementTree.parse(svg).getroot()
        width = float(root.attrib["width"].removesuffix("pt")) / 72 * 25.4
        assert width == pytest.approx(170, abs=0.1)
        assert svg.stat().st_size < 150_000
        header = png.read_bytes()[:24]
        assert header[:8] == b"\x89PNG\r\n\x1a\n"
        assert struct.unpack(">I", header[16:20])[0] / (width / 25.4) >= 150


def test_no_coordinate_is_lost_when_paths_are_shortened(drawn: Path) -> None:
    command = re.compile(r"(?:[ML] ?|C|Q|z)|-?\d*\.?\d+(?:e-?\d+)?|\s+")
    for svg in drawn.glob("*.svg"):
        for path in re.findall(r'\bd="([^"]+)"', svg.read_text(encoding="utf-8")):
            assert command.sub("", path) == ""
            for letter, numbers in re.findall(r"([MLQC]) ([^MLQCz]+)", path):
                group = {"M": 2, "L": 2, "Q": 4, "C": 6}[letter]
                assert len(numbers.split()) % group == 0


def test_every_row_names_its_quantity_and_every_column_of_panels_its_time(drawn: Path) -> None:
    for spec in figures.FIGURES.values():
        written = texts(drawn / f"{spec.stem}.svg")
        for row in spec.rows:
            assert any(row.symbol in text and row.unit in text for text in written), (spec.stem, row.symbol)
        assert sum(text == "t (nondimensional; 1 = 1 ms)" for text in written) >= 2
        assert {"As printed", "Corrected"} <= set(written)
        assert len([text for text in written if re.fullmatch(r"\N{MINUS SIGN}?[\d.]+", text)]) > 10


def test_the_estimates_stand_beside_their_true_values(drawn: Path, runs: Runs) -> None:
    for number in range(10, 19):
        assert any(text.startswith("true") for text in texts(drawn / f"figure{number}.svg"))
    plan = figures._plan(13, runs)
    levels = {round(float(panel.curves["truth"][1][0]), 1) for panel in plan.panels}
    assert levels == {355.3, 71.0, 532.9}, "eq. (48)"


def test_only_the_printed_law_shows_an_element_beside_the_rate(drawn: Path, runs: Runs) -> None:
    printed, corrected = figures._plan(16, runs).legends
    assert "element" in printed
    assert "element" not in corrected
    run = runs["printed", "proposed"]
    element = run["rate_estimate"] + run["rate_symmetric_estimate"].sel(entry="xy")
    panel = figures._plan(16, runs).panels[0]
    assert panel.curves["element"][1].max() == pytest.approx(float(element.sel(time=slice(0, 6)).max()))
    assert np.ptp(panel.curves["estimate"][1]) == 0.0


def test_the_first_force_of_the_riemann_liouville_controller_is_told_where_it_leaves_the_panel(
    drawn: Path, runs: Runs
) -> None:
    first = float(runs["corrected", "proposed"]["control"].sel(axis="x")[0])
    assert f"first sample \N{MINUS SIGN}{abs(first):.0f}, off the scale" in texts(drawn / "figure09.svg")


def test_the_same_runs_give_the_same_bytes(drawn: Path, runs: Runs, tmp_path: Path) -> None:
    for number in (3, 7, 16):
        for path in figures.draw(number, runs, tmp_path):
            assert path.read_bytes() == (drawn / path.name).read_bytes(), "here as in a worker process"
    assert not multiprocessing.active_children()


def test_a_folder_that_is_not_there_is_told_in_a_sentence(runs: Runs, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"figure03\.svg cannot be written"):
        figures.draw(3, runs, tmp_path / "missing")


finite = st.floats(-1e6, 1e6)
signals = st.lists(finite, min_size=1, max_size=300).map(np.array)


@given(signals, st.integers(1, 60))
def test_decimation_keeps_the_extremes_of_every_stretch_and_both_ends(values: drawing.Array, columns: int) -> None:
    time = np.arange(float(len(values)))
    kept_time, kept = decimate(time, values, columns)
    assert np.array_equal(kept, values[kept_time.astype(int)]), "samples, not averages"
    assert np.all(np.diff(kept_time) > 0)
    assert (kept_time[0], kept_time[-1]) == (0, len(values) - 1)
    assert len(kept) <= 2 * columns + 2
    stretch = -(-len(values) // columns)
    for begin in range(0, len(values), stretch):
        inside = (kept_time >= begin) & (kept_time < begin + stretch)
        assert kept[inside].min() == values[begin : begin + stretch].min()
        assert kept[inside].max() == values[begin : begin + stretch].max()


@given(signals, st.integers(1, 60))
def test_an_envelope_is_above_every_sample_and_touches_one_in_each_stretch(values: drawing.Array, columns: int) -> None:
    time = np.arange(float(len(values)))
    middles, powers = drawing.envelope(time, values, columns)
    stretch = -(-len(values) // columns)
    peaks = [abs(values[i : i + stretch]).max() for i in range(0, len(values), stretch)]
    assert np.allclose(10**powers, np.maximum(peaks, 1e-12))
    assert np.all(np.diff(middles) > 0)


@given(finite, st.floats(1e-3, 1e6), st.integers(2, 6))
def test_ticks_are_inside_and_their_texts_are_their_values(low: float, width: float, count: int) -> None:
    values, written = drawing._ticks(low, low + width, count)
    assert all(low - 1e-6 * width <= value <= low + width * (1 + 1e-6) for value in values)
    assert 1 <= len(values) <= 2.5 * count + 1  # one round step is up to 2.5 times the next smaller
    read = [float(text.replace("\N{MINUS SIGN}", "-")) for text in written]
    assert read == pytest.approx(values, abs=1e-9)
