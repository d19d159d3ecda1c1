"""Collect the sources of the documentation site: `python docs/site/pages.py FOLDER`, then sphinx-build on FOLDER.

Most pages are files elsewhere in the repository: guides, equations, decisions, logs. PAGES lists them. Links to files
become links to pages, to pictures, or, if the site has neither, to the repository.
"""

from __future__ import annotations

import os
import re
import shutil
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from urllib.parse import unquote

import controllers
import illustrations
from fracgyro.export.firmware import coefficients_header
from fracgyro.export.web import settings_types
from fracgyro.scenario import Scenario
from fracgyro.scenario.kinds import KINDS
from headers import c_reference

SITE = Path(__file__).resolve().parent
ROOT = SITE.parents[1]
REPOSITORY = "https://github.com/fracgyro/fracgyro"

PAGES = {
    "how-to/runs": "docs/usage.md",
    "how-to/experiments": "docs/experiments.md",
    "how-to/units": "docs/units.md",
    "how-to/references": "docs/references.md",
    "how-to/controllers": "docs/controllers.md",
    "how-to/plants": "docs/plants.md",
    "how-to/studies": "docs/studies.md",
    "how-to/cluster": "docs/cluster.md",
    "how-to/record": "docs/record.md",
    "how-to/data-sheet": "docs/data_sheet.md",
    "how-to/identify": "docs/identify.md",
    "how-to/compare": "docs/compare.md",
    "how-to/board": "docs/board.md",
    "how-to/zoo": "docs/zoo.md",
    "how-to/limit": "docs/limit.md",
    "how-to/control": "docs/control.md",
    "how-to/operators": "docs/operators.md",
    "how-to/gymnasium": "docs/gymnasium.md",
    "how-to/matlab": "docs/matlab.md",
    "how-to/matlab-folder": "integrations/matlab/README.md",
    "how-to/fmu": "docs/fmu.md",
    "how-to/browser": "integrations/web/README.md",
    "how-to/firmware": "docs/firmware.md",
    "how-to/firmware-folder": "integrations/firmware/README.md",
    "how-to/fpga": "docs/fpga.md",
    "how-to/fpga-folder": "fpga/fracgyro_fpga/verilog/README.md",
    "how-to/tuned-gains": "examples/tuning/README.md",
    "how-to/notebooks": "examples/notebooks/README.md",
    "understand/equations": "EQUATIONS.md",
    "understand/paper": "docs/paper.md",
    "understand/errata": "docs/errata.md",
    "understand/best-order": "docs/best_order.md",
    "understand/rate-sensor": "docs/rate_sensor.md",
    "understand/performance": "docs/performance.md",
    "understand/architecture": "ARCHITECTURE.md",
    "reference/scenario": "docs/reference.md",
    "reference/studies": "docs/study_files.md",
    "reference/cpp": "docs/cpp.md",
    "reference/firmware-measured": "integrations/firmware/measured.md",
    "contributing": "CONTRIBUTING.md",
    "conduct": "CODE_OF_CONDUCT.md",
    "security": "SECURITY.md",
    "releasing": "RELEASING.md",
    "changelog": "CHANGELOG.md",
}
LEFT_OUT = {"mutants.md"}  # a list of edits of the code, for developers
PICTURES = {".svg", ".png", ".webp"}
CODE = {".hpp"}  # a link to a name in such a file leads to its line
# Listed on a page, but not in the sidebar of every page, which would take a third of the build time.
LISTED = {"decisions", "measured"}
ORPHAN = "---\norphan: true\n---\n\n"


def line_of(path: Path, name: str) -> int:
    """Line on which a C++ header defines this name first. Raises ValueError if it does not."""
    defining = re.compile(rf"^ *(template|static|constexpr|inline|struct)\b.*\b{name}\b[(\s]")
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        if defining.match(line):
            return number
    raise ValueError(f"{path.name} does not define {name}")


def pages() -> dict[str, Path]:
    """Every page that is Markdown: its name, and the file that it is made of."""
    own = {path.relative_to(SITE).with_suffix("").as_posix(): path for path in sorted(SITE.rglob("*.md"))}
    elsewhere = {name: ROOT / file for name, file in PAGES.items()}
    decisions = {f"decisions/{path.stem}": path for path in sorted((ROOT / "docs/decisions").glob("*.md"))}
    logs = {f"measured/{path.stem}": path for path in sorted((ROOT / "benchmarks/results").glob("*.md"))}
    return own | elsewhere | decisions | {name: path for name, path in logs.items() if path.name not in LEFT_OUT}


