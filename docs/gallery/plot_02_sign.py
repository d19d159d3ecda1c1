"""
Printed and corrected: the effect of a sign error
=================================================

With the sign that the paper prints in eq. (44), the law for the angular rate moves only a symmetric part, which a rate
does not have: the estimate stays at its initial value. With the sign corrected it moves, initially by hundreds of times
the rate. Least squares alongside the laws, ``composite``, find the rate within a few units of time.
"""

import fracgyro as fg
import matplotlib.pyplot as plt

scenarios = {
    "as printed": fg.Scenario.paper("printed"),
    "corrected": fg.Scenario.paper("corrected"),
    "corrected, with least squares": fg.Scenario.paper().replace({"adaptation.kind": "composite"}),
}
figure, panels = plt.subplots(3, 1, figsize=(7, 6), layout="constrained", sharex=True)
for panel, (name, scenario) in zip(panels, scenarios.items(), strict=True):
    run = fg.simulate(scenario.replace({"run.record_every": 20}))
    panel.plot(run["time"], run["rate_estimate"], label="estimate")
    panel.axhline(float(fg.metrics.true_rate(run)), color="black", linestyle=":", label="true")
    panel.set(title=name, ylabel="angular rate", ylim=(0.0, 0.2))
panels[0].legend()
panels[2].set_xlabel("time (nondimensional)")
