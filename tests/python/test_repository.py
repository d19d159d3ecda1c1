"""Repository files: one version everywhere, scenario files of releases, GitHub's files, the lock file."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tomllib
from importlib.util import find_spec
from pathlib import Path

import fracgyro as fg
import pytest
import yaml
from children import PATIENCE
from embedded import STRICT
from packaging.requirements import Requirement

ROOT = Path(__file__).resolve().parents[2]
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
SCENARIOS = ROOT / "tests/data"


def read(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def test_the_version_and_its_date_are_the_same_everywhere() -> None:
    releases = re.findall(r"^## \[(\d[^\]]*)\] - (\S+)$", read("CHANGELOG.md"), re.MULTILINE)
    cited = re.search(r'^version: (\S+)\ndate-released: "(\S+)"$', read("CITATION.cff"), re.MULTILINE)
    assert cited is not None
    assert cited.groups() == releases[0]
    assert cited[1] == PYPROJECT["project"]["version"]
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


# -- GitHub --------------------------------------------------------------------------------------------------

WORKFLOWS = sorted((ROOT / ".github/workflows").glob("*.yml"))
FORMS = {path.name: path for path in (ROOT / ".github/ISSUE_TEMPLATE").glob("*.yml")}
SCHEMAS = {
    "github-workflows": WORKFLOWS,
    "github-issue-forms": [path for name, path in FORMS.items() if name != "config.yml"],
    "github-issue-config": [FORMS["config.yml"]],
    "citation-file-format": [ROOT / "CITATION.cff"],
}
ACTIONLINT = "github.com/rhysd/actionlint/cmd/actionlint@v1.7.12"


@pytest.mark.parametrize("schema", SCHEMAS)
def test_what_github_reads_is_valid(schema: str) -> None:
    assert SCHEMAS[schema]
    if find_spec("check_jsonschema") is None and not STRICT:
        pytest.skip("check-jsonschema is missing")
    words = ["-m", "check_jsonschema", "--builtin-schema", f"vendor.{schema}"]
    ran = subprocess.run([sys.executable, *words, *SCHEMAS[schema]], capture_output=True, text=True, timeout=PATIENCE)
    assert ran.returncode == 0, ran.stdout + ran.stderr


@pytest.mark.nightly  # compiles it
def test_actionlint_has_no_complaint() -> None:
    """Skipped without Go or, on first use, the network, even if nothing may be skipped."""
    if shutil.which("go") is None:
        pytest.skip("go is missing")
    got = subprocess.run(["go", "run", ACTIONLINT, "-version"], capture_output=True, text=True, timeout=PATIENCE)
    if got.returncode != 0:
        pytest.skip(f"actionlint cannot be had: {got.stderr.strip().splitlines()[-1:]}")
    words = ["-shellcheck=", "-pyflakes=", *map(str, WORKFLOWS)]  # without optional tools of the machine
    ran = subprocess.run(["go", "run", ACTIONLINT, *words], capture_output=True, text=True, timeout=PATIENCE)
    assert ran.returncode == 0, ran.stdout + ran.stderr


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.stem)
def test_a_workflow_runs_only_pinned_actions_and_may_write_only_to_publish(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    uses = re.findall(r"uses: (.*)", text)
    assert uses
    for action in uses:
        assert re.fullmatch(r"[\w./-]+@[0-9a-f]{40} # v[\d.]+", action), action
    workflow = yaml.safe_load(text)
    assert workflow["permissions"] == {"contents": "read"}
    for name, job in workflow["jobs"].items():
        writes = "id-token" in job.get("permissions", {})
        assert writes == (name in {"deploy", "publish"}), name
        assert "timeout-minutes" in job, name
    assert len({action.split()[0] for action in uses}) == len({action.split("@")[0] for action in uses})


def test_the_pythons_are_the_same_everywhere() -> None:
    project = PYPROJECT["project"]
    pythons = [each.rpartition(" ")[2] for each in project["classifiers"] if ":: Python :: 3." in each]
    assert project["requires-python"] == f">={pythons[0]}"
    ci = yaml.safe_load(read(".github/workflows/ci.yml"))
    assert ci["jobs"]["pythons"]["strategy"]["matrix"]["python"] == pythons
    assert PYPROJECT["tool"]["cibuildwheel"]["build"] == [f"cp{python.replace('.', '')}-*" for python in pythons]


def test_every_wheel_is_asked_for_its_bits() -> None:
    jobs = yaml.safe_load(read(".github/workflows/release.yml"))["jobs"]
    assert jobs["bits"]["strategy"]["matrix"]["os"] == jobs["wheels"]["strategy"]["matrix"]["os"]
    assert {"sdist", "wheels", "bits"} == set(jobs["publish"]["needs"])


def test_hooks_before_a_commit_are_the_checks_of_make() -> None:
    """Each tool by the name that `make lint` and `make check` give it; versions are in pyproject.toml only."""
    recipes = dict(re.findall(r"^(lint|check): .*\n((?:\t.*\n)+)", read("Makefile"), re.MULTILINE))
    assert re.search(r"^check: lint\b", read("Makefile"), re.MULTILINE)
    hooks = yaml.safe_load(read(".pre-commit-config.yaml"))["repos"]
    assert [repo["repo"] for repo in hooks] == ["local"]
    tool = r"(?:\$\(BIN\)|\.venv/bin)/(ruff \w+|\S+)"
    entries = [re.findall(tool, hook["entry"]) for hook in hooks[0]["hooks"]]
    tools = [each for name in ("lint", "check") for each in re.findall(tool, recipes[name]) if each != "python"]
    assert [each for found in entries for each in found] == tools


# -- requirements.lock ---------------------------------------------------------------------------------------


def test_the_lock_meets_every_requirement_of_the_reproduction() -> None:
    locked = dict(re.findall(r"^([\w.-]+)==(\S+)", read("requirements.lock"), re.MULTILINE))
    project = PYPROJECT["project"]
    extras = project["optional-dependencies"]
    direct = [*project["dependencies"], *extras["netcdf"], *extras["report"], *PYPROJECT["build-system"]["requires"]]
    for requirement in map(Requirement, direct):
        assert requirement.specifier.contains(locked[requirement.name]), f"{requirement}: run `make lock`"


def test_the_lock_has_hashes_and_names_no_server() -> None:
    text = read("requirements.lock")
    entries = re.split(r"\n(?=\w)", text.rstrip())
    assert all("--hash=sha256:" in entry for entry in entries)
    assert "://" not in text
    assert "index" not in text


# -- paper.md ------------------------------------------------------------------------------------------------


def test_the_short_paper_has_the_sections_that_joss_asks_for_and_cites_what_its_list_has() -> None:
    text = read("paper.md")
    wanted = {"Summary", "Statement of need", "State of the field", "Software design", "Research impact"}
    assert wanted | {"AI usage disclosure", "References"} == set(re.findall(r"^# (.*)$", text, re.MULTILINE))
    keys = re.findall(r"^@\w+\{(\w+),$", read("paper.bib"), re.MULTILINE)
    assert len(keys) == len(set(keys)) > 5
    assert set(re.findall(r"@(\w+)", text.partition("# Summary")[2])) == set(keys)
    assert 250 < len(text.split()) < 1000  # JOSS: 250 to 1000 words
    assert yaml.safe_load(text.split("---")[1])["bibliography"] == "paper.bib"
