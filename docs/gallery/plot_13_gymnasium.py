"""
Gains by trial and error, in Gymnasium
======================================

200 copies of the environment at once, each with its own PD gains, which are judged only by the motion of the mass in an
episode. The dashed line is the return of the paper's controller on the same episode.
"""

import fracgyro as fg
import fracgyro.interop.gymnasium
import gymnasium
import matplotlib.pyplot as plt
import numpy as np

scenario = fg.Scenario.paper().replace({"controller.force_limit": 1000.0, "run.duration": 3.0})
count, words = 200, {"vectorization_mode": "vector_entry_point", "scenario": scenario}
envs = gymnasium.make_vec("fracgyro/Tracking-v0", num_envs=count, **words)
kp, kd = 10 ** np.random.default_rng(0).uniform([[3.0], [1.0]], [[6.0], [3.0]], (2, count))
seen, info = envs.reset(seed=[1] * count)
returns = np.zeros(count)
for _ in range(3000):
    error, rate = seen[:, :2] - seen[:, 2:4], seen[:, 8:] - seen[:, 4:6]
    force = seen[:, 6:8] - kp[:, None] * error - kd[:, None] * rate
    seen, reward, lost, ended, info = envs.step(np.clip(force / 1000.0, -1.0, 1.0).astype(np.float32))
    returns += reward
env = gymnasium.make("fracgyro/Tracking-v0", scenario=scenario)
env.reset(seed=1)
paper = -float((fg.simulate(env.unwrapped.scenario)["error"][1:] ** 2).sum())

figure, panel = plt.subplots(figsize=(7, 4), layout="constrained")
dots = panel.scatter(kp, -returns, c=np.log10(kd), s=12)
panel.axhline(-paper, color="k", linestyle="--")
panel.set(xscale="log", yscale="log", xlabel="proportional gain", ylabel="minus the return")
figure.colorbar(dots, label="log10 of the derivative gain")
