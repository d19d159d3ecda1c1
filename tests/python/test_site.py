"""The documentation site: built without a warning, complete, with working links, running examples and usable pages.

The pictures of the gallery are left out here: test_gallery.py runs its scripts.
"""

from __future__ import annotations

import doctest
import inspect
import math
import os
import pathlib
import pkgutil
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import tomllib
import zlib
from collections.abc import Iterator
from functools import cache
from html.parser import HTMLParser
from importlib import import_module
from pathlib import Path
from runpy import run_path
from types import ModuleType
from typing import Any
from urllib.parse import quote, unquote, urljoin, urlsplit

import click
import fracgyro as fg
import fracgyro_fpga
import fracgyro_lab as lab
import numpy as np
import pytest
from browser import served, violations, watched
from children import PATIENCE
from fracgyro.cli import cli
from shared import live_page, shared

ROOT = Path(__file__).resolve().parents[2]
MAX_BYTES = 15e6


@pytest.fixture(scope="session")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return shared(tmp_path_factory, "site", make) / "html"


def make(folder: Path) -> None:
    words = ["-c", ROOT / "docs/site", "-W", "--keep-going", "-q", "-D", "plot_gallery=0", "-d", folder / "doctrees"]
    for command in (
        [ROOT / "docs/site/pages.py", folder / "source"],
        ["-m", "sphinx", *words, folder / "source", folder / "html"],
    ):
        ran = subprocess.run([sys.executable, *command], capture_output=True, text=True, timeout=PATIENCE)
        assert ran.returncode == 0, ran.stdout + ran.stderr


def test_the_site_is_made_without_a_warning_and_is_small(site: Path) -> None:
    assert (site / "index.html").is_file()
    assert sum(path.stat().st_size for path in site.rglob("*") if path.is_file()) < MAX_BYTES


# -- Names ---------------------------------------------------------------------------------------------------


def public(module: ModuleType, name: str = "fracgyro") -> Iterator[tuple[str, object]]:
    """Every public name below a module, with its object; modules themselves left out."""
    for each in module.__all__:
        found = getattr(module, each)
        if isinstance(found, ModuleType):
            yield from public(found, f"{name}.{each}")
        else:
            yield f"{name}.{each}", found


NAMES = dict(public(fg)) | dict(public(lab, "fracgyro_lab"))


def documented(site: Path) -> set[str]:
    """The names in the site's inventory."""
    content = (site / "objects.inv").read_bytes().split(b"\n", 4)[4]
    return {line.split(" ")[0] for line in zlib.decompress(content).decode().splitlines()}


def test_every_public_name_is_on_a_page(site: Path) -> None:
    assert len(NAMES) > 50
    assert NAMES.keys() - documented(site) == set()


