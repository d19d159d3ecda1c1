"""Analysis shared by the paper, the rate sensor and studies: metrics, confidence intervals, plots, HTML pages."""

from ..extras import public

__getattr__, __dir__, __all__ = public(__name__, __file__, "report")
