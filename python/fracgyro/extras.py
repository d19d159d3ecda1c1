"""Lazy loading of public names, and the extras that provide their libraries."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any

import lazy_loader


def is_ours(module: str) -> bool:
    """Return whether a module is of this package or of one that extends it: fracgyro_lab, fracgyro_fpga."""
    return module.partition(".")[0].partition("_")[0] == "fracgyro"


class MissingExtraError(ImportError):
    """A library of an extra is not installed."""


@contextmanager
def needs(extra: str) -> Iterator[None]:
    """Context manager. Raises MissingExtraError, with the install command, if a library of the extra is missing."""
    try:
        yield
    except ModuleNotFoundError as error:
        missing = str(error.name).partition(".")[0]
        if is_ours(missing):
            raise
        raise MissingExtraError(
            f"{missing} is not installed: install the extra {extra}; in your clone, pip install '.[{extra}]'",
            name=missing,
        ) from None


def require(extra: str, *modules: str) -> None:
    """Imports the modules of an extra. Raises MissingExtraError if one is missing."""
    with needs(extra):
        for module in modules:
            import_module(module)


def public(package: str, file: str, extra: str) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """__getattr__, __dir__ and __all__ of a package whose public names are listed in its stub, next to `file`.

    `extra`: the extra with its libraries beyond the base dependencies.
    """
    load, names, offered = lazy_loader.attach_stub(package, file)

    def get(name: str) -> Any:
        with needs(extra):
            return load(name)

    return get, names, offered
