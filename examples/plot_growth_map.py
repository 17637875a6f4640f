"""
How fast it grows
=================

The growth rate is the real part of the rightmost characteristic root. The chart says yes or no;
the map says how long an operator has.
"""

import matplotlib.pyplot as plt
import numpy as np

import lathe_chatter as lc

cut = lc.Cut(bearing_contact='none')
speeds, depths = np.linspace(1500.0, 8000.0, 131), np.linspace(1e-4, 1.5e-3, 57)
growth = lc.growth_map(lc.Machine(), cut, speeds, depths)

figure, axes = plt.subplots(figsize=(8, 4.5), layout='constrained')
largest = np.abs(growth.growth_rate).max()
mesh = axes.pcolormesh(
    speeds, depths * 1e3, growth.growth_rate, cmap='RdBu_r', vmin=-largest, vmax=largest
)
axes.contour(speeds, depths * 1e3, growth.growth_rate, levels=[0.0], colors='black')
figure.colorbar(mesh, label='growth rate / (1/s)')
axes.set_xlabel('spindle speed / (rev/min)')
axes.set_ylabel('depth of cut / mm')
lc.show_figure('growth_map')
