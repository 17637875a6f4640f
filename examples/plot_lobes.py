"""
The stability chart and its third line
======================================

Below both limits a cut is stable. Between them a clearance decides: above the seating line, the
dotted one, the mean force closes it, and the limit of the machine on its bearing holds.
"""

import matplotlib.pyplot as plt

import lathe_chatter as lc

cut = lc.Cut(spindle_speed_rpm=3000.0, depth_of_cut=0.00062, bearing_clearance=5e-6)
figure, axes = plt.subplots(figsize=(8, 4.5), layout='constrained')
lc.plot_lobes(lc.Machine(), cut, axes=axes)
for seated in (False, True):
    limit = lc.critical_depth(lc.Machine(), 3000.0, seated=seated)
    name = 'seated' if seated else 'open'
    print(f'{name}: {limit * 1e3:.4f} mm at 3000 rev/min')
lc.show_figure('lobes')
