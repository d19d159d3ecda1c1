"""Fractional operators: in fixed memory as in the controller, and the full-history references that check them."""

from . import full_history
from .kernel import ExponentialSum, design
from .operators import caputo, integral, riemann_liouville

__all__ = ["ExponentialSum", "caputo", "design", "full_history", "integral", "riemann_liouville"]
