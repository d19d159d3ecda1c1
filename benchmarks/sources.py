"""Sources of each log, their hash, and outdated logs; needs neither the installed module nor a compiler.

    python benchmarks/sources.py            lists logs whose sources have changed since they were made
    python benchmarks/sources.py --check    the same; exits with 1 if any has

A log depends on the script that writes it and on everything that the script imports from its folder and the packages.
If that includes the compiled module, the log depends on bindings/ and on all headers included from there. A script
narrows or widens this with a list DEPENDS_ON: names such as "joint" are the only controllers and adaptations that
count, headers and bindings replace bindings/, and all other entries are files to add, as patterns; modules among them
with what they import. A script that writes several logs has a dictionary LOGS of such lists instead, by the logs'
names, and is given the name of the log to write.

Simulated numbers depend on the core and its settings by the hashes of golden.json instead of by their text (golden.py),
so that a log is behind only if they have changed; a script with MEASURES_CODE = True measures the code itself, as times
and sizes do, and depends on the text.

The hash is of tokens: comments, docstrings, layout, messages of exceptions and, outside of scripts, prose (strings
with a space) do not count. Decision 0032 has the reasons.
"""

from __future__ import annotations

import ast
import hashlib
import json
import re
import shlex
import subprocess
import sys
import tomllib
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
INCLUDE = "include/fracgyro"
CORE = ROOT / "python/fracgyro/_core.pyi"  # made with the compiled module; stands for it here
# Headers that include alternatives, of which a log depends only on those it names.
CHOICES = (f"{INCLUDE}/controllers/registry.hpp", f"{INCLUDE}/controllers/sliding_mode.hpp")
ALTERNATIVES = ("controllers", "estimation")  # folders of headers that are one choice among others
DECLARATIONS = ("DEPENDS_ON", "LOGS", "MEASURES_CODE")  # scripts state with them what the hash covers
SHARED = ("adaptation", "gradient")
WRITERS = {
    "bench",
    "logs",
    "machine",
    "page_numbers",
    "pages",
    "sources",
    "words",
}  # write and read logs; no number depends on them
PACKAGES = {"fracgyro": "python", "fracgyro_fpga": "fpga", "fracgyro_lab": "lab"}  # and the folders that they are in
SCRIPTS = ("benchmarks", "fpga/benchmarks", "lab")
ELSEWHERE = {"best_order": "docs/best_order.md", "firmware": "integrations/firmware/measured.md"}
INPUTS = "--curves"  # an option that names a folder of inputs only, which are not in the repository
PARTS = {"compare_track": "track", "compare_rate": "rate"}  # logs that their script knows by another word
RATE = "python/fracgyro/rate"
GOLDEN = "benchmarks/golden.json"
WITHOUT_LOG = {
    "golden": "hashes golden runs, which a test compares",
    "experiments_page": "runs the examples of docs/experiments.md, which a test compares",
    "front_picture": "draws docs/compare.svg, which a test compares",
    "readme_picture": "draws docs/run.svg, which a test compares",
    "scenario_files": "writes the files that faults and off_model leave for their programs",
    "record_pictures": "makes examples/records, whose figures a test compares, and their pictures",
}
STAMP = re.compile(
    r"^Sources `([0-9a-f]{16})`(?: with the first (\d+) golden runs)?, commit `(\w+)`.*?(?: Made with `(.*)`\.)?$",
    re.MULTILINE,
)
NO_SOURCE = {".md", ".pyc", ".svg", ".png"}
TOKENS = re.compile(
    r'//[^\n]*|/\*.*?\*/|(?P<text>"(?:\\.|[^"\\\n])*")|(?P<token>\'(?:\\.|[^\'\\\n])+\'|[\w.]+|\S)', re.DOTALL
)


def log_of(name: str) -> str:
    """Path of the log that the script <name>.py writes, from the root."""
    return ELSEWHERE.get(name, f"benchmarks/results/{name}.md")


def scripts() -> dict[str, Path]:
    """Scripts that write a log, by the log's path from the root."""
    found = {path.stem: path for folder in SCRIPTS for path in sorted((ROOT / folder).glob("*.py"))}
    logs = {
        log_of(log): path
        for name, path in found.items()
        if name not in WRITERS | WITHOUT_LOG.keys()
        for log in _assigned(path, "LOGS") or [name]
    }
    return logs | {"benchmarks/results/mutants.md": ROOT / "tests/mutants/run.py"}


