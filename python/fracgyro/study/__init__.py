"""Studies: many scenarios from one file.

Reading order: space.py (which fields vary), file.py, folder.py; then sweep/run.py, page one of `fracgyro sweep`, and
tune/run.py, that of `fracgyro tune`.
"""
