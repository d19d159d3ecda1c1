"""Cases that `make test` leaves to `make test-nightly`: those that rarely fail where the others pass."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import pytest


def nightly_unless(always: Callable[..., bool], cases: Iterable[Any]) -> list[Any]:
    """Cases for `parametrize`, of which `make test` runs those that `always` chooses.

    A case of several values is a tuple, and `always` gets them one by one.
    """
    found = []
    for case in cases:
        values = case if isinstance(case, tuple) else (case,)
        found.append(pytest.param(*values, marks=() if always(*values) else pytest.mark.nightly))
    return found
