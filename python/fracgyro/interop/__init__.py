"""Scenarios and runs as objects of other libraries, one module per library."""

from ..extras import public

__getattr__, __dir__, __all__ = public(__name__, __file__, "interop")
