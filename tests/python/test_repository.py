"""What is said of a release in several places agrees, and scenario files of released versions can be loaded."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import fracgyro as fg
import pytest

ROOT = Path(__file__).resolve().parents[2]
VERSION = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
SCENARIOS = ROOT / "tests/data"


def read(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def test_the_version_and_its_date_are_the_same_everywhere() -> None:
    releases = re.findall(r"^## \[(\d[^\]]*)\] - (\S+)$", read("CHANGELOG.md"), re.MULTILINE)
    cited = re.search(r'^version: (\S+)\ndate-released: "(\S+)"$', read("CITATION.cff"), re.MULTILINE)
    assert cited is not None
    assert cited.groups() == releases[0]
    assert cited[1] == VERSION
    links = re.findall(r"^\[(\d[^\]]*)\]: ", read("CHANGELOG.md"), re.MULTILINE)
    assert links == [version for version, _ in releases]


def test_every_release_has_left_a_scenario_file() -> None:
    releases = re.findall(r"^## \[(\d[^\]]*)\]", read("CHANGELOG.md"), re.MULTILINE)
    assert {path.name for path in SCENARIOS.iterdir()} == {f"scenario-{version}.toml" for version in releases}


@pytest.mark.parametrize("path", sorted(SCENARIOS.glob("scenario-*.toml")), ids=lambda path: path.stem)
def test_a_scenario_file_of_a_release_loads_with_every_value_in_it(path: Path) -> None:
    loaded = fg.Scenario.load(path).model_dump()
    for table, fields in tomllib.loads(path.read_text(encoding="utf-8")).items():
        for field, value in fields.items():
            found = loaded[table][field]
            assert (list(found) if isinstance(found, tuple) else found) == value, f"{table}.{field}"
