"""
The frequency response of your own law, from a chirp
====================================================

A chirp sweeps through all frequencies in one run. ``fg.metrics.frequency_response`` returns gain, phase and coherence
from the reference to the position, and ``fg.plot`` draws a Bode plot of them.
"""

import fracgyro as fg


def law(s):
    return [-1600 * e - 40 * v for e, v in zip(s.error, s.velocity, strict=True)]


chirp = {"kind": "chirp", "frequency": (1.0, 1.0), "final_frequency": (150.0, 150.0), "end": 20.0}
run = fg.simulate(fg.Scenario(reference=chirp, run={"duration": 20.0}), controller=law)
fg.plot(fg.metrics.frequency_response(run))
