"""Runs of a scenario or a user's controller in the compiled loop: recorded, measured or step by step."""

from ..extras import public

__getattr__, __dir__, __all__ = public(__name__, __file__, "report")
