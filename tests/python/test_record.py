"""`fracgyro allan` on typical files of engineers, and its messages for files that are not records."""

from __future__ import annotations

import bz2
import gzip
import json
import lzma
import math
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import fracgyro as fg
import numpy as np
import pyarrow as pa
import pyarrow.parquet
import pytest
import scipy.io
from browser import faults_of_report
from fracgyro.rate.of_record import analyze_record, analyze_series
from fracgyro.rate.record import Options
from fracgyro.rate.record import read_record as read
from fracgyro.rate.times import examine
from fracgyro.rate.units import RATES as RATE_UNITS
from test_cli import run, sentence

ROOT = Path(__file__).resolve().parents[2]
DEG = math.pi / 180
RATES = np.random.default_rng(0).normal(size=400)


def read_record(path: Path, column: str | None = None, **options: Any) -> Any:
    """The record of one column, its values flat."""
    record = read(path, Options(columns=(column,) if column else (), **options))
    return SimpleNamespace(
        values=record.values[0],
        interval=record.interval,
        column=record.columns[0],
        unit=record.unit,
        note="; ".join(record.notes),
    )


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
        with pytest.raises(
            ValueError,
            match="has no column names, and a comma in its rows may be a separator or a decimal comma: it must have",
        ):
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
    assert record.note == "x has no unit; deg/s is assumed"


def ticks(per_second: float, name: str = "timestamp") -> list[str]:
    """A record at 200 Hz with its times in ticks."""
    return [f"{name},x [deg/s]", *(f"{i * per_second / 200:.12g},{value!r}" for i, value in enumerate(RATES.tolist()))]


@pytest.mark.parametrize(("per_second", "unit"), [(1e3, "ms"), (1e6, "us"), (1e9, "ns")])
@pytest.mark.parametrize("name", ["timestamp", "t", "time"])
def test_ticks_without_a_unit_are_in_the_only_one_that_makes_them_a_gyroscopes(
    tmp_path: Path, name: str, per_second: float, unit: str
) -> None:
    path = written(tmp_path / "a.csv", ticks(per_second, name))
    record = read_record(path)
    assert record.interval == pytest.approx(0.005, rel=1e-9)
    assert record.note == f"{name} has no unit; {unit} are assumed, which gives 200 Hz"
    assert read_record(path, rate=200.0).note == ""
    assert read_record(path, time_unit=unit).note == ""
    written(path, ticks(per_second, f"{name} [{unit}]"))
    assert read_record(path).note == ""


def test_ticks_that_may_be_of_two_units_are_refused(tmp_path: Path) -> None:
    rows = ["t,x", *(f"{20 * i},{value!r}" for i, value in enumerate(RATES.tolist()))]  # 50 Hz in ms, 50 kHz in us
    path = written(tmp_path / "a.csv", [rows[0], *(row.replace(",", "0,") for row in rows[1:])])
    with pytest.raises(
        ValueError, match=r"t has no unit, and in seconds the samples would be 200 s apart: give time_u"
    ):
        read_record(path)
    assert read_record(path, time_unit="us").interval == pytest.approx(2e-4)
    said = sentence(run("allan", path))
    assert "give --time-unit or --rate, or name the unit in the first line, as in t [ms]" in said


def test_a_time_that_names_no_unit_is_said_to_be_taken_for_seconds(tmp_path: Path) -> None:
    path = written(tmp_path / "a.csv", ticks(1.0))
    words = "timestamp has no unit; seconds are assumed"
    assert read_record(path).note == words
    assert f"Note: {words}" in run("allan", path).stdout
    assert json.loads(run("allan", path, "--json").stdout)["notes"] == [words]


@pytest.mark.parametrize(("given", "note"), [(200.0, ""), (200.9, ""), (209.0, "4.5"), (191.0, "-4.5")])
def test_a_rate_within_five_percent_of_the_times_is_taken(tmp_path: Path, given: float, note: str) -> None:
    record = read_record(written(tmp_path / "a.csv", ticks(1.0, "time [s]")), rate=given)
    assert record.interval == 1 / given
    assert (f"rate differs by +{note} % from that of time [s]".replace("+-", "-") in record.note) == bool(note)