def test_the_examples_of_the_reference_do_as_they_say(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    names = {"fg": fg, "lab": lab, "np": np, "math": math, "os": os, "pathlib": pathlib, "tempfile": tempfile}
    finder, runner = doctest.DocTestFinder(), doctest.DocTestRunner(optionflags=doctest.ELLIPSIS)
    wrong: list[str] = []
    for package in (fg, lab, fracgyro_fpga):
        for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            if not module.name.endswith("__main__"):
                for example in finder.find(import_module(module.name), globs=dict(names)):
                    runner.run(example, out=wrong.append)
    assert "".join(wrong) == ""
    assert runner.summarize(verbose=False).attempted > 200


def returned(function: object) -> set[str]:
    """The names in the return annotation of a function."""
    said = inspect.signature(function).return_annotation if inspect.isfunction(function) else ""
    return set(re.findall(r"\w+", said if isinstance(said, str) else ""))


def test_every_public_function_and_class_has_an_example() -> None:
    """Except types returned by functions, and types within them: the examples of the functions show these."""
    results = set().union(*map(returned, NAMES.values()))
    fields = [inspect.get_annotations(found) for name, found in NAMES.items() if name.rpartition(".")[2] in results]
    results |= set(re.findall(r"\w+", " ".join(str(said) for each in fields for said in each.values())))
    without = [name for name, found in NAMES.items() if ">>>" not in (inspect.getdoc(found) or "")]
    assert [name for name in without if name.rpartition(".")[2] not in results] == []


# -- Links ---------------------------------------------------------------------------------------------------


class Page(HTMLParser):
    """Links of a page, and link targets in it."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.links: list[str] = []
        self.ids: set[str] = set()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        for name, value in attributes:
            if name in ("href", "src") and value is not None:
                self.links.append(value)
            elif name == "id" and value:
                self.ids.add(value)


def test_every_link_within_the_site_leads_somewhere(site: Path) -> None:
    parsed = cache(Page)
    dead = []
    for path in sorted(site.rglob("*.html")):
        for link in parsed(path).links:
            parts = urlsplit(link)
            if parts.scheme or parts.path == "live/index.html":  # which only `make docs` puts there
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            alive = target.is_file()
            if alive and parts.fragment and target.suffix == ".html":
                alive = unquote(parts.fragment) in parsed(target).ids
            if not alive:
                dead.append(f"{path.relative_to(site)}: {link}")
    assert dead == []


# -- In a browser --------------------------------------------------------------------------------------------

SEEN = 3  # results of a search that a visitor looks at
WIDE = "Math.max(document.scrollingElement.scrollWidth, document.querySelector('article').scrollWidth)"
LOOKED_AT = [
    "index",
    "tour/1-simulate",
    "gallery/index",
    "reference/scenario",
    "reference/python/runs",
    "controllers/linear",
]


@pytest.fixture(scope="session")
def whole(site: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site with the live page."""
    shutil.copytree(live_page(tmp_path_factory), site / "live", dirs_exist_ok=True)
    return site


@pytest.mark.parametrize(("scheme", "width"), [("light", 1280), ("dark", 360)])
def test_pages_are_quiet_fit_and_accessible(whole: Path, browser: Any, scheme: str, width: int) -> None:
    """No console message, no external request, nothing wider than the window, no serious violation."""
    size = {"width": width, "height": 800}
    with served(whole) as address, browser.new_page(viewport=size, color_scheme=scheme) as page:
        faults = watched(page, address)
        for name in LOOKED_AT:
            page.goto(urljoin(address, f"{name}.html"), wait_until="load")
            wide = page.evaluate(WIDE)
            faults += [f"{name}: {wide} wide"] if wide > width else []
            faults += [f"{name}: {each}" for each in violations(page, ("serious", "critical"))]
    assert faults == []


def test_a_line_that_begins_with_a_percent_sign_is_no_comment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(ROOT / "docs/site")
    gathered = run_path(str(ROOT / "docs/site/pages.py"))["Gathered"](tmp_path)
    text = "95\n% of\n\n- 2\n  % more\n```\n% code\n```"
    found = list(gathered.linked(text, ROOT / "docs/x.md", "x"))
    assert found == ["95", "\\% of", "", "- 2", "  \\% more", "```", "% code", "```"]


def test_the_first_page_runs_the_live_page(whole: Path, browser: Any) -> None:
    with served(whole) as address, browser.new_page() as page:
        page.goto(urljoin(address, "index.html"))
        page.locator("iframe.live-page").scroll_into_view_if_needed()
        clock = page.frame_locator("iframe.live-page").locator("#clock")
        clock.get_by_text(re.compile(r"^t = [1-9]")).wait_for()  # it plays by itself


@pytest.mark.parametrize(
    ("words", "wanted"),
    [
        ("voltage", "how-to/units"),
        ("step reference", "how-to/references"),
        ("allan deviation", "understand/rate-sensor"),
        ("simulink", "how-to/fmu"),
        ("noise density", "how-to/data-sheet"),
    ],
)
def test_the_search_answers(site: Path, browser: Any, words: str, wanted: str) -> None:
    with served(site) as address, browser.new_page() as page:
        page.goto(urljoin(address, f"search.html?q={quote(words)}"))
        page.locator("#search-results li a").first.wait_for()
        page.wait_for_function("document.querySelector('.search-summary').textContent.includes('found')")
        found = page.locator("#search-results li > a").evaluate_all("links => links.map(each => each.href)")
    assert f"{wanted}.html" in " ".join(urlsplit(each).path for each in found[:SEEN])


def test_the_scenario_reference_shows_the_fields_of_a_kind(site: Path, browser: Any) -> None:
    with served(site) as address, browser.new_page() as page:
        page.goto(urljoin(address, "reference/scenario.html"))

        def shown(field: str) -> bool:
            return bool(page.get_by_text(field, exact=True).first.is_visible())

        fields = ("controller.natural_frequency", "controller.twisting_gain", "controller.force_limit")
        assert [shown(each) for each in fields] == [True, True, True]
        choice = page.locator("#controller select")
        choice.select_option("pid")
        assert [shown(each) for each in fields] == [True, False, True]
        choice.select_option("")
        assert [shown(each) for each in fields] == [True, True, True]


def test_a_link_to_a_name_in_the_code_leads_to_its_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(ROOT / "docs/site")
    gathered = run_path(str(ROOT / "docs/site/pages.py"))["Gathered"](tmp_path)
    text = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
    links = re.findall(r"\]\((include/[\w/]+\.hpp)#(\w+)\)", text)
    assert len(links) >= 8
    for file, name in links:
        line = gathered.target(f"{file}#{name}", ROOT / "ARCHITECTURE.md", "x").rpartition("#L")[2]
        assert re.search(rf"\b{name}\b", (ROOT / file).read_text(encoding="utf-8").splitlines()[int(line) - 1])
    with pytest.raises(ValueError, match=r"error\.hpp does not define no_name"):
        gathered.target("include/fracgyro/control/error.hpp#no_name", ROOT / "ARCHITECTURE.md", "x")


# -- Command line ------------------------------------------------------------------------------------------------------


def command_names(group: click.Group, context: click.Context, before: str = "") -> Iterator[str]:
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        if isinstance(command, click.Group):
            yield from command_names(command, context, f"{name} ")
        else:
            yield before + name


def test_every_command_has_examples_that_it_understands() -> None:
    examples = tomllib.loads((ROOT / "docs/site/examples.toml").read_text(encoding="utf-8"))
    assert set(examples) == set(command_names(cli, click.Context(cli)))
    for name, lines in examples.items():
        assert any(line.startswith(f"fracgyro {name}") for line in lines)
        for line in lines:
            words = shlex.split(line.partition(" > ")[0])[1:]
            found: click.Command | None = cli
            while isinstance(found, click.Group):
                found = found.get_command(click.Context(found), words.pop(0))
            assert found is not None
            found.make_context(name, words)  # raises an error if an option is wrong or one is missing


# -- First words -----------------------------------------------------------------------------------------------------

FIRST = 40  # words
# Logs and decisions, whose form is their own, and pages that begin with two sentences of their own form.
OWN_FORM = re.compile(r"(measured|decisions)/(?!index)|understand/best-order|reference/firmware-measured|gallery/|sg_")
NO_PROSE = ("|", "#", "```", "- ", "* ", "![", "<", "{", ":::", "    ", "Made by", "Generated by", "You need")


def faults_of_the_opening(text: str, needs_title: bool) -> list[str]:
    """Checks that the first paragraph of a page is prose, with a word of the title, and soon ends a sentence."""
    found = re.search(r"^# (.*)\n+((?:.+\n)*)", text, re.MULTILINE)
    assert found is not None
    title, paragraph = found[1].lower(), found[2].replace("\n", " ")
    first = " ".join(paragraph.split()[:FIRST])
    subjects = {word[:4] for word in re.findall(r"\w{4,}", title)} - {"your", "with", "from", "what"}
    faults = ["no prose"] if paragraph.startswith(NO_PROSE) else []
    faults += [] if re.search(r"[.:](\s|$)", first) else ["no end of a sentence"]
    named = not needs_title or not subjects or any(word[:4] in subjects for word in re.findall(r"\w+", first.lower()))
    return faults + ([] if named else ["no word of the title"])


def test_every_page_says_in_its_first_words_what_it_answers(site: Path) -> None:
    source = site.parent / "source"
    pages = {path.relative_to(source).with_suffix("").as_posix(): path for path in sorted(source.rglob("*.md"))}
    wanted = {name: path for name, path in pages.items() if not OWN_FORM.match(name)}
    assert len(wanted) > 70
    found = {
        name: faults_of_the_opening(path.read_text("utf-8"), not name.startswith("controllers/"))
        for name, path in wanted.items()
    }
    assert {name: faults for name, faults in found.items() if faults} == {}


def test_an_opening_without_an_answer_is_found() -> None:
    assert faults_of_the_opening("# Big units\n\nA number has a unit.\n", True) == []
    assert faults_of_the_opening("# Units\n\n```sh\nls.\n```\n", True) == ["no prose", "no word of the title"]
    assert faults_of_the_opening(f"# Units\n\nunits {'and ' * FIRST}end.\n", True) == ["no end of a sentence"]
