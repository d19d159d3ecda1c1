"""fracgyro: the robust adaptive fractional fast terminal sliding mode controller for MEMS gyroscopes.

    import fracgyro as fg
    run = fg.simulate(fg.Scenario.paper())
    fg.metrics.rmse(run, window=(10, None))

Equation numbers throughout are those of Complexity 2020, article 8542961; EQUATIONS.md lists them all.
"""

from importlib.metadata import version

from . import fractional, metrics, native
from ._core import Motion, Sample
from .controller import Controller
from .measure import measure_many
from .outside import ControllerError
from .plant import Loop, Plant
from .scenario import Scenario, ScenarioError
from .simulate import DivergedError, simulate, simulate_many

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
    "simulate",
    "simulate_many",
]
