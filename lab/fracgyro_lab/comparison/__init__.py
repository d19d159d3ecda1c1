"""Comparison of controllers: each tuned with the same effort, all evaluated on unseen seeds and plants.

Reading order: run.py is the entry point of `fracgyro compare`; contender.py, track_contenders.py (the contenders),
track.py (the task), tuning.py, judging.py (the work), workers.py (processes), rows.py, report.py.
"""

from fracgyro.extras import public

__getattr__, __dir__, __all__ = public(__name__, __file__, "study")
