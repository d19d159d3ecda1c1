"""
Allan deviation of a record
===========================

The record is synthetic: an hour at 100 samples a second with an angle random walk of 0.12 deg/√h, a
bias instability of 7.2 deg/h and a rate random walk of 86 deg/h/√h. ``analyze_record`` reads any CSV file of a
gyroscope at rest and finds the three, with intervals.
"""

from tempfile import mkdtemp

import fracgyro as fg
import matplotlib.pyplot as plt
import numpy as np

noise, samples, interval = np.random.default_rng(1), 360_000, 0.01
w = 2 * np.pi * np.fft.rfftfreq(samples, interval)[1:]
density = 0.002**2 + 0.002**2 / w + (4e-4 / w) ** 2  # N, B and K, in degrees and seconds
spectrum = (noise.normal(size=(2, len(w))).T @ [1, 1j]) * np.sqrt(density * samples / interval / 2)
record = mkdtemp() + "/synthetic.csv"
np.savetxt(record, np.fft.irfft([0, *spectrum], samples), header="rate", fmt="%.6f")

figures, content = fg.rate.analyze_record(record, rate=1 / interval, unit="deg/s")
for figure in figures:
    print(f"{figure.name}: {figure.value:.3g} [{figure.low:.3g}, {figure.high:.3g}] {figure.unit}")

tau = content["averaging_time_s"]
picture, panel = plt.subplots(figsize=(7, 4), layout="constrained")
panel.fill_between(tau, content["low_deg_per_h"], content["high_deg_per_h"], alpha=0.25, label="95 % interval")
panel.loglog(tau, content["deviation_deg_per_h"], "o-", label="Allan deviation")
panel.set(xlabel="averaging time (s)", ylabel="Allan deviation (deg/h)")
panel.legend()
