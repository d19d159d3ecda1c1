"""
Tune gains under constraints
============================

A search over two settings of the paper's controller: less steady error on x, for no more force and no more chattering.
The winner is judged on noise seeds that the search did not see. A real search takes hundreds of trials and minutes.
"""

from pathlib import Path
from tempfile import mkdtemp

import fracgyro as fg
import matplotlib.pyplot as plt
import pandas as pd

folder = Path(mkdtemp())
(folder / "gains.toml").write_text("""seeds = 2
fixed.run.duration = 20.0
vary.controller.order = { low = 0.8, high = 1.0 }
vary.controller.layer_thickness = { low = 0.03, high = 0.5, scale = "log" }
tune = { trials = 30, held_out_seeds = 20 }
objective = [{ metric = "rmse_steady_x" }]
constraint = [{ metric = "effort_x", at_most_base = 1.0 }, { metric = "chattering_x", at_most_base = 1.0 }]""")
tuned = fg.study.tune(folder / "gains.toml", folder / "out")
objective = tuned.held_out.objectives[0]
print(f"on unseen seeds {objective.tuned / objective.base:.0%} of the paper's error: {objective.verdict}")

trials = pd.read_csv(folder / "out" / "trials.csv")
figure, panel = plt.subplots(figsize=(7, 4), layout="constrained")
for kept, mark in ((True, "o"), (False, "x")):
    some = trials[trials["feasible"] == kept].to_dict("list")
    error = some["mean of rmse_steady_x over base"]
    place = some["controller.order"], some["controller.layer_thickness"]
    points = panel.scatter(*place, c=error, marker=mark, vmin=0, vmax=1.5)
panel.set(xlabel="order α", ylabel="layer thickness δ", yscale="log", title="crosses: a constraint is broken")
figure.colorbar(points, label="steady error of x over the paper's")
