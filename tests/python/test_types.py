"""The types of the compiled module, which its build writes for type checkers, are right."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import ModuleType

from fracgyro import _core

STUB = Path(_core.__file__).with_name("_core.pyi")
OF_TUPLES = {"n_fields", "n_sequence_fields", "n_unnamed_fields"}  # names that every named tuple from C has


def typed(body: Sequence[ast.stmt], inside: str = "") -> Iterator[str]:
    """Names that the stub describes, with those of its classes."""
    for node in body:
        if isinstance(node, ast.ClassDef):
            yield inside + node.name
            yield from typed(node.body, f"{inside}{node.name}.")
        elif isinstance(node, ast.FunctionDef):
            yield inside + node.name
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            yield inside + node.target.id
        elif isinstance(node, ast.Assign):
            yield from (inside + target.id for target in node.targets if isinstance(target, ast.Name))


def compiled(found: ModuleType | type, inside: str = "") -> Iterator[str]:
    """Names that the module has, with those of its classes."""
    for name, value in vars(found).items():
        if not (isinstance(found, type) and issubclass(found, tuple) and name in OF_TUPLES):
            yield inside + name
        if isinstance(value, type):
            yield from compiled(value, f"{inside}{name}.")


def public(names: Iterator[str]) -> set[str]:
    return {name for name in names if not name.rpartition(".")[2].startswith("_")}


def test_every_name_of_the_compiled_module_is_in_its_types_and_the_other_way_round() -> None:
    described = public(typed(ast.parse(STUB.read_text(encoding="utf-8")).body))
    assert len(described) > 100
    assert described == public(compiled(_core))
