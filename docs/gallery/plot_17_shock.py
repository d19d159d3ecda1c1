"""
Shock and vibration
===================

Disturbances add up: a shock of 20 g at 5 ms during random vibration with a given spectrum. Values have units.
"""

import fracgyro as fg

shock = {"kind": "pulse", "amplitude": ["20 g", 0], "start": "5 ms", "width": "0.5 ms"}
vibration = {"kind": "vibration", "psd": [["20 Hz", "0.002 g^2/Hz"], ["2 kHz", "0.002 g^2/Hz"]]}
added = [{"quantity": "acceleration", **each} for each in (vibration, shock)]
run = fg.simulate(fg.Scenario.paper().replace({"disturbance": added, "run.duration": "10 ms", "run.units": "SI"}))
fg.plot(run, channels=["disturbance", "error", "control"])