def test_a_rate_serves_where_the_times_jitter_or_are_dates_or_no_times(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    temperature = 25 + rng.normal(size=400)
    for times in (temperature.tolist(), [f"2026-01-01T00:00:{i / 200:06.3f}" for i in range(400)]):
        rows = ["t,x", *(f"{time},{value!r}" for time, value in zip(times, RATES.tolist(), strict=True))]
        record = read_record(written(tmp_path / "a.csv", rows), rate=200.0)
        assert record.interval == 0.005
        np.testing.assert_allclose(record.values, RATES * DEG, rtol=1e-14)
        with pytest.raises(ValueError, match=r"give rate$|must be a finite number"):
            read_record(tmp_path / "a.csv")


# -- Times: a straight line through them ---------------------------------------------------------------------


def even(samples: int = 4000, interval: float = 1.2) -> np.ndarray:
    return np.asarray(interval * np.arange(samples))


def test_rounding_to_whole_milliseconds_is_no_gap() -> None:
    for rate in (833.0, 1000.0, 119.0, 400.0, 6600.0):
        found = examine(np.floor(even(5000, 1e3 / rate)))
        assert found is not None
        assert len(found.gaps) == found.repeats == len(found.falls) == 0
        assert found.interval == pytest.approx(1e3 / rate, rel=1e-3)
        assert found.jitter < 1.0


@pytest.mark.parametrize("rounding", [0.0, 1.0])
def test_missing_samples_are_found_whether_times_are_rounded_or_not(rounding: float) -> None:
    times = np.delete(even(), [700, *range(2000, 2010)])
    found = examine(np.floor(times) if rounding else times)
    assert found is not None
    assert found.gaps.tolist() == [699, 1998]
    assert found.missing == 11
    assert found.interval == pytest.approx(1.2, rel=1e-3)
    assert found.longest(len(times)) == (1999, 3989)


def test_jitter_and_bursts_are_no_gaps() -> None:
    jitter = even() + np.random.default_rng(0).uniform(0, 3.0, 4000)
    bursts = 12.0 * np.floor(even() / 12.0)  # ten samples written at once
    for times in (np.sort(jitter), bursts):
        found = examine(times)
        assert found is not None
        assert len(found.gaps) == len(found.falls) == 0
        assert found.interval == pytest.approx(1.2, rel=3e-3)


def test_repeats_and_falls_are_named() -> None:
    times = np.insert(even(interval=5.0), [100, 900], [5.0 * 99, 5.0 * 899])
    found = examine(times)
    assert found is not None
    assert found.repeats == 2
    assert not len(found.gaps)
    times = np.concatenate([even(), even()])
    found = examine(times)
    assert found is not None
    assert found.falls.tolist() == [4000]
    assert not found.even
    assert examine(np.zeros(100)) is None
    assert examine(-even()) is None


def test_a_gap_is_refused_with_the_longest_part_that_has_none_and_a_rate_hides_it(tmp_path: Path) -> None:
    rows = ticks(1.0, "time [s]")
    path = written(tmp_path / "a.csv", [*rows[:50], *rows[51:100], *rows[101:]])
    with pytest.raises(ValueError, match=r"begin 0.5 end 2\b") as said:
        read_record(path)
    assert "time [s] has 2 gaps, the first at line 51; 2 samples are missing: times must increase" in str(said.value)
    part = read_record(path, begin=0.5, end=2.0)
    np.testing.assert_allclose(part.values, RATES[100:] * DEG)
    assert part.note == ""
    assert "2 gaps, the first at line 51; 2 samples are missing" in read_record(path, rate=200.0).note


def test_jitter_is_a_note(tmp_path: Path) -> None:
    jitter = np.sort(np.arange(400) * 0.005 + np.random.default_rng(1).uniform(0, 0.02, 400))
    rows = ["t [s],x", *(f"{time},{value!r}" for time, value in zip(jitter.tolist(), RATES.tolist(), strict=True))]
    assert "jitters by up to 0.0" in read_record(written(tmp_path / "a.csv", rows)).note


def test_sentences_name_arguments_in_python_and_options_on_the_command_line(tmp_path: Path) -> None:
    path = written(tmp_path / "a.csv", ["x", *map(repr, RATES.tolist())])
    with pytest.raises(ValueError, match=r"^rate is needed, in Hz"):
        analyze_record(path)
    assert sentence(run("allan", path)).startswith("--rate is needed, in Hz")


@pytest.mark.parametrize("delimiter", [";", "\t"])
def test_columns_without_names_are_numbers(tmp_path: Path, delimiter: str) -> None:
    rows = [row.replace(",", delimiter) for row in numbered()]
    record = read_record(written(tmp_path / "a.csv", rows), "2", rate=100.0)
    np.testing.assert_allclose(record.values, RATES * DEG, rtol=1e-14)


@pytest.mark.parametrize(
    ("unit", "factor"),
    [
        *((unit, 1.0) for unit in ("deg/s", "dps", "\u00b0/s", "Deg / sec", "degrees/second", "deg s^-1")),
        *((unit, 180 / math.pi) for unit in ("rad/s", "rad/sec", "rad s^-1", "RAD/S")),
        ("deg/h", 1 / 3600),
        ("deg/hr", 1 / 3600),
        ("mdeg/s", 1e-3),
        ("mdps", 1e-3),
        ("mrad/s", 0.18 / math.pi),
    ],
)
def test_units_are_those_of_gyroscopes(tmp_path: Path, unit: str, factor: float) -> None:
    only = written(tmp_path / "a.csv", [repr(value) for value in RATES.tolist()])
    np.testing.assert_allclose(read_record(only, rate=1.0, unit=unit).values, RATES * factor * DEG, rtol=1e-14)
    named = written(tmp_path / "b.csv", [f"x [{unit}]", *map(repr, RATES.tolist())])
    np.testing.assert_allclose(read_record(named, rate=1.0).values, RATES * factor * DEG, rtol=1e-14)


NAMED_UNITS = {
    "gz [urad/s]": "urad/s",
    "gz [arcsec/s]": "arcsec/s",
    "gz (rpm)": "rpm",
    "gz [millideg/s]": "mdeg/s",
    "gz [rad·s⁻¹]": "rad/s",
    "gz [deg/hr]": "deg/h",
    "gz_rad_s": "rad/s",
    "gyro_z_dps": "deg/s",
    "omega_z deg_per_s": "deg/s",
    "field.angular_velocity.z": "rad/s",
    "gyro (z)": "deg/s",
    "gz": "deg/s",
}


@pytest.mark.parametrize(("name", "unit"), NAMED_UNITS.items())
def test_the_unit_is_that_of_the_name_or_stated_as_assumed(tmp_path: Path, name: str, unit: str) -> None:
    path = written(tmp_path / "a.csv", [name, *map(repr, RATES.tolist())])
    record = read_record(path, rate=1.0)
    np.testing.assert_allclose(record.values, RATES / RATE_UNITS[unit].per_si)
    assert record.unit == unit
    assert ("is assumed" in record.note) == (name in ("gz", "gyro (z)", "field.angular_velocity.z"))


def test_a_unit_in_latin_1_is_read(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes("\n".join(["gz [°/h]", *map(repr, RATES.tolist())]).encode("latin-1"))
    np.testing.assert_allclose(read_record(path, rate=1.0).values, RATES * DEG / 3600)


def test_increments_are_in_the_angle_that_the_file_names(tmp_path: Path) -> None:
    path = written(tmp_path / "a.csv", ["gz [rad]", *map(repr, RATES.tolist())])
    np.testing.assert_allclose(read_record(path, rate=50.0, increments=True).values, RATES * 50)


@pytest.mark.parametrize("stamps", ["in batches of ten", "in whole seconds"])
def test_stamps_that_many_samples_share_are_no_gaps(stamps: str) -> None:
    at = np.arange(6000)
    times = (at // 10 + 1) * 0.1 if "ten" in stamps else np.floor(at / 100)
    found = examine(times)
    assert found is not None
    assert found.even
    assert found.interval == pytest.approx(0.01, rel=1e-3)


def test_the_part_that_a_fall_of_the_times_suggests_is_read(tmp_path: Path) -> None:
    rows = ticks(1.0, "time [s]")
    path = written(tmp_path / "a.csv", [*rows[:101], *rows[1:]])
    with pytest.raises(ValueError, match="longest even segment has 400 samples") as said:
        read_record(path)
    found = re.search(r"use begin (\S+) end (\S+), or", str(said.value))
    assert found
    begin, end = map(float, found.groups())
    assert (begin, end) == pytest.approx((0.5, 2.5), abs=0.01)
    np.testing.assert_allclose(read_record(path, begin=begin, end=end).values, RATES * DEG)


def test_another_unit_than_the_files_is_noted_and_counts(tmp_path: Path) -> None:
    path = written(tmp_path / "a.csv", ["x (rad/s)", *map(repr, RATES.tolist())])
    assert read_record(path, rate=1.0).note == "the unit is rad/s, from the file"
    record = read_record(path, rate=1.0, unit="deg/s")
    assert record.note == "the file names rad/s, but unit is deg/s"
    np.testing.assert_allclose(record.values, RATES * DEG)


def test_counts_are_scaled_and_increments_are_over_the_interval(tmp_path: Path) -> None:
    path = written(tmp_path / "a.csv", [repr(value) for value in RATES.tolist()])
    np.testing.assert_allclose(read_record(path, rate=50.0, scale=1 / 131).values, RATES / 131 * DEG)
    angles = read_record(path, rate=50.0, increments=True)
    np.testing.assert_allclose(angles.values, RATES * 50 * DEG)
    assumed = "column 1 has no unit; deg/s is assumed"
    assert angles.note == f"{assumed}; each sample is an angle increment in deg over 0.02 s"


# -- Layouts of public files ---------------------------------------------------------------------------------

ROWS = [(0.01 * i, *np.round(np.random.default_rng(i).normal(size=3), 5)) for i in range(30)]


def table(separator: str = ",", decimal: str = ".", end: str = "", first: str = "", form: str = "{:.5f}") -> str:
    lines = (separator.join(form.format(each) for each in row) for row in ROWS)
    return "".join(f"{first}{line.replace('.', decimal)}{end}\n" for line in lines)


NAMES = "t,gx,gy,gz\n"
LAYOUTS: dict[str, tuple[str, dict[str, Any]]] = {
    "commas": (NAMES + table(), {}),
    "no names": (table(), {"time": "#1", "columns": ("2", "3", "4")}),
    "blanks": (table("  "), {"time": "1", "columns": ("2", "3", "4")}),
    "blanks in front": (table("   ", first="  ", form="{:e}"), {"time": "#1", "columns": ("#2", "#3", "#4")}),
    "tabs and blanks": ("t gx gy gz\n" + table(" \t"), {}),
    "names apart by blanks": ("t   gx   gy   gz\n" + table("   "), {}),
    "// above tabs": ("// General\n// DeviceId: 0\nt\tgx\tgy\tgz\n" + table("\t"), {}),
    "% of MATLAB": ("% t, gx, gy, gz\n" + table(), {}),
    "# of numpy.savetxt": ("# t gx gy gz\n" + table(" ", form="{:.18e}"), {}),
    "%time of rostopic": ("%time,gx,gy,gz\n" + table(), {}),
    "free text": ("Logger 3.1\nDate: 2026-01-01 10:00\nSerial no.; 17\n\n" + NAMES + table(), {}),
    "units below the names": ("t,gx,gy,gz\n[s],[deg/s],[deg/s],[deg/s]\n" + table(), {}),
    "units below, bare": ("t;gx;gy;gz\ns;deg/s;deg/s;deg/s\n" + table(";"), {}),
    "semicolons": ("t;gx;gy;gz\n" + table(";"), {}),
    "decimal commas": ("t;gx;gy;gz\n" + table(";", decimal=","), {}),
    "decimal commas and tabs": ("t\tgx\tgy\tgz\n" + table("\t", decimal=","), {}),
    "decimal commas and blanks": ("t gx gy gz\n" + table("  ", decimal=","), {}),
    "bars": ("t|gx|gy|gz\n" + table("|"), {}),
    "a comma at the end of rows": (NAMES + table(end=","), {}),
    "a comma at the end of all lines": ("t,gx,gy,gz,\n" + table(end=","), {}),
    "quoted names": ('"t","gx","gy","gz"\n' + table(), {}),
    "quotes around numbers": (NAMES + table('","', first='"', end='"'), {}),
    "Windows": ((NAMES + table()).replace("\n", "\r\n"), {}),
    "old Macs": ((NAMES + table()).replace("\n", "\r"), {}),
    "a byte order mark": ("\ufeff" + NAMES + table(), {}),
    "a cut last row": (NAMES + table() + "0.30,1.2", {}),
    "no line end": ((NAMES + table())[:-1], {}),
    "names twice": ("t,g,g,g\n" + table(), {"columns": ("#2", "#3", "#4")}),
    "a column of words": (
        "t,gx,gy,gz,state\n" + table(end=",ok"),
        {"columns": ("gx", "gy", "gz")},
    ),
    "rows of other sensors": (
        NAMES + "".join(f"{line}\n{line.split(',')[0]},,,\n" for line in table().split()),
        {"skip_empty": True},
    ),
}


@pytest.mark.parametrize("kind", LAYOUTS)
def test_a_layout_of_loggers_is_read(tmp_path: Path, kind: str) -> None:
    text, options = LAYOUTS[kind]
    path = tmp_path / "a.txt"
    path.write_text(text, encoding="utf-8", newline="")
    record = read(path, Options(**{"columns": ("gx", "gy", "gz"), **options}))
    np.testing.assert_allclose(record.values, np.array(ROWS)[:, 1:].T * DEG, rtol=1e-12)
    assert record.interval == pytest.approx(0.01)
    notes = [note for note in record.notes if "has no unit" not in note]
    assert len(notes) == (kind in ("a cut last row", "rows of other sensors"))


def test_files_of_other_encodings_and_kinds_are_read(tmp_path: Path) -> None:
    text, values = NAMES + table(), np.array(ROWS)
    expected = values[:, 1:].T * DEG
    for name in ("utf-16", "utf-16-le", "utf-16-be"):
        (tmp_path / name).write_bytes(text.encode(name))
    for name, opener in (("gzip", gzip.open), ("bz2", bz2.open), ("xz", lzma.open)):
        with opener(tmp_path / name, "wb") as file:
            file.write(text.encode())
    with gzip.open(tmp_path / "gzip of blanks", "wb") as file:
        file.write(("t gx gy gz\n" + table("  ")).encode())
    fields = [(name, float) for name in ("t", "gx", "gy", "gz")]
    np.save(tmp_path / "named.npy", np.array([tuple(row) for row in ROWS], dtype=fields))
    scipy.io.savemat(
        tmp_path / "a.mat", {"t": values[:, 0], "gx": values[:, 1], "gy": values[:, 2], "gz": values[:, 3]}
    )
    columns = {name: values[:, i] for i, (name, _) in enumerate(fields)}
    pyarrow.parquet.write_table(pa.table(columns), tmp_path / "a.parquet")
    for path in sorted(tmp_path.iterdir()):
        record = read(path, Options(columns=("gx", "gy", "gz")))
        np.testing.assert_allclose(record.values, expected, rtol=1e-12, err_msg=path.name)
    np.save(tmp_path / "plain.npy", values)
    scipy.io.savemat(tmp_path / "matrix.mat", {"imu": values})
    for name, first in (("plain.npy", "2"), ("matrix.mat", "imu.2")):
        record = read(tmp_path / name, Options(columns=(first,), time="#1"))
        np.testing.assert_allclose(record.values, expected[:1], rtol=1e-12)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"PK\x03\x04rest", "is a zip archive or a spreadsheet: save its table as CSV"),
        (b"\x89HDF\r\n\x1a\n", "is an HDF5 file, as MATLAB writes with -v7.3"),
        (b"SQLite format 3\0", "is an SQLite database, as of ROS 2"),
        (b"#ROSBAG V2.0\n", "is a ROS bag"),
        (b'{"gx": [1, 2]}', "is JSON"),
        (b"<html></html>", "is XML or HTML"),
        (b"\x93NUMPY\x01\x00broken", "is a NumPy array that cannot be read"),
        (b"PAR1broken", "is a Parquet file that cannot be read"),
        (b"\x1f\x8bbroken", "cannot be unpacked"),
        (bytes(range(256)) * 9, "is not a supported file"),
        (b"lorem ipsum\ndolor sit amet\n" * 9, "has no rows of numbers"),
        (b"", "has 0 rows: it must have at least 20"),
    ],
)
def test_what_is_no_table_is_named(tmp_path: Path, content: bytes, said: str) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes(content)
    with pytest.raises(ValueError, match=re.escape(said)) as error:
        read_record(path, rate=100.0)
    assert str(error.value).startswith(str(path))
    assert str(error.value).isprintable()


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
    assert sorted(path.name for path in out.iterdir()) == ["allan.json", "allan.svg", "report.html", "series.svg"]
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
    assert "it already exists" in sentence(again)
    table = run("allan", tmp_path / "gyro.csv", "--rate", "10").stdout
    assert "z: 100000 samples in deg/s at 10 Hz" in table
    assert "Angle random walk" in table


