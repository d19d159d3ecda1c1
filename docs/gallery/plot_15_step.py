"""
The step response of several controllers
========================================

The reference is a step of 1 µm on both axes. ``fg.metrics.step_response`` has overshoot, rise time, settling
time and final error of each axis.
"""

import fracgyro as fg

step = {"kind": "step", "start": 0.1}
short = {"initial_position": (0.0, 0.0), "duration": 0.4, "units": "SI"}
runs = {}
for kind in ("pid", "disturbance_rejection", "nonsingular_terminal"):
    scenario = fg.Scenario(reference=step, controller={"kind": kind}, run=short)
    runs[kind] = fg.simulate(scenario)
    found = fg.metrics.step_response(runs[kind]).sel(axis="x")
    print(f"{kind}: overshoot {100 * found.overshoot:.2f} %, settled after {1e6 * found.settling_time:.0f} µs")
fg.plot(runs, channels=["position", "control"])
