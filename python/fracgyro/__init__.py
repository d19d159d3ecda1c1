"""fracgyro: the robust adaptive fractional fast terminal sliding mode controller for MEMS gyroscopes.

    import fracgyro as fg
    run = fg.simulate(fg.Scenario.paper())
    fg.metrics.rmse(run, window=(10, None))

Equation numbers throughout are those of Complexity 2020, article 8542961; EQUATIONS.md lists them all.
"""

import sys
from importlib import import_module
from typing import Any

from .extras import public

_load, __dir__, __all__ = public(__name__, __file__, "report")


def __getattr__(name: str) -> Any:
    """What __init__.pyi lists, loaded when it is first asked for."""
    if name == "__version__":
        from importlib.metadata import version

        return version(__name__)
    found = _load(name)
    if "xarray" in sys.modules:
        import_module(".analysis.accessor", __name__)  # Datasets have `run.fracgyro` from now on
    return found
