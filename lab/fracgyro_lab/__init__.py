"""The paper reproduced and controllers compared, with what the library offers.

    import fracgyro_lab as lab
    lab.reproduce("out")
    lab.compare("track", "comparison")

The library imports nothing of this package; `fracgyro reproduce` and `fracgyro compare` are registered as entry points.
"""

from fracgyro.extras import public

__getattr__, __dir__, __all__ = public(__name__, __file__, "report")
