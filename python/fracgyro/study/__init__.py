"""Studies: many scenarios from one file.

Reading order: space.py (which fields vary); sweep.py, page one of `fracgyro sweep`; tune.py, that of `fracgyro tune`.
"""