# -- Python ------------------------------------------------------------------------------------------------------------


def _packaged(path: Path) -> bool:
    return any(path.is_relative_to(ROOT / folder / name) for name, folder in PACKAGES.items())


@cache
def _tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def _base(module: str, near: Path) -> Path:
    """Path without suffix of a module of a package, or of the folder of a script."""
    folder = PACKAGES.get(module.partition(".")[0])
    return (ROOT / folder if folder else near).joinpath(*module.split("."))


@cache
def _file(module: str, near: Path) -> Path | None:
    """File of a module of a package, or of the folder of a script; it exists unless it is `CORE`."""
    if module == "fracgyro._core":
        return CORE
    base = _base(module, near)
    candidates = (base.with_suffix(".py"), base / "__init__.py", base.with_suffix(".pyi"))
    return next((path for path in candidates if path.is_file()), None)


def _imports(tree: ast.AST, module: str, package: bool) -> Iterator[tuple[str, str | None, str]]:
    """(module, name in it, local name) of each import, except those for type checkers."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.Import):
            yield from ((each.name, None, each.asname or each.name.partition(".")[0]) for each in node.names)
        elif isinstance(node, ast.ImportFrom):
            parts = module.split(".")
            base = parts[: len(parts) - node.level + package] if node.level else []
            origin = ".".join([*base, *([node.module] if node.module else [])])
            yield from ((origin, each.name, each.asname or each.name) for each in node.names)
        elif not (isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)):
            yield from _imports(node, module, package)


@cache
def _resolved(module: str, name: str | None, near: Path) -> str:
    """Module of a package's name: packages load public names lazily, as listed in their stubs."""
    if name is None:
        return module
    if _file(f"{module}.{name}", near) is not None:
        return f"{module}.{name}"
    stub = _base(module, near) / "__init__.pyi"
    if stub.is_file():
        for origin, imported, local in _imports(_tree(stub), module, package=True):
            if local == name:
                return _resolved(origin, imported, near)
    return module


def _first(node: ast.expr) -> str:
    """The name that an expression begins with, which costs less than its whole text; empty if there is none."""
    while not isinstance(node, ast.Name):
        if isinstance(node, ast.Call):
            node = node.func
        elif isinstance(node, ast.Attribute | ast.Subscript):
            node = node.value
        else:
            return ""
    return node.id


@cache
def _used(path: Path, module: str, near: Path) -> frozenset[str]:
    """Modules that a file uses: its imports, and for a package the modules of the imported names."""
    tree, packages, used = _tree(path), {}, set()
    for origin, name, local in _imports(tree, module, path.name == "__init__.py"):
        found = _resolved(origin, name, near)
        if (_base(found, near) / "__init__.pyi").is_file():
            packages[local] = found
        else:
            used.add(found)
    for node in ast.walk(tree):
        names = ast.unparse(node).split(".") if isinstance(node, ast.Attribute) and _first(node) in packages else []
        if names and names[0] in packages:
            at = packages[names[0]]
            for name in names[1:]:
                at = _resolved(at, name, near)
            used.add(at)
    return frozenset(used)


@cache
def _python(start: Path) -> frozenset[Path]:
    """A script or module and all that it imports, however far; `CORE` for the compiled module."""
    name = ".".join(start.relative_to(ROOT).with_suffix("").parts[1:])
    found: set[Path] = set()
    waiting = [(start, name)]
    while waiting:
        path, module = waiting.pop()
        if path in found or (path.parent.name == "benchmarks" and path.stem in WRITERS):
            continue
        found.add(path)
        if path.suffix == ".py":
            if path.name == "__init__.py":
                found.update(path.parent.glob("*.toml"))
            near = ROOT if _packaged(path) else start.parent  # only scripts import their neighbors
            used = ((_file(name, near), name) for name in _used(path, module, near))
            waiting += [(file, name) for file, name in used if file is not None]
    return frozenset(found)


# -- C++ ---------------------------------------------------------------------------------------------------------------


@cache
def _includes(path: Path) -> tuple[tuple[Path, bool], ...]:
    """Files that a file includes, and whether each is one of alternatives."""
    named = re.findall(r'^\s*#\s*include\s+"([^"]+)"', path.read_text(encoding="utf-8"), re.MULTILINE)
    found = []
    for name in named:
        header = next((p for p in (path.parent / name, ROOT / "include" / name) if p.is_file()), None)
        if header is not None:
            alternative = header.parent.name in ALTERNATIVES and header.stem not in SHARED
            found.append((header.resolve(), alternative and str(path.relative_to(ROOT)) in CHOICES))
    return tuple(found)


