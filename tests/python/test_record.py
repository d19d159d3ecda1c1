"""`fracgyro allan` on files as engineers have them, and what it says of files that are no records."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

import fracgyro as fg
import numpy as np
import pytest
from fracgyro.rate.of_record import analyse_record
from fracgyro.rate.record import read_record
from test_cli import run, sentence

DEG = math.pi / 180
RATES = np.random.default_rng(0).normal(size=400)


def written(path: Path, rows: list[str], text: str = "") -> Path:
    path.write_text(text + "\n".join(rows) + "\n", encoding="utf-8")
    return path


def numbered(values: np.ndarray = RATES, interval: float = 0.01) -> list[str]:
    return [f"{i * interval:.6f},{value!r},{-value!r}" for i, value in enumerate(values.tolist())]


# -- Layouts -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("head", "column"),
    [
        ("time,x,y\n", "x"),
        ("t,x,y\n", "x"),
        ('"Time (s)","x","y"\n', "x"),
        ("﻿time [s], x, y\n", "x"),
        ("# a comment\n\n#time_s,x,y\n", "x"),
    ],
)
def test_the_time_column_gives_the_rate(tmp_path: Path, head: str, column: str) -> None:
    record = read_record(written(tmp_path / "a.csv", numbered(), head), column)
    np.testing.assert_allclose(record.values, RATES * DEG, rtol=1e-14)
    assert record.interval == pytest.approx(0.01, rel=1e-9)
    assert read_record(tmp_path / "a.csv", "y", rate=101.0).interval == 1 / 101  # which counts where both are given


def test_times_in_nanoseconds_are_read_as_such(tmp_path: Path) -> None:
    rows = [f"{1403636579758555392 + 5_000_000 * i},{value!r}" for i, value in enumerate(RATES.tolist())]
    record = read_record(written(tmp_path / "a.csv", rows, "#timestamp [ns],w_RS_S_x [rad s^-1]\n"), unit="rad/s")
    assert record.interval == pytest.approx(0.005, rel=1e-6)
    assert record.column == "w_RS_S_x [rad s^-1]"
    np.testing.assert_array_equal(record.values, RATES)


@pytest.mark.parametrize("sign", ["\v", "\f", "\x1c", "\x1d", "\x1e", "\x85", "\u2028", "\u2029"])
def test_a_comment_ends_where_its_line_does_whatever_is_in_it(tmp_path: Path, sign: str) -> None:
    path = tmp_path / "a.csv"
    path.write_text(f"# made{sign}here\ntime,x,y\n" + "\n".join(numbered()) + "\n", encoding="utf-8", newline="")
    np.testing.assert_allclose(read_record(path, "x").values, RATES * DEG, rtol=1e-14)


@pytest.mark.parametrize("head", ["time;x;y\n", '"Time (s)";"x";"y"\n', "# time;x;y\n", "time\tx\ty\n"])
def test_decimals_may_be_commas_where_these_separate_no_columns(tmp_path: Path, head: str) -> None:
    rows = [row.replace(",", "\t" if "\t" in head else ";").replace(".", ",") for row in numbered()]
    record = read_record(written(tmp_path / "a.csv", rows, head), "x")
    np.testing.assert_allclose(record.values, RATES * DEG, rtol=1e-14)
    assert record.interval == pytest.approx(0.01, rel=1e-9)


def test_decimals_may_be_commas_in_a_column_of_a_name_and_in_columns_without_names(tmp_path: Path) -> None:
    decimals = [repr(value).replace(".", ",") for value in RATES.tolist()]
    named = read_record(written(tmp_path / "a.csv", decimals, "rate\n"), rate=100.0)
    second = read_record(written(tmp_path / "b.csv", [f"1,5;{each}" for each in decimals]), "2", rate=100.0)
    for record in (named, second):
        np.testing.assert_allclose(record.values, RATES * DEG, rtol=1e-14)


def test_a_column_of_decimal_commas_without_a_name_is_not_read_as_two_columns(tmp_path: Path) -> None:
    path = written(tmp_path / "a.csv", [f"{value:.4f}".replace(".", ",") for value in RATES.tolist()])
    for column in (None, "1", "2"):
        with pytest.raises(ValueError, match="its rows can be two columns or one of decimal commas: it must have"):
            read_record(path, column, rate=100.0)
    counts = [f"{i},{count}" for i, count in enumerate((1e6 * RATES).astype(int).tolist())]
    assert read_record(written(tmp_path / "b.csv", counts), "2", rate=100.0).values[0] == int(1e6 * RATES[0]) * DEG


@pytest.mark.parametrize(
    ("name", "seconds"),
    [("t [ms]", 1e-3), ("Time_us", 1e-6), ("timestamp (\u00b5s)", 1e-6), ("time [\u03bcs]", 1e-6), ("T(NS)", 1e-9)],
)
def test_a_time_column_names_its_unit(tmp_path: Path, name: str, seconds: float) -> None:
    rows = [f"{i * 0.01 / seconds:.3f},{value!r}" for i, value in enumerate(RATES.tolist())]
    record = read_record(written(tmp_path / "a.csv", rows, f"{name},x\n"))
    assert record.interval == pytest.approx(0.01, rel=1e-9)
    assert record.note == ""


def ticks(per_second: float, name: str = "timestamp") -> list[str]:
    """200 samples a second, their times in ticks."""
    return [f"{name},x", *(f"{i * per_second / 200:.12g},{value!r}" for i, value in enumerate(RATES.tolist()))]


@pytest.mark.parametrize("per_second", [1e3, 1e6, 1e9])
@pytest.mark.parametrize("name", ["timestamp", "t", "time"])
def test_ticks_without_a_unit_are_not_taken_for_seconds(tmp_path: Path, name: str, per_second: float) -> None:
    path = written(tmp_path / "a.csv", ticks(per_second, name))
    said = f"{name} has no unit, and in seconds its samples would be {per_second / 200:g} s apart"
    with pytest.raises(ValueError, match=re.escape(said)):
        read_record(path)
    assert read_record(path, rate=200.0).interval == 0.005  # as the sentence advises, with each of these units
    written(path, ticks(per_second, f"{name} [{ {1e3: 'ms', 1e6: 'us', 1e9: 'ns'}[per_second] }]"))
    assert read_record(path).interval == pytest.approx(0.005, rel=1e-9)


def test_a_thousand_samples_a_second_in_milliseconds_are_not_taken_for_one_a_second(tmp_path: Path) -> None:
    rows = ["t,x", *(f"{i},{value!r}" for i, value in enumerate(RATES.tolist()))]
    with pytest.raises(ValueError, match="t has no unit, and in seconds its samples would be 1 s apart"):
        read_record(written(tmp_path / "a.csv", rows))


def test_a_time_that_names_no_unit_is_said_to_be_taken_for_seconds(tmp_path: Path) -> None:
    path = written(tmp_path / "a.csv", ticks(1.0))
    words = "timestamp names no unit and is taken for seconds"
    assert read_record(path).note == words
    assert f"Note: {words}" in run("allan", path).stdout
    assert json.loads(run("allan", path, "--json").stdout)["note"] == words


@pytest.mark.parametrize("given", ["200", "209", "191"])
def test_a_rate_within_five_percent_of_the_times_is_taken(tmp_path: Path, given: str) -> None:
    path = written(tmp_path / "a.csv", ticks(1.0, "time [s]"))
    assert f", {given} a second\n" in run("allan", path, "--rate", given).stdout


def test_a_rate_hides_gaps_but_they_are_named(tmp_path: Path) -> None:
    rows = ticks(1.0)
    gaps = [*rows[:50], *rows[51:100], *rows[101:]]
    said = run("allan", written(tmp_path / "a.csv", gaps), "--rate", "200").stdout
    assert "Note: timestamp has 2 gaps, the first at line 51, which --rate hides" in said
    said = run("allan", written(tmp_path / "b.csv", [*rows[:50], *rows[51:]]), "--rate", "200").stdout
    assert "Note: timestamp has a gap at line 51, which --rate hides" in said


def test_a_rate_serves_where_the_times_jitter_or_are_dates_or_no_times(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    jitter = np.sort(np.arange(400) * 0.005 + rng.uniform(0, 0.02, 400))
    temperature = 25 + rng.normal(size=400)
    for times in (jitter.tolist(), temperature.tolist(), [f"2026-01-01T00:00:{i / 200:06.3f}" for i in range(400)]):
        rows = ["t,x", *(f"{time},{value!r}" for time, value in zip(times, RATES.tolist(), strict=True))]
        record = read_record(written(tmp_path / "a.csv", rows), rate=200.0)
        assert (record.interval, record.note) == (0.005, "")
        np.testing.assert_allclose(record.values, RATES * DEG, rtol=1e-14)
        with pytest.raises(ValueError, match=r"give rate$|must be a finite number"):
            read_record(tmp_path / "a.csv")


def test_sentences_name_arguments_in_python_and_options_on_the_command_line(tmp_path: Path) -> None:
    path = written(tmp_path / "a.csv", ["x", *map(repr, RATES.tolist())])
    with pytest.raises(ValueError, match=r"^rate is needed, in Hz"):
        analyse_record(path)
    assert sentence(run("allan", path)).startswith("--rate is needed, in Hz")


@pytest.mark.parametrize("delimiter", [";", "\t"])
def test_columns_without_names_are_numbers(tmp_path: Path, delimiter: str) -> None:
    rows = [row.replace(",", delimiter) for row in numbered()]
    record = read_record(written(tmp_path / "a.csv", rows), "2", rate=100.0)
    np.testing.assert_allclose(record.values, RATES * DEG, rtol=1e-14)


@pytest.mark.parametrize(
    ("unit", "factor"), [("deg/s", 1.0), ("rad/s", 180 / math.pi), ("deg/h", 1 / 3600), ("mdeg/s", 1e-3)]
)
def test_units_are_those_of_gyroscopes(tmp_path: Path, unit: str, factor: float) -> None:
    only = written(tmp_path / "a.csv", [repr(value) for value in RATES.tolist()])
    np.testing.assert_allclose(read_record(only, rate=1.0, unit=unit).values, RATES * factor * DEG, rtol=1e-14)


# -- The command ---------------------------------------------------------------------------------------------


def test_the_command_finds_the_terms_of_a_record_and_writes_them_and_a_plot(tmp_path: Path) -> None:
    n, k, samples, interval = 0.05, 0.001, 100_000, 0.1  # deg/s/sqrt(Hz), deg/s/sqrt(s)
    rng = np.random.default_rng(4)
    record = 3.0 + rng.normal(size=samples) * n / math.sqrt(interval)
    record += np.cumsum(rng.normal(size=samples)) * k * math.sqrt(interval)
    written(tmp_path / "gyro.csv", [f"{value:.7g}" for value in record], "z\n")
    out = tmp_path / "out"
    done = run("allan", tmp_path / "gyro.csv", "--rate", "10", "--out", out, "--json")
    assert done.returncode == 0, done.stderr
    content = json.loads(done.stdout)
    assert content == json.loads((out / "allan.json").read_text(encoding="utf-8"))
    assert sorted(path.name for path in out.iterdir()) == ["allan.json", "allan.svg"]
    assert "<svg" in (out / "allan.svg").read_text(encoding="utf-8")
    walk, floor, drift = content["figures"]
    assert [walk["unit"], floor["unit"], drift["unit"]] == ["deg/sqrt(h)", "deg/h", "deg/h/sqrt(h)"]
    assert walk["low"] < n * 60 < walk["high"]
    assert walk["value"] == pytest.approx(n * 60, rel=0.02)
    assert drift["low"] < k * 3600 * 60 < drift["high"]
    assert floor["value"] is None
    assert floor["high"] > 0
    assert content["samples"] == samples
    # The same from Python, in SI.
    found = fg.rate.allan(np.loadtxt(tmp_path / "gyro.csv", skiprows=1) * DEG, interval)
    assert found.angle_random_walk.value / DEG * 60 == pytest.approx(walk["value"], rel=1e-9)
    curve = np.array(content["deviation_deg_per_h"]) * DEG / 3600
    np.testing.assert_allclose(curve, found.deviation, rtol=1e-9)
    again = run("allan", tmp_path / "gyro.csv", "--rate", "10", "--out", out)
    assert "it is there already" in sentence(again)
    table = run("allan", tmp_path / "gyro.csv", "--rate", "10").stdout
    assert "z: 100000 samples in deg/s, 10 a second" in table
    assert "Angle random walk" in table


GOOD = ["time,x,y", *numbered()]


@pytest.mark.parametrize(
    ("lines", "words", "expected"),
    [
        (GOOD, [], "--column is needed: it must be one of those of {path}: x, y"),
        (GOOD, ["--column", "z"], "--column is 'z': it must be one of those of {path}: x, y"),
        (
            GOOD,
            ["--column", "time"],
            "--column is 'time', which is the time: it must be one of those of {path}: x, y",
        ),
        (
            GOOD,
            ["--column", "x", "--rate", "50"],
            "--rate is 50: it must be that of time in {path} within 5 %, whose samples are 0.01 apart in an unnamed "
            "unit; rename that column if it is not the time",
        ),
        (
            ["time [s],x,y", *numbered()],
            ["--column", "x", "--rate", "106"],
            "--rate is 106: it must be that of time [s] in {path} within 5 %, whose samples are 100 a second; rename "
            "that column if it is not the time",
        ),
        (GOOD, ["--column", "x", "--unit", "dps"], "--unit is 'dps': it must be one of deg/s, rad/s, deg/h, mdeg/s"),
        (GOOD, ["--column", "x", "--rate", "0"], "--rate is 0.0: it must be greater than 0"),
        (GOOD[:15], ["--column", "x"], "{path} has 14 rows: it must have at least 20"),
        (["time,x,y"], ["--column", "x"], "{path} has 0 rows: it must have at least 20"),
        ([], ["--rate", "1"], "{path} has 0 rows: it must have at least 20"),
        (
            ["x", *map(str, RATES)],
            [],
            "--rate is needed, in Hz, as {path} has no column called time, timestamp or t, as in time [ns]",
        ),
        (["x", *["1.5"] * 50], ["--rate", "1"], "{path}: x is 1.5 in every row: it must vary"),
        (
            ["x,x", *["1,2"] * 50],
            ["--column", "x", "--rate", "1"],
            "--column is 'x': {path} must have one of that name, not 2",
        ),
        (
            [*GOOD[:30], "0.3,abc,1", *GOOD[30:]],
            ["--column", "x"],
            "{path}, line 31: x is 'abc': it must be a finite number",
        ),
        (
            [*GOOD[:30], "0.3,,1", *GOOD[30:]],
            ["--column", "x"],
            "{path}, line 31: x is empty or not a number: it must be a finite number",
        ),
        (
            [*GOOD[:30], "0.3,nan,1", *GOOD[30:]],
            ["--column", "x"],
            "{path}, line 31: x is empty or not a number: it must be a finite number",
        ),
        (
            [*GOOD[:30], "0.3,-inf,1", *GOOD[30:]],
            ["--column", "x"],
            "{path}, line 31: x is infinite: it must be a finite number",
        ),
        ([*GOOD[:30], "0.3,1", *GOOD[30:]], ["--column", "x"], "{path}, line 31: it has 2 columns: it must have 3"),
        (
            [*GOOD[:30], *GOOD[31:]],
            ["--column", "x"],
            "{path}, line 31: time is 0.02 later than in the line before: it must be 0.01 later, as in most lines, "
            "within 50 %; samples are missing there; split the record at this gap",
        ),
        (
            [*GOOD[:30], *GOOD[31:60], *GOOD[62:]],
            ["--column", "x"],
            "{path}, line 31: time is 0.02 later than in the line before: it must be 0.01 later, as in most lines, "
            "within 50 %; samples are missing there; split the record at this gap, the first of 2",
        ),
        (
            [*GOOD[:30], GOOD[30].replace("0.29", "0.297"), *GOOD[31:]],
            ["--column", "x"],
            "{path}, line 31: time is 0.017 later than in the line before: it must be 0.01 later, as in most lines, "
            "within 50 %; if samples are evenly spaced and only their times jitter, give --rate",
        ),
        (
            ["time,x", *["0.0,1", "0.0,2"] * 20],
            [],
            "{path}: time does not rise from line to line: it must, or give --rate",
        ),
    ],
)
def test_what_is_no_record_is_refused_in_one_sentence_and_nothing_is_written(
    tmp_path: Path, lines: list[str], words: list[str], expected: str
) -> None:
    path = written(tmp_path / "a.csv", lines) if lines else tmp_path / "a.csv"
    path.touch()
    said = sentence(run("allan", path, *words, "--out", tmp_path / "out"))
    assert said == expected.format(path=path)
    assert [each.name for each in tmp_path.iterdir()] == ["a.csv"]


def test_a_file_that_cannot_be_read_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"none\.csv cannot be read: No such file or directory"):
        analyse_record(tmp_path / "none.csv", rate=1.0)
    with pytest.raises(ValueError, match="cannot be read: Is a directory"):
        analyse_record(tmp_path, rate=1.0)
    (tmp_path / "picture.csv").write_bytes(bytes(range(256)) * 1000)
    with pytest.raises(ValueError, match=r"picture\.csv"):
        analyse_record(tmp_path / "picture.csv", rate=1.0)


def test_a_line_of_a_later_block_is_named(tmp_path: Path) -> None:
    rows = ["x", *["1.000000"] * 600_000, "bad", "2.0"]  # more than 4 MiB
    with pytest.raises(ValueError, match="line 600002: x is 'bad'"):
        read_record(written(tmp_path / "a.csv", rows), rate=1.0)