class Gathered:
    """A folder with all of them."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.pages = pages()
        self.name_of = {path: name for name, path in self.pages.items()}
        self.name_of[ROOT / "README.md"] = "index"
        self.name_of |= {ROOT / "docs/decisions": "decisions/index", ROOT / "benchmarks/results": "measured/index"}
        self.name_of[ROOT / "docs/gallery"] = "gallery/index"
        self.written: set[Path] = set()

    def write(self) -> None:
        with ProcessPoolExecutor() as pool:  # drawing takes most of the time
            of_kinds = pool.map(controllers.page, KINDS)
            texts = {path: path.read_text(encoding="utf-8") for path in self.pages.values()}
            shown = sorted({name for text in texts.values() for name in illustrations.MARK.findall(text)})
            drawings = pool.map(illustrations.drawn, shown)
            for name, path in self.pages.items():
                folder, _, page = name.rpartition("/")
                text = "\n".join(self.linked(texts[path], path, name))
                if controllers.MARK in text:
                    text = text.replace(controllers.MARK, controllers.overview())
                text = illustrations.MARK.sub(lambda found: illustrations.markdown(found[1]), text)
                if folder in LISTED:
                    text = "\n".join([text, "", *self.listed(folder)]) if page == "index" else f"{ORPHAN}{text}"
                self.put(f"{name}.md", text)
            for kind, (text, pictures) in zip(KINDS, of_kinds, strict=True):
                self.put(f"controllers/{kind}.md", f"{ORPHAN}{text}")
                for file, drawn in pictures.items():
                    self.put(f"pictures/{file}", drawn)
            for name, drawn in zip(shown, drawings, strict=True):
                self.put(f"pictures/site-{name}.svg", drawn)
        made = coefficients_header(Scenario.shipped("hardware"), "float")
        self.put("reference/c.md", c_reference(ROOT / "integrations/firmware/fracgyro.h", made))
        types = (ROOT / "integrations/web/fracgyro.d.ts").read_text(encoding="utf-8")
        self.put("reference/fracgyro.d.ts", types)
        self.put("reference/settings.d.ts", settings_types())
        stale = {path for path in self.folder.rglob("*") if path.is_file()} - self.written
        for path in stale:
            if path.relative_to(self.folder).parts[0] not in {"gallery", "sg_execution_times.rst"}:
                path.unlink()

    def listed(self, folder: str) -> Iterator[str]:
        """A link to each page of a folder, by its title."""
        for name, path in self.pages.items():
            if name.startswith(f"{folder}/") and not name.endswith("/index"):
                title = re.search(r"^# (.*)$", path.read_text(encoding="utf-8"), re.MULTILINE)
                assert title is not None, path
                yield f"- [{title[1]}]({name.removeprefix(f'{folder}/')}.md)"

    def put(self, name: str, text: str) -> None:
        """Only what changed: Sphinx reads no page again without need."""
        target = self.folder / name
        target.parent.mkdir(parents=True, exist_ok=True)
        if not target.is_file() or target.read_text(encoding="utf-8") != text:
            target.write_text(text, encoding="utf-8", newline="\n")
        self.written.add(target)

    def linked(self, text: str, path: Path, name: str) -> Iterator[str]:
        """The lines of a text, with its links as they are on the site."""
        fence = ""
        for line in text.splitlines():
            opened = re.match(r"\s*(`{3,}|~{3,})", line)
            if opened and (not fence or opened[1].startswith(fence)):
                fence = "" if fence else opened[1]
            # MyST treats a line that begins with % as a comment.
            yield line if fence or opened else re.sub(r"^(\s*)%", r"\1\\%", self.line_linked(line, path, name))

    def line_linked(self, line: str, path: Path, name: str) -> str:
        def replaced(match: re.Match[str]) -> str:
            return f"]({self.target(match[1], path, name)})"

        parts = re.split(r"(`[^`]*`)", line)
        parts[::2] = [re.sub(r"\]\(([^)\s]+)\)", replaced, part) for part in parts[::2]]
        return "".join(parts)

    def target(self, link: str, path: Path, name: str) -> str:
        if re.match(r"[a-z]+:|#", link):
            return link
        file, hash_sign, anchor = unquote(link).partition("#")
        found = Path(os.path.normpath(path.parent / file))
        if found in self.name_of:
            page = self.name_of[found]
            suffix = ".md" if page in self.pages else ".rst"  # gallery
            return f"{os.path.relpath(page + suffix, Path(name).parent)}{hash_sign}{anchor}"
        if found.suffix in PICTURES:
            copied = self.folder / "pictures" / found.name
            copied.parent.mkdir(parents=True, exist_ok=True)
            if not copied.is_file() or copied.read_bytes() != found.read_bytes():
                shutil.copyfile(found, copied)
            self.written.add(copied)
            return f"/pictures/{found.name}"
        if anchor and found.suffix in CODE:
            anchor = f"L{line_of(found, anchor)}"
        kind = "tree" if found.is_dir() else "blob"
        return f"{REPOSITORY}/{kind}/main/{found.relative_to(ROOT).as_posix()}{hash_sign}{anchor}"


if __name__ == "__main__":
    Gathered(Path(sys.argv[1]).resolve()).write()
