"""
References of every kind
========================

The mass follows a sine, a sum of sines, a step, a ramp, a chirp, a staircase or a table, one kind for each axis. Steps,
ramps and staircases may be smoothed, so that velocity and acceleration are finite.
"""

import fracgyro as fg
import matplotlib.pyplot as plt

KINDS = {
    "sine": {"offset": (0.5, 0.0), "amplitude": (0.5, 0.0), "frequency": (1.5, 0.0)},
    "sines": {"terms": [{"amplitude": (0.7, 0.0), "frequency": (f, 0.0)} for f in (1.0, 1.3)]},
    "step": {"start": 2.0, "end": 14.0, "smoothing": 0.3},
    "ramp": {"slope": (0.1, 0.0), "start": 2.0, "end": 14.0, "smoothing": 0.5},
    "chirp": {"frequency": (0.5, 0.0), "final_frequency": (6.0, 0.0), "end": 20.0},
    "staircase": {"amplitude": (0.25, 0.0), "start": 2.0, "hold": 4.0, "levels": 4, "smoothing": 0.3},
    "table": {"points": [[0, 0.0, 0], [4, 1.0, 0], [7, 0.4, 0], [12, 0.6, 0], [16, -0.3, 0]]},
    "rest": {"offset": (0.5, 0.0)},
}
figure, panels = plt.subplots(2, 4, figsize=(7.0, 3.2), sharex=True, sharey=True, layout="constrained")
for panel, (kind, fields) in zip(panels.flat, KINDS.items(), strict=True):
    reference = {"kind": [kind, "rest"], **fields}
    run = fg.simulate(fg.Scenario(reference=reference, run={"duration": 20.0, "record_every": 20}))
    panel.plot(run["time"], run["reference"].sel(axis="x"))
    panel.set_title(kind, fontsize=9)
    panel.grid(True, linewidth=0.3)
figure.supxlabel("time (1/ω0)", fontsize=9)
figure.supylabel("reference of x (q0)", fontsize=9)
