"""Controllers compared: each tuned with the same effort, all judged on seeds and plants that no tuning saw.

Reading order: run.py is page one of `fracgyro compare`; contender.py, track_contenders.py (who takes part), track.py
(what the task is), tuning.py, judging.py (the work), workers.py (where it is done), rows.py, report.py.
"""

from fracgyro.extras import public

__getattr__, __dir__, __all__ = public(__name__, __file__, "study")
