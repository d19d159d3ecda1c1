"""What the paper, the rate sensor and studies share: metrics, intervals, pictures, pages."""

from ..extras import public

__getattr__, __dir__, __all__ = public(__name__, __file__, "report")
