"""
A gyroscope as a rate sensor: its datasheet
===========================================

``fg.rate.characterise`` puts a device on a simulated rate table: scale factor, noise, bandwidth and more. Here it is
shortened: two noise seeds, short runs, a short record at rest. Figures that were not observed are only bounded. It also
writes a report with intervals and pictures.
"""

import math
from tempfile import mkdtemp

import fracgyro as fg
import matplotlib.pyplot as plt

device = fg.Scenario.shipped("dual_mass").replace({"run.duration": 1500.0})
figures = fg.rate.characterise(device, mkdtemp() + "/report", quick=True, rest=0.5)

rows = []
for each in figures:
    bounds = {"": each.value, "≥ ": each.low, "≤ ": each.high}
    shown = [f"{sign}{bound:.2g}" for sign, bound in bounds.items() if math.isfinite(bound)]
    rows.append([each.name, shown[0] if shown else "–", each.unit])
picture, panel = plt.subplots(figsize=(7, 4), layout="constrained")
panel.axis("off")
table = panel.table(rows, colLabels=["figure", "value", "unit"], cellLoc="left", loc="center")
table.scale(1, 1.5)
