"""The gyroscope as a rate sensor: `fracgyro rate`, in the terms of IEEE Std 1431 and 952. Page one: characterise.py."""

from ..extras import public

__getattr__, __dir__, __all__ = public(__name__, __file__, "rate")
