"""
What the monitor knows, and when
================================

The detector of the monitor, without ROS: blocks of samples in, an estimate out. It is fed the two
displacements and the spindle's angle, with the noise of a sensor.
"""

import matplotlib.pyplot as plt
import numpy as np

import lathe_chatter as lc

lathe = lc.VirtualLathe(
    cut=lc.Cut(depth_of_cut=0.0005, bearing_contact='none', sensor_noise=5e-9, force_noise=1e-4)
)
detector = lc.ChatterDetector(lathe.machine)
times, tool, growth, flagged = [], [], [], []
for block in range(400):  # 20 ms each
    if block == 150:  # at 3 s
        lathe.retune(lathe.cut.with_changes(depth_of_cut=0.0008))
    samples = lathe.advance(200)
    estimate = detector.update(samples, lathe.columns)
    times.append(estimate.time)
    tool.append(np.ptp(samples[:, 2]) * 1e6)
    growth.append(estimate.growth_rate)
    flagged.append(estimate.chatter)

figure, axes = plt.subplots(2, sharex=True, figsize=(8, 4.5), layout='constrained')
axes[0].semilogy(times, tool)
axes[0].set_ylabel('tool, peak to\npeak / um')
axes[1].plot(times, growth)
axes[1].set_ylabel('growth rate / (1/s)')
axes[1].set_xlabel('time / s')
for axis in axes:
    axis.fill_between(times, 0, 1, flagged, transform=axis.get_xaxis_transform(), alpha=0.2)
print(estimate.advice.in_words())
lc.show_figure('detector')