@cache
def _included(start: frozenset[Path], named: frozenset[str]) -> frozenset[Path]:
    """Files and all their includes; among alternatives only the named ones, or all without names."""
    found: set[Path] = set()
    waiting = list(start)
    while waiting:
        path = waiting.pop()
        if path not in found:
            found.add(path)
            waiting += [file for file, choice in _includes(path) if not (choice and named) or file.stem in named]
    return frozenset(found)


# -- Logs --------------------------------------------------------------------------------------------------------------


def _assigned(path: Path, name: str) -> Any:
    """Value of a constant of a script, None if it has none."""
    found = None
    for node in _tree(path).body:
        if isinstance(node, ast.AugAssign) and _first(node.target) == name:
            raise SystemExit(f"{path.relative_to(ROOT)}: {name} must be assigned once")
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name) and node.targets[0].id == name:
            found = ast.literal_eval(node.value)
    return found


def _declared(path: Path, log: str) -> list[str]:
    return _assigned(path, "DEPENDS_ON") or (_assigned(path, "LOGS") or {}).get(Path(log).stem, [])


@cache
def _is_golden(script: Path) -> bool:
    """True if golden runs stand for the core and its settings."""
    python = {path for path in _python(script) if not _packaged(path) and path.suffix == ".py"}
    return not any(_assigned(path, "MEASURES_CODE") for path in python)


@cache
def _covered() -> frozenset[Path]:
    """Modules and scenarios of the package that the golden runs use."""
    return frozenset(path for path in _python(ROOT / "benchmarks/golden.py") if _packaged(path))


def sources(script: Path, log: str = "") -> list[Path]:
    """All files that the log of a script depends on, or this one of its logs; without those that golden runs cover."""
    found = _sources(script, log)[0]
    if not _is_golden(script):
        return sorted(found)
    folders = (ROOT / INCLUDE, ROOT / "bindings")
    return sorted(path for path in found - _covered() if not any(path.is_relative_to(folder) for folder in folders))


@cache
def _sources(script: Path, log: str) -> tuple[frozenset[Path], frozenset[str]]:
    """Files of a log, and the names of the controllers and adaptations that it is limited to."""
    python = _python(script)
    own = {path for path in python if not _packaged(path) and path.suffix == ".py"}
    declared = {entry for path in own for entry in _declared(path, log)}
    named = {entry for entry in declared if "/" not in entry}
    known = {path.stem for folder in ALTERNATIVES for path in (ROOT / INCLUDE / folder).glob("*.hpp")} | {"core"}
    if unknown := named - known:
        raise SystemExit(f"{script.relative_to(ROOT)}: DEPENDS_ON has {min(unknown)}, which no header is called")
    files: set[Path] = set()
    for pattern in declared - named:
        matches = {path for path in ROOT.glob(pattern) if path.is_file() and path.suffix not in NO_SOURCE}
        if not matches:
            raise SystemExit(f"{script.relative_to(ROOT)}: DEPENDS_ON has {pattern}, which matches no file")
        files |= matches
    python = python.union(*(_python(path) for path in files if path.suffix == ".py"))
    compiled = {path for path in files if path.suffix in (".cpp", ".hpp", ".h")}
    compiled |= {path.with_suffix(".cpp") for path in own if path.with_suffix(".cpp").is_file()}
    core = {path for path in compiled if path.parts[len(ROOT.parts)] in ("include", "bindings")}
    if CORE in python and not core:
        compiled.update((ROOT / "bindings").glob("*.cpp"))
    return (python - {CORE}) | files | _included(frozenset(compiled), frozenset(named)), frozenset(named)


@cache
def _golden() -> list[tuple[str, str]]:
    """Names of the golden runs, and their hashes or figures as text."""
    found = json.loads((ROOT / GOLDEN).read_text(encoding="utf-8"))
    return [(name, value if isinstance(value, str) else json.dumps(value)) for name, value in found.items()]


def golden(script: Path, log: str = "", first: int | None = None) -> dict[str, str]:
    """Hashes or figures of the golden runs that a log depends on, by name; none if it needs no core.

    `first`: of this many runs.

    Of controllers and adaptations only those that the script names count, without names all.
    """
    files, named = _sources(script, log)
    if len(files) == len(sources(script, log)):
        return {}
    uses_rate = any(path.is_relative_to(ROOT / RATE) for path in files)
    found = {}
    for name, value in _golden()[:first]:
        needed = set(name.partition(":")[0].split(", ")) - {"core"}
        used = uses_rate if needed == {"rate"} else not named or needed <= named
        if used and value != "refused":
            found[name] = value
    return found


