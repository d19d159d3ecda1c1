"""xarray without the libraries of other arrays, which commands do not use and which take half a second to import."""

from __future__ import annotations

import sys
from contextlib import suppress
from typing import Any

LIBRARIES: tuple[Any, ...] = ("cubed", "cupy", "dask", "pint", "sparse")


def plain_arrays() -> None:
    """Lets xarray believe that those that are not imported yet are not installed.

    Without effect if xarray no longer keeps them where it did.
    """
    with suppress(ImportError, AttributeError, TypeError):
        from packaging.version import Version
        from xarray.namedarray import pycompat

        absent = pycompat.DuckArrayModule.__new__(pycompat.DuckArrayModule)
        absent.module, absent.version, absent.type, absent.available = None, Version("0"), (), False
        for name in LIBRARIES:
            if name not in sys.modules:
                pycompat._cached_duck_array_modules.setdefault(name, absent)
