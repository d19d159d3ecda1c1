"""fracgyro: the robust adaptive fractional fast terminal sliding mode controller for MEMS gyroscopes.

    import fracgyro as fg
    run = fg.simulate(fg.Scenario.paper())
    fg.metrics.rmse(run, window=(10, None))

Equation numbers throughout are those of Complexity 2020, article 8542961; EQUATIONS.md lists them all.
"""

from importlib import import_module
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

from . import fractional
from ._core import Motion, Sample
from .analysis import metrics
from .scenario import Scenario, ScenarioError
from .simulation import native
from .simulation.controller import Controller
from .simulation.measure import measure_many
from .simulation.outside import ControllerError
from .simulation.plant import Loop, Plant
from .simulation.simulate import DivergedError, simulate, simulate_many

if TYPE_CHECKING:
    from . import rate, study

__version__ = version("fracgyro")
__all__ = [
    "Controller",
    "ControllerError",
    "DivergedError",
    "Loop",
    "Motion",
    "Plant",
    "Sample",
    "Scenario",
    "ScenarioError",
    "__version__",
    "fractional",
    "measure_many",
    "metrics",
    "native",
    "rate",
    "simulate",
    "simulate_many",
    "study",
]


def __getattr__(name: str) -> Any:
    """Rooms that take long to import, or need much, when they are first asked for."""
    if name in ("rate", "study"):
        return import_module(f".{name}", __name__)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
