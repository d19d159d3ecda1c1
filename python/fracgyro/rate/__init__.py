"""The gyroscope as a rate sensor, in the terms of IEEE Std 1431 and 952. Entry point: characterise.py."""

from ..extras import public

__getattr__, __dir__, __all__ = public(__name__, __file__, "rate")
