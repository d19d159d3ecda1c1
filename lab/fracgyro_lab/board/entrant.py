"""Who enters the board: a Python file or a compiled law, its hash, and the seeds that follow from the hash."""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from fracgyro.files import read_input, reason
from fracgyro.scenario import ScenarioError
from fracgyro.scenario.messages import did_you_mean
from fracgyro.scenario.table import format_value

from ..comparison.contender import Contender
from ..comparison.track_contenders import CONTENDERS

KIND = "controller.kind"


@dataclass(frozen=True)
class Entrant:
    """A law that enters in one class of information."""

    law: str  # name of a contender, or FILE.py:NAME without folders
    words: str  # a line that describes it
    information: str  # F or P
    text: str | None  # contents of the file; None for a compiled law
    sha256: str  # hash of the file or, for a compiled law, of its entry in the list of contenders

    def seeds(self, purpose: str, count: int) -> list[int]:
        """Noise seeds that nobody chooses: they follow from the hash, the name, the class and the purpose."""
        parts = (f"{self.sha256} {self.law} {self.information} {purpose} {number}" for number in range(count))
        return [int.from_bytes(hashlib.sha256(part.encode()).digest()[:8], "big") >> 1 for part in parts]


def entrant(given: str, information: str) -> Entrant:
    """The law of FILE.py, FILE.py:NAME, or the name of a contender of `compare track` or of a kind of controller.

    Raises ScenarioError if there is no such law, or it does not take part in the class. The file is read, not run.
    """
    path, colon, name = given.rpartition(":")
    if given.endswith(".py"):
        path, name = given, ""
    elif not colon:
        return _compiled(given, information)
    try:
        data = read_input(path)
        text = data.decode("utf-8-sig")
        names = list(_laws(ast.parse(text)))
    except OSError as error:
        raise ScenarioError(f"{path} cannot be read: {reason(error)}") from None
    except (SyntaxError, ValueError) as error:
        raise ScenarioError(f"{path} cannot be read: {error}") from None
    known = {each: words for each, words, _ in names}
    if not name:
        tuned = [each for each, _, ranges in names if ranges] or list(known)
        if len(tuned) != 1:
            raise ScenarioError(f"{path} has {', '.join(tuned) or 'no law'}: name one, as in {Path(path).name}:NAME")
        (name,) = tuned
    if name not in known:
        raise ScenarioError(
            f"the law is {format_value(given)}: it must be a class, a function or a variable of {path}"
            f"{did_you_mean(name, known)}"
        )
    law = f"{Path(path).name}:{name}"
    return Entrant(law, known[name], information, text, hashlib.sha256(data).hexdigest())


def _laws(tree: ast.Module) -> Iterator[tuple[str, str, bool]]:
    """(name, first line of its docstring, True if it has `ranges`) of each public object that a file defines."""
    with_ranges = {
        target.value.id
        for node in tree.body
        if isinstance(node, ast.Assign)
        for target in node.targets
        if isinstance(target, ast.Attribute) and target.attr == "ranges" and isinstance(target.value, ast.Name)
    }
    general = (ast.get_docstring(tree) or "").partition("\n")[0]
    for node in tree.body:
        if isinstance(node, ast.ClassDef | ast.FunctionDef) and not node.name.startswith("_"):
            words = (ast.get_docstring(node) or general).partition("\n")[0].rstrip(".")
            yield node.name, words, node.name in with_ranges or _assigns_ranges(node)
        elif isinstance(node, ast.Assign):
            for target in node.targets:
                if isinstance(target, ast.Name) and not target.id.startswith("_") and not target.id.isupper():
                    yield target.id, general.rstrip("."), target.id in with_ranges


def _assigns_ranges(node: ast.ClassDef | ast.FunctionDef) -> bool:
    targets = [
        target
        for each in node.body
        if isinstance(each, ast.Assign | ast.AnnAssign)
        for target in (each.targets if isinstance(each, ast.Assign) else [each.target])
    ]
    return any(isinstance(target, ast.Name) and target.id == "ranges" for target in targets)


def contender(name: str) -> Contender | None:
    """The contender of `compare track` with this name, or the first with this kind of controller."""
    named = [each for each in CONTENDERS if each.name == name]
    return next(iter(named or [each for each in CONTENDERS if each.fixed.get(KIND) == name]), None)


def _compiled(name: str, information: str) -> Entrant:
    found = contender(name)
    names = [each.name for each in CONTENDERS]
    if found is None:
        near = did_you_mean(name, names) or f"; known are {', '.join(names)}"
        raise ScenarioError(f"the law is {format_value(name)}: it must be FILE.py or a compiled law{near}")
    if information not in found.classes:
        raise ScenarioError(f"--class is {information}: {found.name} takes part only in {', '.join(found.classes)}")
    listed = repr(replace(found, own=None, words="", source=""))
    return Entrant(found.name, found.words, information, None, hashlib.sha256(listed.encode()).hexdigest())
