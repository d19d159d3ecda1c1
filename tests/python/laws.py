"""Controllers as C functions, for tests of user controllers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest


def by_numba(function: Callable[[Any, Any, Any, Any], None]) -> Any:
    """The function (in, state, parameters, out), compiled. Skip the test if Numba is missing."""
    numba = pytest.importorskip("numba", reason="this Python has no Numba, which the test extra asks for up to 3.14")
    pointer = numba.types.CPointer(numba.types.double)
    return numba.cfunc(numba.types.void(pointer, pointer, pointer, pointer))(function)
