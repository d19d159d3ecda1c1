"""fracgyro: the robust adaptive fractional fast terminal sliding mode controller for MEMS gyroscopes.

    import fracgyro as fg
    run = fg.simulate(fg.Scenario.paper())
    fg.metrics.rmse(run, window=(10, None))

Equation numbers throughout are those of Complexity 2020, article 8542961; EQUATIONS.md lists them all.
"""

from importlib.metadata import version

from . import fractional, metrics
from .controller import Controller
from .scenario import Scenario, ScenarioError
from .simulate import DivergedError, simulate, simulate_many

__version__ = version("fracgyro")
__all__ = [
    "Controller",
    "DivergedError",
    "Scenario",
    "ScenarioError",
    "__version__",
    "fractional",
    "metrics",
    "simulate",
    "simulate_many",
]
