"""
A fractional PID in python-control
==================================

kp + ki/s^0.8 + kd s^0.9 as a sampled linear system, from values only. Its frequency response follows the ideal one; the
error grows with the frequency, because lines or parabolas replace the signal between samples. Its state space
closes a loop with the gyroscope's first axis.
"""

import control as ct
import fracgyro as fg
import matplotlib.pyplot as plt
import numpy as np

step, w = 1e-3, np.geomspace(0.1, 1000.0, 300)
gains = {"kp": 1000.0, "ki": 20000.0, "lam": 0.8, "kd": 200.0, "mu": 0.9}
ideal = 1000.0 + 20000.0 * (1j * w) ** -0.8 + 200.0 * (1j * w) ** 0.9
figure, (size, error, answer) = plt.subplots(1, 3, figsize=(10, 3.5), layout="constrained")
size.loglog(w, abs(ideal), "k:", label="ideal")
plant = fg.interop.control.plant(fg.Scenario.paper())
for between, color in (("lines", "C0"), ("parabolas", "C1")):
    pid = fg.fractional.pid(**gains, step=step, longest=100.0, between=between)
    controller = ct.ss(*pid.state_space())
    response = controller(np.exp(1j * w * step))
    size.loglog(w, abs(response), color=color, label=between)
    error.loglog(w, abs(response / ideal - 1.0), color=color)
    loop = ct.feedback(controller * plant[0, 0])
    answer.plot(*ct.step_response(loop, step * np.arange(1500)), color=color)
size.set(xlabel="angular frequency (1/time)", ylabel="gain")
error.set(xlabel="angular frequency (1/time)", ylabel="relative error")
answer.set(xlabel="time", ylabel="x for a unit step")
size.legend()
