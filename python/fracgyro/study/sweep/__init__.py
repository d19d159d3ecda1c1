"""A sweep: every point of a design with every seed -> rows of metrics and their summary."""

from .run import Sweep, sweep

__all__ = ["Sweep", "sweep"]
