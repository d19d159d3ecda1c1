"""
Tracking a dynamic rate
=======================

The dual-mass device from the literature, with noisy pick-offs that measure positions only. The rate to be sensed is a
sine of 20 Hz. The Kalman filter, ``adaptation.kind = "joint"``, follows it with its bandwidth of 100 Hz and states its
own standard deviation.
"""

import fracgyro as fg
import matplotlib.pyplot as plt
import numpy as np

turning = {"rate.kind": "sine", "rate.amplitude": 1.0, "rate.frequency": 2 * np.pi * 20}  # both rad/s
others = {"run.units": "SI", "run.duration": 4000.0, "run.record_every": 20, "plant.angular_rate": 0.0}
run = fg.simulate(fg.Scenario.shipped("dual_mass").replace({**turning, **others}))

time, estimate, band = 1e3 * run["time"], run["rate_estimate"], 2 * run["rate_deviation"]
figure, panel = plt.subplots(figsize=(7, 4), layout="constrained")
panel.fill_between(time, estimate - band, estimate + band, alpha=0.25)
panel.plot(time, estimate, label="estimate ± 2σ")
panel.plot(time, run["angular_rate"], "k:", label="true")
panel.set(xlabel="time (ms)", ylabel="angular rate (rad/s)", ylim=(-1.5, 1.5))
panel.legend()
