"""README.md and docs/: their measured numbers are those of the committed logs."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "benchmarks"))  # before docs/site, which has a module of the same name

import page_numbers  # noqa: E402
import pages  # noqa: E402

# Tables with numbers that nobody measured, by the start of their heading row.
EXEMPT = {
    ("README.md", "| target | command |"): "commands",
    ("docs/site/install.md", "| extra |"): "names of libraries",
    ("docs/site/install.md", "| target |"): "names and versions of tools",
    ("docs/fpga.md", "| `--number` |"): "definitions of the number types",
    ("docs/fpga.md", "| | per word |"): "the protocol of the ports, which a test of the simulated hardware keeps to",
}


@pytest.mark.parametrize("page", pages.PAGES)
def test_the_numbers_of_a_page_are_those_of_the_logs(page: str) -> None:
    assert pages.written(page) == (ROOT / page).read_text(encoding="utf-8"), "run `make pages`"


@pytest.mark.parametrize("page", pages.PAGES)
def test_a_table_with_numbers_is_written_by_the_program_or_exempt(page: str) -> None:
    for name, heading, rows in pages.tables(page):
        exempt = any(page == of and heading.startswith(start) for of, start in EXEMPT)
        typed = [row for row in rows if re.search(r"\d", row)]
        assert name or exempt or not typed, f"{page}: neither marked nor exempt:\n{typed[0]}"
        assert not (name and exempt)


def test_every_number_and_table_is_on_a_page() -> None:
    text = "".join((ROOT / page).read_text(encoding="utf-8") for page in pages.PAGES)
    assert set(re.findall(r"<!--([\w.]+)-->", text)) == set(page_numbers.NUMBERS)
    assert set(re.findall(r"<!-- table: (\w+) -->", text)) == set(page_numbers.TABLES)


def test_a_typed_number_is_replaced_by_that_of_the_log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pages, "ROOT", tmp_path)
    monkeypatch.setattr(page_numbers, "NUMBERS", {"speed": lambda: "1,234"})
    monkeypatch.setattr(page_numbers, "TABLES", {"speeds": lambda: [["a", "1"], ["b", "2"]]})
    head = "| | speed |\n|---|---|\n"
    page = tmp_path / "page.md"
    page.write_text(
        f"Takes (9.9<!--speed--> s).\n\n<!-- table: speeds -->\n{head}| a | 9 |\n\nEnd.\n", encoding="utf-8"
    )
    good = f"Takes (1,234<!--speed--> s).\n\n<!-- table: speeds -->\n{head}| a | 1 |\n| b | 2 |\n\nEnd.\n"
    assert pages.written("page.md") == good
    page.write_text("Takes 9.9<!--sped--> s.\n", encoding="utf-8")
    with pytest.raises(ValueError, match=r"page\.md marks sped: "):
        pages.written("page.md")


def test_only_paragraphs_with_a_line_that_is_too_long_are_filled_again() -> None:
    short = "Some words\nin two lines.\n\n- A point\n  of two lines.\n- Another\n"
    assert pages.filled(short) == short
    long = f"- A point of {'many ' * 30}words\n  and more.\n- Another\n"
    found = pages.filled(long)
    assert found.split() == long.split()
    assert max(map(len, found.splitlines())) <= 120
    assert [line[:2] for line in found.splitlines()] == ["- ", "  ", "- "]
    fenced = f"```sh\na\n{'b ' * 80}\n```\n| {'c ' * 80}|\n"
    assert pages.filled(fenced) == fenced


@pytest.mark.parametrize(
    ("cell", "expected"),
    [
        ("0.179 (-2.44 to 2.8)", "0 ± 3"),
        ("5270 (5270 to 5270)", "5,270"),
        ("20.2 (18.3 to 22.2)", "20 ± 2"),
        ("-125 (-140 to -110)", "−120 ± 20"),
        ("3.25 ± 0.04", "3.25 ± 0.04"),
    ],
)
def test_an_interval_is_rounded_to_its_first_digit(cell: str, expected: str) -> None:
    assert page_numbers.uncertain(cell) == expected
