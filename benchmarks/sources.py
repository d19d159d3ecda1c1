"""Sources of each log, their hash, and outdated logs; needs neither the installed module nor a compiler.

    python benchmarks/sources.py            lists logs whose sources have changed since they were made
    python benchmarks/sources.py --check    the same; exits with 1 if any has

A log depends on the script that writes it and on everything that the script imports from benchmarks/ and the package.
If that includes the compiled module, the log depends on bindings/ and on all headers included from there. A script
narrows or widens this with a list DEPENDS_ON: names such as "joint" are the only controllers and adaptations that
count, headers and bindings replace bindings/, and all other entries are files to add, as patterns; modules among them
with what they import.

The hash is of tokens: comments, docstrings, layout, messages of exceptions and, outside of benchmarks/, prose (strings
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
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
INCLUDE = "include/fracgyro"
# Headers that include alternatives; a log depends only on the named ones.
CHOICES = (f"{INCLUDE}/control/registry.hpp", f"{INCLUDE}/control/sliding_mode.hpp")
SHARED = ("adaptation", "controller", "error", "gradient", "observer", "reference", "surfaces", "switching")
WRITERS = {
    "bench",
    "logs",
    "machine",
    "page_numbers",
    "pages",
    "sources",
    "words",
}  # write and read logs; no number depends on them
ELSEWHERE = {"best_order": "docs/best_order.md", "firmware": "integrations/firmware/measured.md"}
WITHOUT_LOG = {
    "readme_picture": "draws docs/run.svg, which a test compares",
    "record_pictures": "makes examples/records, whose figures a test compares, and their pictures",
}
STAMP = re.compile(r"^Sources `([0-9a-f]{16})`, commit `(\w+)`.*?(?: Made with `(.*)`\.)?$", re.MULTILINE)
NO_SOURCE = {".md", ".pyc", ".svg", ".png"}
TOKENS = re.compile(
    r'//[^\n]*|/\*.*?\*/|(?P<text>"(?:\\.|[^"\\\n])*")|(?P<token>\'(?:\\.|[^\'\\\n])+\'|[\w.]+|\S)', re.DOTALL
)


def log_of(name: str) -> str:
    """Path of the log that benchmarks/<name>.py writes, from the root."""
    return ELSEWHERE.get(name, f"benchmarks/results/{name}.md")


def scripts() -> dict[str, Path]:
    """Scripts that write a log, by the log's path from the root."""
    found = {path.stem: path for path in sorted((ROOT / "benchmarks").glob("*.py"))}
    logs = {log_of(name): path for name, path in found.items() if name not in WRITERS | WITHOUT_LOG.keys()}
    return logs | {"benchmarks/results/mutants.md": ROOT / "tests/mutants/run.py"}


# -- Python ------------------------------------------------------------------------------------------------------------


@cache
def _tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def _file(module: str, near: Path) -> Path | None:
    """File of a module of the package, or of the folder of a script."""
    place = ROOT / "python" if module.partition(".")[0] == "fracgyro" else near
    base = place.joinpath(*module.split("."))
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


def _resolved(module: str, name: str | None, near: Path) -> str:
    """Module of a package's name: packages load public names lazily, as listed in their stubs."""
    if name is None:
        return module
    if _file(f"{module}.{name}", near) is not None:
        return f"{module}.{name}"
    stub = ROOT / "python" / module.replace(".", "/") / "__init__.pyi"
    if stub.is_file():
        for origin, imported, local in _imports(_tree(stub), module, package=True):
            if local == name:
                return _resolved(origin, imported, near)
    return module


def _used(path: Path, module: str, near: Path) -> Iterator[str]:
    """Modules that a file uses: its imports, and for a package the modules of the imported names."""
    tree, packages = _tree(path), {}
    for origin, name, local in _imports(tree, module, path.name == "__init__.py"):
        found = _resolved(origin, name, near)
        if (ROOT / "python" / found.replace(".", "/") / "__init__.pyi").is_file():
            packages[local] = found
        else:
            yield found
    for node in ast.walk(tree):
        names = ast.unparse(node).split(".") if isinstance(node, ast.Attribute) else []
        if names and names[0] in packages:
            at = packages[names[0]]
            for name in names[1:]:
                at = _resolved(at, name, near)
            yield at


def _python(start: Path) -> set[Path]:
    """A script or module and all its direct and indirect imports; `_core` by its stub."""
    package = start.is_relative_to(ROOT / "python")
    name = ".".join(start.relative_to(ROOT / "python").with_suffix("").parts) if package else start.stem
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
            used = ((_file(name, start.parent), name) for name in _used(path, module, start.parent))
            waiting += [(file, name) for file, name in used if file is not None]
    return found


# -- C++ ---------------------------------------------------------------------------------------------------------------


