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
    turns = lathe.advance(40_000).reshape(200, 200, -1)  # of 0.02 s, 200 samples
    time, tool = turns[:, 0, 0], turns[:, :, 2] * 1e6
    axis.fill_between(time, tool.min(axis=1), tool.max(axis=1))  # from end to end of each turn
    axis.set_title(f'a knock of {impulse * 1e3:g} mN s', loc='left')
    axis.set_ylabel('tool / um')
axes[-1].set_xlabel('time / s')
lc.show_figure('knock')
