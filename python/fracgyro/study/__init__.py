"""Studies: many scenarios from one file.

Reading order: space.py (which fields vary), controller.py, file.py, folder.py; then sweep/run.py, the entry point of
`fracgyro sweep`, and tune/run.py, the entry point of `fracgyro tune`.
"""

from ..extras import public

__getattr__, __dir__, __all__ = public(__name__, __file__, "study")
