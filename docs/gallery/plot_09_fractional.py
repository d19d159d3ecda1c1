"""
A fractional derivative with a certified error
==============================================

Caputo's derivative of order 0.9 of t³, which is known in closed form. The package's operator needs
constant memory; its kernel has a certified error of at most 1e-9. Grünwald-Letnikov's sum needs the
whole history and is of first order in the step.
"""

import fracgyro as fg
import matplotlib.pyplot as plt
import numpy as np
from scipy.special import gamma

order = 0.9
figure, panel = plt.subplots(figsize=(7, 4), layout="constrained")
for step, style in ((1e-2, "--"), (1e-3, "-")):
    t = np.arange(0.0, 10.0, step)
    exact = gamma(4) / gamma(4 - order) * t ** (3 - order)  # for t^3
    modes = fg.fractional.caputo(t**3, 3 * t**2, step, order)
    summed = fg.fractional.full_history.grunwald_letnikov(t**3, step, order)
    for name, found, color in (("fracgyro", modes, "C0"), ("Grünwald-Letnikov", summed, "C1")):
        panel.loglog(t[1:], abs(found - exact)[1:] / exact[1:], style, color=color, label=f"{name}, step {step:g}")
panel.set(xlabel="t", ylabel="relative error")
panel.legend()