GOOD = ["time,x,y", *numbered()]
X: dict[str, Any] = {"columns": ("x",)}


@pytest.mark.parametrize(
    ("lines", "options", "expected"),
    [
        (GOOD, {}, "--column is needed: it must be one of the columns of {path}: x, y"),
        (GOOD, {"columns": ("z",)}, "--column is 'z': it must be one of the columns of {path}: x, y"),
        (GOOD, {"columns": ("#4",)}, "--column is '#4': it must be one of the columns of {path}: x, y"),
        (GOOD, {"columns": ("x", "#2")}, "--column is '#2' twice: columns must be different"),
        (
            GOOD,
            {"columns": ("time",)},
            "--column is 'time', which is the time: it must be one of the columns of {path}: x, y",
        ),
        (GOOD, {**X, "time": "u"}, "--time is 'u': it must be one of the columns of {path}: time, x, y"),
        (
            GOOD,
            {**X, "rate": 50.0},
            "--rate is 50: it must agree within 5 % with time in {path}, whose samples are 0.01 apart in an unnamed "
            "unit; rename that column if it is not the time",
        ),
        (
            ["time [s],x,y", *numbered()],
            {**X, "rate": 106.0},
            "--rate is 106: it must agree within 5 % with time [s] in {path}, whose samples are at 100 Hz; rename "
            "that column if it is not the time",
        ),
        (
            GOOD,
            {**X, "unit": "m/s"},
            "--unit is 'm/s': it must be one of deg/s, rad/s, deg/h, mdeg/s, mrad/s, urad/s, arcsec/s, rpm",
        ),
        (GOOD, {**X, "time_unit": "h"}, "--time-unit is 'h': it must be one of s, ms, us, ns"),
        (GOOD, {**X, "rate": 0.0}, "--rate is 0.0: it must be greater than 0"),
        (GOOD, {**X, "scale": 0.0}, "--scale is 0: it must not be 0"),
        (GOOD, {**X, "begin": -1.0}, "--from is -1.0: it must be at least 0"),
        (GOOD, {**X, "begin": 2.0, "end": 1.0}, "--to is 1.0: it must be greater than 2"),
        (GOOD, {**X, "begin": 3.9}, "{path} has 10 rows from 3.9 s to the end: it must have at least 20"),
        (GOOD, {**X, "end": 0.1}, "{path} has 10 rows from 0 s to 0.1 s: it must have at least 20"),
        (GOOD[:15], X, "{path} has 14 rows: it must have at least 20"),
        (
            ["time,x,y"],
            X,
            "{path} has no rows of numbers: it must be a table with columns separated by commas, semicolons, tabs "
            "or blanks",
        ),
        ([], {"rate": 1.0}, "{path} has 0 rows: it must have at least 20"),
        (
            ["x", *map(str, RATES)],
            {},
            "--rate is needed, in Hz: {path} has no column called time, timestamp or t, as in time [ns]",
        ),
        (["x", *["1.5"] * 50], {"rate": 1.0}, "{path}: x is 1.5 in every row: it must vary"),
        (
            ["x,x", *["1,2"] * 50],
            {**X, "rate": 1.0},
            "--column is 'x': {path} has 2 columns of that name; use a number, #1, #2",
        ),
        ([*GOOD[:30], "0.3,abc,1", *GOOD[30:]], X, "{path}, line 31: x is 'abc': it must be a finite number"),
        (
            [*GOOD[:30], "0.3,,1", *GOOD[30:]],
            X,
            "{path}, line 31: x is empty or not a number: it must be a finite number",
        ),
        (
            [*GOOD[:30], *["0.3,nan,1", "0.3,,1"] * 60, *GOOD[30:]],
            X,
            "{path}, line 31: x is empty or not a number: it must be a finite number; --skip-empty excludes such rows, "
            "of which there are 120",
        ),
        ([*GOOD[:30], "0.3,-inf,1", *GOOD[30:]], X, "{path}, line 31: x is infinite: it must be a finite number"),
        ([*GOOD[:30], "0.3,1", *GOOD[30:]], X, "{path}, line 31: it has 2 columns: it must have 3"),
        (
            ["x [deg/s],y [rad/s]", *["1,2", "2,1"] * 20],
            {"columns": ("#1", "#2"), "rate": 1.0},
            "--unit is needed: the columns are in deg/s, rad/s",
        ),
        (
            [*GOOD[:30], *GOOD[31:]],
            X,
            "{path}: time has a gap at line 31; 1 sample is missing: times must increase evenly. The longest even "
            "segment has 370 samples: use --from 0.3 --to 4, or override the times with --rate",
        ),
        (
            ["time [week],x", *numbered()],
            {"columns": ("x",), "time": "time [week]"},
            "{path}: time [week] is in week, which is not a known unit of time: give --time-unit, one of s, ms, us, "
            "ns, or --rate",
        ),
        (
            ["x [LSB]", *map(str, RATES)],
            {"rate": 1.0},
            "{path}: x [LSB] is in LSB, which is not a known unit of rate: give --unit, one of deg/s, rad/s, deg/h, "
            "mdeg/s, mrad/s, urad/s, arcsec/s, rpm, and for counts --scale.",
        ),
        (
            ["x [rad]", *map(str, RATES)],
            {"rate": 1.0},
            "{path}: x [rad] is in rad, which is not a known unit of rate: give --unit, one of deg/s, rad/s, deg/h, "
            "mdeg/s, mrad/s, urad/s, arcsec/s, rpm, and for counts --scale. Angle increments also need "
            "--increments.",
        ),
        (
            ["x", *map(str, RATES), "1e300"],
            {"rate": 1.0},
            "{path}, line 402: x is 1e+300: as a rate it must be below 5.73e+07 deg/s",
        ),
        (
            ["time,x", *["0.0,1", "0.0,2"] * 20],
            {},
            "{path}: time does not increase: it must increase, or give --rate",
        ),
    ],
)
def test_what_is_no_record_is_refused_in_one_sentence_and_nothing_is_written(
    tmp_path: Path, lines: list[str], options: dict[str, Any], expected: str
) -> None:
    path = written(tmp_path / "a.csv", lines) if lines else tmp_path / "a.csv"
    path.touch()
    with pytest.raises(ValueError, match=r"\A") as said:
        analyze_series([path], tmp_path / "out", Options(**options, dashes="--"))
    assert str(said.value) == expected.format(path=path)
    assert [each.name for each in tmp_path.iterdir()] == ["a.csv"]


