"""Export of scenarios to simulation tools, browsers, microcontrollers, MATLAB and FPGAs."""

from ..extras import public

__getattr__, __dir__, __all__ = public(__name__, __file__, "export")
