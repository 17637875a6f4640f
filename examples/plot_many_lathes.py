"""
Many lathes at once
===================

Eighty lathes that differ in their depth of cut, cut in one call on all cores. Once in every turn
the tool is looked at: a stable cut gives a point, chatter a cloud.
"""

import matplotlib.pyplot as plt
import numpy as np

import lathe_chatter as lc

depths = np.linspace(3e-4, 1.2e-3, 80)
cuts = [lc.Cut(3000.0, depth, bearing_contact='none') for depth in depths]
sweep = lc.LatheSweep(lc.VirtualLathe(cut=cut) for cut in cuts)
sweep.advance(60_000, columns=['time'])  # 6 s in which what is stable comes to rest
samples = sweep.advance(200 * 40, columns=['tool_displacement'])  # 40 turns of 200 samples
once_per_turn = samples[::200, :, 0] * 1e6  # um

figure, axes = plt.subplots(figsize=(8, 4.5), layout='constrained')
axes.plot(np.tile(depths * 1e3, (len(once_per_turn), 1)), once_per_turn, 'k.', markersize=1.5)
limit = lc.critical_depth(lc.Machine(), 3000.0, seated=False)
axes.axvline(limit * 1e3, linestyle='--', label='limit by the characteristic equation')
axes.set_xlabel('depth of cut / mm')
axes.set_ylabel('tool, once in every turn / um')
axes.legend()
lc.show_figure('many_lathes')
