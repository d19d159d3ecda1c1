"""The gyroscope of a scenario for scipy.signal."""

from __future__ import annotations

from scipy import signal

from ..scenario import Scenario
from .matrices import matrices

__all__ = ["plant"]


def plant(scenario: Scenario, *, sampled: bool = True) -> signal.dlti | signal.lti:
    """The ideal gyroscope: inputs u_x, u_y; states and outputs x, y, vx, vy; all nondimensional.

    It has no disturbance, no device imperfections, and the constant rate plant.angular_rate. `sampled`: a dlti with dt
    = run.step, exact for a zero-order-hold force; otherwise an lti. Raises TypeError if `scenario` is not a Scenario.

    >>> fg.interop.scipy.plant(fg.Scenario.paper()).dt
    0.001
    """
    found = matrices(scenario, sampled)
    return signal.dlti(*found, dt=scenario.run.step) if sampled else signal.lti(*found)