class _Bare(ast.NodeTransformer):
    """Python without parts that no number depends on."""

    def __init__(self, prose: bool) -> None:
        self.prose = prose

    def visit_Assign(self, node: ast.Assign) -> ast.AST | None:
        declares = isinstance(node.targets[0], ast.Name) and node.targets[0].id in DECLARATIONS
        return None if declares else self.generic_visit(node)

    def visit_Expr(self, node: ast.Expr) -> ast.AST | None:
        return None if isinstance(node.value, ast.Constant) else self.generic_visit(node)

    def visit_Raise(self, node: ast.Raise) -> ast.AST:
        return ast.Raise(exc=None, cause=None)

    def visit_Constant(self, node: ast.Constant) -> ast.AST:
        return ast.Constant("") if self.prose and isinstance(node.value, str) and " " in node.value else node


@cache
def tokens(path: Path) -> str:
    """Content of a file without comments and layout; also without prose, except in scripts."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".py":
        bare = _Bare(prose=_packaged(path)).visit(ast.parse(text))
        return ast.dump(bare)
    if path.suffix == ".toml":
        return json.dumps(tomllib.loads(text), sort_keys=True, default=str)
    if path.suffix in (".cpp", ".hpp", ".c", ".h", ".v", ".mjs"):
        found = (m["token"] or m["text"] for m in TOKENS.finditer(text))
        return " ".join(each for each in found if each and not (each[0] == '"' and " " in each))
    return " ".join(text.split())


@cache
def digest(script: Path, log: str = "", first: int | None = None) -> str:
    """Hash of all that a script's log depends on, 16 hexadecimal digits; `first`: with this many golden runs."""
    found = hashlib.sha256()
    for path in sources(script, log):
        found.update(f"{path.relative_to(ROOT)}\0{tokens(path)}\0".encode())
    for name, of_run in golden(script, log, first).items():
        found.update(f"{name}\0{of_run}\0".encode())
    return found.hexdigest()[:16]


def _git(*words: str) -> str:
    ran = subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True)
    return ran.stdout.strip() if ran.returncode == 0 else ""


def stamp(script: Path, arguments: Sequence[str] = (), log: str = "") -> str:
    """The last line of a log: its sources, the commit they are from, and arguments, with which it is not the log."""
    commit = _git("rev-parse", "--short=10", "HEAD") or "none"
    changed = _git("status", "--porcelain", "--", *map(str, sources(script, log)))
    whole = [[], [Path(log).stem], [PARTS.get(Path(log).stem, "")]]
    partial = "" if list(arguments) in whole or arguments[0] == INPUTS else f" Made with `{shlex.join(arguments)}`."
    runs = f" with the first {len(_golden())} golden runs" if golden(script, log) else ""
    return (
        f"Sources `{digest(script, log)}`{runs}, commit `{commit}`{' and changes since' if changed else ''}.{partial}"
    )


def behind() -> dict[str, str]:
    """Logs that are missing or were made from other sources, each with the reason."""
    found = {}
    for log, script in scripts().items():
        path = ROOT / log
        stamped = STAMP.search(path.read_text(encoding="utf-8")) if path.is_file() else None
        if stamped is None:
            found[log] = "does not state its sources" if path.is_file() else "is missing"
        elif stamped[4]:
            found[log] = f"was made with {stamped[4]}"
        elif stamped[1] != digest(script, log, int(stamped[2]) if stamped[2] else None):
            files = [str(path.relative_to(ROOT)) for path in sources(script, log)]
            files += [GOLDEN] if golden(script, log) else []
            names = _git("diff", "--name-only", stamped[3], "--", *files).split()
            named = f": {', '.join(names[:3])}{', …' if len(names) > 3 else ''}" if names else ""
            found[log] = f"was made from other sources, at {stamped[3]}{named}"
    return found


def main() -> int:
    found = behind()
    for log, reason in found.items():
        print(f"{log} {reason}")
    if found:
        print(f"{len(found)} of {len(scripts())} logs are behind their sources: `make bench-behind` makes them again")
    return int("--check" in sys.argv and bool(found))


if __name__ == "__main__":
    sys.exit(main())