def test_a_file_that_cannot_be_read_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"none\.csv cannot be read: No such file or directory"):
        analyze_record(tmp_path / "none.csv", rate=1.0)
    with pytest.raises(ValueError, match="cannot be read: Is a directory"):
        analyze_record(tmp_path, rate=1.0)
    (tmp_path / "picture.csv").write_bytes(bytes(range(256)) * 1000)
    with pytest.raises(ValueError, match=r"picture\.csv"):
        analyze_record(tmp_path / "picture.csv", rate=1.0)


def test_a_line_of_a_later_block_is_named(tmp_path: Path) -> None:
    rows = ["x", *["1.000000"] * 600_000, "bad", "2.0"]  # more than 4 MiB
    with pytest.raises(ValueError, match="line 600002: x is 'bad'"):
        read_record(written(tmp_path / "a.csv", rows), rate=1.0)


# -- The sample records of docs/record.md --------------------------------------------------------------------


@pytest.mark.parametrize(("name", "options"), [("still", {}), ("warm_up", {}), ("knock", {"begin": 610.0})])
def test_the_sample_records_show_what_they_were_made_of(name: str, options: dict[str, Any]) -> None:
    figures, content = analyze_record(ROOT / f"examples/records/{name}.csv", **options)
    n, b, k = figures[:3]
    assert n.low < 0.3 < n.high
    assert n.high - n.low < 0.03 * n.value
    assert b.high > 4.0
    assert k.high > 12.0
    assert [event["kind"] for event in content["events"]] == (["drift"] if name == "warm_up" else [])


