"""The documents say what is so: identifiers, defaults and links exist, versions agree, examples run."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import unquote

import fracgyro as fg
import pytest
from fracgyro.table import toml_value
from fracgyro.tables import ERRATA_SWITCHES

ROOT = Path(__file__).resolve().parents[2]
GENERATED = {"build", "out", "node_modules"}
DOCUMENTS = sorted(
    path
    for path in ROOT.rglob("*.md")
    if not any(part.startswith(".") or part in GENERATED for part in path.relative_to(ROOT).parts)
)


def read(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def blocks(text: str, language: str) -> list[str]:
    """The contents of every block fenced as ```language."""
    return re.findall(rf"^```{language}\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)


def unfenced(text: str) -> str:
    return re.sub(r"^```.*?^```$", "", text, flags=re.DOTALL | re.MULTILINE)


# -- EQUATIONS.md --------------------------------------------------------------------------------------------


def cited() -> list[tuple[str, str]]:
    return sorted(set(re.findall(r"`([\w./]+\.(?:hpp|cpp|py))::(\w+)`", read("EQUATIONS.md"))))


@pytest.mark.parametrize(("file", "identifier"), cited())
def test_every_identifier_of_the_equations_exists_in_its_file(file: str, identifier: str) -> None:
    found = [path for folder in ("core", "sim", "python") for path in (ROOT / folder).rglob(file)]
    assert len(found) == 1, f"{file} must name one file"
    comment = "#" if found[0].suffix == ".py" else "//"
    code = re.sub(rf"{comment}.*", "", found[0].read_text(encoding="utf-8"))
    assert re.search(rf"\b{identifier}\b", code)


def parameters() -> Iterator[tuple[str, str]]:
    """(field, default) of every row of the tables of parameters."""
    for row in re.findall(r"^\|(.*)\|$", read("EQUATIONS.md"), re.MULTILINE):
        cells = [cell.strip() for cell in re.split(r"(?<!\\)\|", row)]
        if len(cells) == 6 and re.fullmatch(r"`[a-z]+\.[a-z_]+`", cells[3]):
            yield cells[3].strip("`"), cells[4].strip("`")


@pytest.mark.parametrize(("field", "default"), list(parameters()))
def test_every_default_of_the_equations_is_that_of_the_scenario(field: str, default: str) -> None:
    table, name = field.split(".")
    value = getattr(getattr(fg.Scenario(), table), name)
    assert default == ("–" if value is None else toml_value(value))


def test_the_equations_list_every_physical_parameter_and_every_switch() -> None:
    fields = {
        f"{table}.{name}"
        for table, model in fg.Scenario()
        for name in type(model).model_fields
        if f"{table}.{name}" not in {"run.record_every", "run.units"}  # bookkeeping
    }
    assert {field for field, _ in parameters()} == fields
    errata = read("EQUATIONS.md").split("## Printed and corrected")[1]
    for switch in ERRATA_SWITCHES:
        assert f"| `{switch}` |" in errata


# -- Versions ------------------------------------------------------------------------------------------------


def test_the_versions_agree() -> None:
    version = tomllib.loads(read("pyproject.toml"))["project"]["version"]
    assert re.findall(r"^version: (.*)$", read("CITATION.cff"), re.MULTILINE) == [version]
    sections = re.findall(r"^## \[([^\]]+)\]", read("CHANGELOG.md"), re.MULTILINE)
    released = [section for section in sections if section != "Unreleased"]
    assert sections, "CHANGELOG.md has no section"
    assert released[:1] in ([], [version])


# -- Links ---------------------------------------------------------------------------------------------------


def anchors(path: Path) -> set[str]:
    """As GitHub makes them from headings."""
    headings = re.findall(r"^#+ (.*)$", unfenced(path.read_text(encoding="utf-8")), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_every_relative_link_resolves(path: Path) -> None:
    text = re.sub(r"`[^`\n]*`", "", unfenced(path.read_text(encoding="utf-8")))
    links = re.findall(r"\]\(\s*<?([^)\s>]+)", text) + re.findall(r"^\[[^\]]+\]:\s*(\S+)", text, re.MULTILINE)
    links += re.findall(r"(?:src|href)=\"([^\"]+)\"", text)
    for link in links:
        if re.match(r"[a-z]+:", link):
            continue
        target, _, anchor = unquote(link).partition("#")
        found = path.parent / target if target else path
        assert found.exists(), link
        if anchor and found.suffix == ".md":
            assert anchor in anchors(found), link


# -- Examples ------------------------------------------------------------------------------------------------


def test_the_python_of_the_readme_runs(tmp_path: Path) -> None:
    code = "\n".join(blocks(read("README.md"), "python"))
    assert code, "README.md has no Python"
    ran = subprocess.run(
        [sys.executable, "-W", "error", "-W", "default::DeprecationWarning", "-c", code],
        cwd=tmp_path,
        env={**os.environ, "MPLBACKEND": "Agg"},
        capture_output=True,
        text=True,
    )
    assert ran.returncode == 0, ran.stderr


@pytest.mark.parametrize("diff", blocks(read("CONTRIBUTING.md"), "diff"))
def test_the_lines_that_the_worked_example_changes_still_stand(diff: str) -> None:
    header, *lines = diff.splitlines()
    before = "\n".join(line[1:] for line in lines if not line.startswith("+"))
    assert read(header.removeprefix("--- ")).count(f"{before}\n") == 1
