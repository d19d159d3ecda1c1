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
import subprocess
import sys
import tempfile
import zlib
from collections.abc import Iterator
from functools import cache
from html.parser import HTMLParser
from importlib import import_module
from pathlib import Path
from runpy import run_path
from types import ModuleType
from typing import Any
from urllib.parse import unquote, urljoin, urlsplit

import fracgyro as fg
import fracgyro_fpga
import fracgyro_lab as lab
import numpy as np
import pytest
from browser import served, violations, watched
from children import PATIENCE
from shared import shared

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

WIDE = "Math.max(document.scrollingElement.scrollWidth, document.querySelector('article').scrollWidth)"
LOOKED_AT = [
    "index",
    "tour/1-simulate",
    "gallery/index",
    "reference/scenario",
    "reference/python/runs",
    "controllers/linear",
]


@pytest.mark.parametrize(("scheme", "width"), [("light", 1280), ("dark", 360)])
def test_pages_are_quiet_fit_and_accessible(site: Path, browser: Any, scheme: str, width: int) -> None:
    """No console message, no external request, nothing wider than the window, no serious violation."""
    size = {"width": width, "height": 800}
    with served(site) as address, browser.new_page(viewport=size, color_scheme=scheme) as page:
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


def test_the_picture_on_the_first_page_becomes_the_live_page(site: Path, browser: Any) -> None:
    with served(site) as address, browser.new_page() as page:
        page.goto(urljoin(address, "index.html"))
        assert page.locator("iframe").count() == 0
        page.locator("img.live-page").click()
        assert page.locator("iframe.live-page").get_attribute("src") == urljoin(address, "live/index.html")
