"""
A knock that lasts
==================

At 3000 rev/min, 0.65 mm and a clearance of 10 um every small disturbance dies out. A larger one
makes the workpiece touch its bearing in every swing, and the machine is another one.
"""

import matplotlib.pyplot as plt

import lathe_chatter as lc

cut = lc.Cut(depth_of_cut=0.00065, bearing_clearance=1e-5)
figure, axes = plt.subplots(2, sharex=True, sharey=True, figsize=(8, 4), layout='constrained')
for axis, impulse in zip(axes, (0.0006, 0.002)):
    lathe = lc.VirtualLathe(cut=cut)
    lathe.advance(20_000)  # 2 s, in which the start dies out
    lathe.knock(impulse)  # N s on the tool
    samples = lathe.advance(40_000)
    axis.plot(samples[:, 0], samples[:, 2] * 1e6, linewidth=0.4)
    axis.set_title(f'a knock of {impulse * 1e3:g} mN s', loc='left')
    axis.set_ylabel('tool / um')
axes[-1].set_xlabel('time / s')
lc.show_figure('knock')
