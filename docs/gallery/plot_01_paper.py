"""
The paper's run in five lines
=============================

The mass follows its reference on both axes. The third panel is the control force, the last one the rate estimate, which
remains some percent off with the paper's corrected law.
"""

import fracgyro as fg

run = fg.simulate(fg.Scenario.paper())
fg.plot(run)
print("steady RMS error of x and y:", fg.metrics.rmse(run, window=(10, None)).values)
