"""A user's controller or plant named by its file: FILE.py:NAME, the same on every command that takes one."""

from __future__ import annotations

import inspect
import sys
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from types import ModuleType
from typing import Any, ClassVar, Self

from ..files import read_input, reason
from ..scenario import ScenarioError
from ..scenario.messages import did_you_mean
from ..scenario.table import format_value
from . import native
from .user_controller import ControllerLike
from .user_plant import PlantLike


@dataclass(frozen=True)
class OwnFile:
    """Something called `name` in a Python file; `text` is the contents of the file."""

    option: ClassVar[str]
    of_c: ClassVar[type]  # the kind made of a C function, a member of fracgyro.native
    takes: ClassVar[str]  # arguments of a function that is accepted instead

    text: str
    path: str
    name: str

    @classmethod
    def read(cls, given: str) -> Self:
        """The file and the name in FILE.py:NAME. Raises ScenarioError if there is no such file or name."""
        path, colon, name = given.rpartition(":")
        if not colon or not path or not name.isidentifier():
            raise ScenarioError(f"--{cls.option} is {format_value(given)}: it must be FILE.py:NAME")
        try:
            text = read_input(path).decode("utf-8-sig")
        except UnicodeDecodeError:
            raise ScenarioError(f"{path} cannot be read: it is not UTF-8") from None
        except OSError as error:
            raise ScenarioError(f"{path} cannot be read: {reason(error)}") from None
        except ValueError as error:
            raise ScenarioError(f"{path} cannot be read: {error}") from None
        found = cls(text, path, name)
        if not found._fits(found.object):
            raise ScenarioError(
                f"--{cls.option} names {name}: it must be a class, a function or a fracgyro.native.{cls.of_c.__name__} "
                f"of {path}" + found._near()
            )
        return found

    @property
    def object(self) -> Any:
        """The object of this name; None if the file has no such name."""
        return getattr(_module(self.text, self.path), self.name, None)

    def _fits(self, found: Any) -> bool:
        return callable(found) or isinstance(found, self.of_c)

    def _near(self) -> str:
        return did_you_mean(self.name, (name for name in vars(_module(self.text, self.path)) if name[0] != "_"))

    def made(self, **arguments: float) -> Any:
        """The result of the class or function with these arguments. Raises ScenarioError if it fails."""
        words = f"{self.name}({', '.join(f'{name}={value:g}' for name, value in arguments.items())}) of {self.path}"
        try:
            found = self.object(**arguments)
        except Exception as error:
            raise ScenarioError(f"{words} raised {type(error).__name__}: {error}") from error
        if not self._fits(found):
            raise ScenarioError(
                f"{words} is {format_value(found)}: it must be a {self.option}, a function of {self.takes} or a "
                f"fracgyro.native.{self.of_c.__name__}"
            )
        return found

    def _with_defaults(self) -> Any:
        """The object as it is, a class with its default arguments, for `simulate`.

        A function with `ranges`, which makes controllers for `fracgyro compare`, is called with its defaults, too.
        Raises ScenarioError if an argument has no default.
        """
        found = self.object
        if not inspect.isclass(found) and not hasattr(found, "ranges"):
            return found
        unset = [
            name
            for name, parameter in inspect.signature(found).parameters.items()
            if parameter.default is parameter.empty and parameter.kind in (0, 1, 3)  # without *args and **kwargs
        ]
        if unset:
            raise ScenarioError(
                f"{self.name} of {self.path} has no default for {', '.join(unset)}: every argument must have one"
            )
        return self.made()


class ControllerFile(OwnFile):
    """A controller."""

    option, of_c, takes = "controller", native.Law, "a sample"

    def controller(self) -> ControllerLike:
        """The controller for `simulate`. Raises ScenarioError if an argument of its class has no default."""
        found: ControllerLike = self._with_defaults()
        return found


class PlantFile(OwnFile):
    """A plant."""

    option, of_c, takes = "plant", native.Plant, "the time, the state and the force"

    def plant(self) -> PlantLike:
        """The plant for `simulate`. Raises ScenarioError if an argument of its class has no default."""
        found: PlantLike = self._with_defaults()
        return found


@lru_cache
def _module(text: str, path: str) -> ModuleType:
    module = ModuleType(f"own_file_{Path(path).stem}")
    module.__file__ = path
    sys.modules[module.__name__] = module  # dataclasses look their annotations up there
    try:
        exec(compile(text, path, "exec"), module.__dict__)
    except Exception as error:
        raise ScenarioError(f"{path} cannot be run: {type(error).__name__}: {error}") from error
    return module
