"""fracgyro: robust adaptive fractional fast terminal sliding-mode control of MEMS gyroscopes.

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
    """Loads a name of __init__.pyi on first use."""
    if name == "__version__":
        from importlib.metadata import version

        return version(__name__)
    found = _load(name)
    if "xarray" in sys.modules:
        import_module(".analysis.accessor", __name__)  # registers `run.fracgyro` for Datasets
    return found
