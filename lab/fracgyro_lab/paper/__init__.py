"""Reproduction of the paper. Entry point: reproduce.py."""

from fracgyro.extras import public

__getattr__, __dir__, __all__ = public(__name__, __file__, "report")
