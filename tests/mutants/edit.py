"""A pytest plugin: one module of the package is as the mutant FRACGYRO_EDIT of python.toml makes it."""

from __future__ import annotations

import importlib.machinery
import os
import sys
from importlib.abc import Loader, MetaPathFinder
from types import ModuleType
from typing import Any

from compile_in import ROOT
from python_kills import edited, listed, module_of, path_of

(ENTRY,) = (entry for entry in listed() if entry["id"] == os.environ["FRACGYRO_EDIT"])


class Edited(MetaPathFinder, Loader):
    def find_spec(self, name: str, path: Any, target: Any = None) -> importlib.machinery.ModuleSpec | None:
        if name != module_of(ENTRY["file"]):
            return None
        file = str(ROOT / path_of(ENTRY["file"]))
        return importlib.machinery.ModuleSpec(name, self, origin=file)

    def exec_module(self, module: ModuleType) -> None:
        module.__file__ = module.__spec__.origin if module.__spec__ else None
        exec(compile(edited(ENTRY), str(module.__file__), "exec"), module.__dict__)


sys.meta_path.insert(0, Edited())