def test_the_knock_of_the_sample_record_is_found() -> None:
    figures, content = analyze_record(ROOT / "examples/records/knock.csv")
    assert content["events"][0]["sentence"].startswith("10 samples from 600 to 601.1 s are outliers, by up to")
    assert all(math.isnan(figure.low) and figure.grade is None for figure in figures)


def test_the_report_is_accessible_and_fits(browser: Any, tmp_path: Path) -> None:
    record = Path(__file__).resolve().parents[2] / "examples/records/still.csv"
    done = run("allan", record, "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    assert faults_of_report(browser, tmp_path / "out/report.html") == []


def test_three_axes_make_one_report(tmp_path: Path) -> None:
    path = written(tmp_path / "a.csv", ["time [s],x,y,z", *(f"{row},1.{i % 7}" for i, row in enumerate(numbered()))])
    _, content = analyze_record(path, tmp_path / "out", column=["x", "y", "z"], imu="kalibr")
    assert [each["column"] for each in content["series"]] == ["x", "y", "z"]
    assert (tmp_path / "out" / "imu.yaml").is_file()
    text = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert text.count('<h2 id="column') == 3
    assert sorted(each.name for each in (tmp_path / "out").glob("*.svg")) == [
        f"{kind}-{i}.svg" for kind in ("allan", "series") for i in (1, 2, 3)
    ]
    with pytest.raises(ValueError, match="imu requires out, the folder"):
        analyze_record(path, column="x", imu="kalibr")
