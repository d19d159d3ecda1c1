"""Fractional operators: in fixed memory as in the controller, and full-history references to check them."""

from ..extras import public

__getattr__, __dir__, __all__ = public(__name__, __file__, "report")