def _included(start: Iterable[Path], named: set[str]) -> set[Path]:
    """Files and all their includes; among alternatives only the named ones, or all without names."""
    found: set[Path] = set()
    waiting = list(start)
    while waiting:
        path = waiting.pop()
        if path in found:
            continue
        found.add(path)
        for name in re.findall(r'^\s*#\s*include\s+"([^"]+)"', path.read_text(encoding="utf-8"), re.MULTILINE):
            header = next((p for p in (path.parent / name, ROOT / "include" / name) if p.is_file()), None)
            chosen = not named or Path(name).stem in named or Path(name).stem in SHARED
            if header is not None and (chosen or str(path.relative_to(ROOT)) not in CHOICES):
                waiting.append(header.resolve())
    return found


# -- Logs --------------------------------------------------------------------------------------------------------------


def _declared(path: Path) -> list[str]:
    for node in _tree(path).body:
        if (
            isinstance(node, ast.Assign)
            and isinstance(node.targets[0], ast.Name)
            and node.targets[0].id == "DEPENDS_ON"
        ):
            return list(ast.literal_eval(node.value))
    return []


def sources(script: Path) -> list[Path]:
    """All files that the log of a script depends on."""
    python = _python(script)
    own = {path for path in python if not path.is_relative_to(ROOT / "python") and path.suffix == ".py"}
    declared = {entry for path in own for entry in _declared(path)}
    named = {entry for entry in declared if "/" not in entry}
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
    if ROOT / "python/fracgyro/_core.pyi" in python and not core:
        compiled.update((ROOT / "bindings").glob("*.cpp"))
    return sorted((python - {ROOT / "python/fracgyro/_core.pyi"}) | files | _included(compiled, named))


class _Bare(ast.NodeTransformer):
    """Python without parts that no number depends on."""

    def __init__(self, prose: bool) -> None:
        self.prose = prose

    def visit_Expr(self, node: ast.Expr) -> ast.AST | None:
        return None if isinstance(node.value, ast.Constant) else self.generic_visit(node)

    def visit_Raise(self, node: ast.Raise) -> ast.AST:
        return ast.Raise(exc=None, cause=None)

    def visit_Constant(self, node: ast.Constant) -> ast.AST:
        return ast.Constant("") if self.prose and isinstance(node.value, str) and " " in node.value else node


@cache
def tokens(path: Path) -> str:
    """Content of a file without comments, layout and, outside of benchmarks/, prose."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".py":
        bare = _Bare(prose=path.is_relative_to(ROOT / "python")).visit(ast.parse(text))
        return ast.dump(bare)
    if path.suffix == ".toml":
        return json.dumps(tomllib.loads(text), sort_keys=True, default=str)
    if path.suffix in (".cpp", ".hpp", ".c", ".h", ".v", ".mjs"):
        found = (m["token"] or m["text"] for m in TOKENS.finditer(text))
        return " ".join(each for each in found if each and not (each[0] == '"' and " " in each))
    return " ".join(text.split())


@cache
def digest(script: Path) -> str:
    """Hash of all sources of a script's log, 16 hexadecimal digits."""
    found = hashlib.sha256()
    for path in sources(script):
        found.update(f"{path.relative_to(ROOT)}\0{tokens(path)}\0".encode())
    return found.hexdigest()[:16]


def _git(*words: str) -> str:
    ran = subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True)
    return ran.stdout.strip() if ran.returncode == 0 else ""


def stamp(script: Path, arguments: Sequence[str] = ()) -> str:
    """The last line of a log: its sources, their commit, and arguments, which mark it as partial."""
    commit = _git("rev-parse", "--short=10", "HEAD") or "none"
    changed = _git("status", "--porcelain", "--", *map(str, sources(script)))
    partial = f" Made with `{shlex.join(arguments)}`." if arguments else ""
    return f"Sources `{digest(script)}`, commit `{commit}`{' and changes since' if changed else ''}.{partial}"


def behind() -> dict[str, str]:
    """Logs that are missing or were made from other sources, each with the reason."""
    found = {}
    for log, script in scripts().items():
        path = ROOT / log
        stamped = STAMP.search(path.read_text(encoding="utf-8")) if path.is_file() else None
        if stamped is None:
            found[log] = "does not state its sources" if path.is_file() else "is missing"
        elif stamped[3]:
            found[log] = f"was made with {stamped[3]}"
        elif stamped[1] != digest(script):
            files = [str(path.relative_to(ROOT)) for path in sources(script)]
            names = _git("diff", "--name-only", stamped[2], "--", *files).split()
            named = f": {', '.join(names[:3])}{', …' if len(names) > 3 else ''}" if names else ""
            found[log] = f"was made from other sources, at {stamped[2]}{named}"
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
