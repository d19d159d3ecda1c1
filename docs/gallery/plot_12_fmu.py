"""
The FMU in FMPy: the same numbers
=================================

The closed loop is exported as an FMU for co-simulation, which Simulink, OpenModelica and others import. FMPy runs it
here, and every bit equals ``fg.simulate``. Compiling the FMU needs a C++ compiler.
"""

from tempfile import mkdtemp

import fmpy
import fracgyro as fg
import matplotlib.pyplot as plt

scenario = fg.Scenario.shipped("hardware").replace({"run.duration": 10.0})
path = mkdtemp() + "/gyro.fmu"
fg.export.fmu(scenario, path)
result = fmpy.simulate_fmu(path, stop_time=10.0, output_interval=0.001, output=["position.x", "position.y"])
run = fg.simulate(scenario)
print("the same to the bit:", bool((result["position.x"] == run["position"][:, 0].values).all()))

figure, panel = plt.subplots(figsize=(7, 4), layout="constrained")
panel.plot(run["time"], run["position"], label=["x, fg.simulate", "y, fg.simulate"])
panel.plot(result["time"][::100], result["position.x"][::100], "k.", label="x, FMU")
panel.set(xlabel="time (nondimensional)", ylabel="position (q0)")
figure.legend(loc="outside upper center", ncols=3)
