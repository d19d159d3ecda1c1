"""The compiled part; its docstrings are in bindings/."""

from typing import Any

def __getattr__(name: str) -> Any: ...
