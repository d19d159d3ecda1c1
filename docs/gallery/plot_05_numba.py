"""
The same in numba: on all processors, without Python
====================================================

A function that numba has compiled runs as fast as the controllers of the package. Its parameters have names, so a
study can vary them: here the stiffness, over a decade, with 8 noise seeds each.
"""

import fracgyro as fg
import matplotlib.pyplot as plt
import numba
import numpy as np

doubles = numba.types.CPointer(numba.types.float64)


@numba.cfunc(numba.void(doubles, doubles, doubles, doubles))
def pd(given, state, parameters, out):  # given: time, then x and y of position, velocity, reference, its velocity
    for i in range(2):
        out[i] = -parameters[0] * (given[1 + i] - given[5 + i]) - parameters[1] * (given[3 + i] - given[7 + i])


scenario = fg.Scenario.paper().replace({"run.duration": 20.0})
stiffness = np.geomspace(1e4, 1e5, 12)
laws = [fg.native.Law(pd, parameters={"kp": kp, "kd": 2 * kp**0.5}) for kp in stiffness]
runs = fg.measure_many([scenario] * len(laws), seeds=range(8), controller=laws)
error = runs["rmse"].sel(window="steady").values.reshape(len(laws), 8, 2).mean(axis=1)
figure, panel = plt.subplots(figsize=(7, 4), layout="constrained")
panel.loglog(stiffness, error, "o-", label=["x", "y"])
panel.set(xlabel="stiffness kp (nondimensional)", ylabel="steady RMS error (q0)")
panel.legend()
