"""A scenario as something that runs elsewhere: in a simulation tool, in a browser, on a microcontroller."""

from ..extras import public

__getattr__, __dir__, __all__ = public(__name__, __file__, "export")
