"""The board: any law, run through the task `track` in a closed process, and its result as entry.json.

Reading order: enter.py is the entry point of `fracgyro enter`; entrant.py (who enters), room.py, inside.py and
guard.py (the process of the law, seen from outside and from inside), trial.py (the work in it), entry.py (the file),
check.py, page.py and chart.py (the page of all entries).
"""
