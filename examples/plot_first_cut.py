"""
A cut that dies out and one that chatters
=========================================

The same lathe at two depths of cut. In the deeper one each turn leaves larger waves than it met,
until the tool begins to leave the cut, which bounds them.
"""

import matplotlib.pyplot as plt

import lathe_chatter as lc

figure, axes = plt.subplots(2, sharex=True, figsize=(8, 4), layout='constrained')
for axis, depth in zip(axes, (0.0005, 0.001)):
    cut = lc.Cut(spindle_speed_rpm=3000.0, depth_of_cut=depth, bearing_contact='none')
    lathe = lc.VirtualLathe(cut=cut)
    samples = lathe.advance(10_000)  # 1 s: columns time, angle, tool displacement ...
    axis.plot(samples[:, 0], samples[:, 2] * 1e6, linewidth=0.5)
    axis.set_ylabel('tool / um')
    axis.set_title(f'{depth * 1e3:.1f} mm deep', loc='left')
axes[-1].set_xlabel('time / s')
lc.show_figure('first_cut')
