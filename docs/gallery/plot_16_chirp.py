"""
The frequency response of your own law, from a chirp
====================================================

A chirp sweeps through all frequencies in one run. ``fg.metrics.frequency_response`` returns gain, phase and coherence
from the reference to the position.
"""

import fracgyro as fg
import matplotlib.pyplot as plt
import numpy as np


def law(s):
    return [-1600 * e - 40 * v for e, v in zip(s.error, s.velocity, strict=True)]


chirp = {"kind": "chirp", "frequency": (1.0, 1.0), "final_frequency": (150.0, 150.0), "end": 20.0}
run = fg.simulate(fg.Scenario(reference=chirp, run={"duration": 20.0}), controller=law)
response = fg.metrics.frequency_response(run)
figure, (gain, phase) = plt.subplots(2, 1, sharex=True, figsize=(6.0, 4.0), layout="constrained")
for axis in ("x", "y"):
    gain.loglog(response.frequency, response.gain.sel(axis=axis), label=axis)
    phase.semilogx(response.frequency, np.degrees(np.unwrap(response.phase.sel(axis=axis))), label=axis)
gain.set(ylabel="gain")
phase.set(xlabel="frequency (ω0)", ylabel="phase (deg)")
gain.legend()
