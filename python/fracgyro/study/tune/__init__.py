"""A tuning: the best parameters that a search finds, judged on seeds that it has not seen."""

from .run import Tuned, tune

__all__ = ["Tuned", "tune"]
