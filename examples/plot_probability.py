"""
How sure is the chart?
======================

A tap test has errors. Drawn a thousand times within them, the machine gives at each speed not a
limit but a probability: the depth below which 95 % of the machines are stable is the one to plan
with.
"""

import matplotlib.pyplot as plt
import numpy as np

import lathe_chatter as lc
from lathe_chatter.model.uncertainty import uncertainty_from

described = lc.load_machine('chucked_shaft')
errors = uncertainty_from('frequency=2%,damping=20%,C=15%', described.machine)
speeds = np.linspace(600.0, 3000.0, 121)
found = lc.stability_probability(described.machine, errors, described.cut, speeds, machines=400)

figure, axes = plt.subplots(figsize=(8, 4.5), layout='constrained')
for share in (0.5, 0.95):
    depth = found.safe_depth(share) * 1e3
    axes.plot(speeds, depth, label=f'stable with {share:.0%}')
axes.set_ylim(bottom=0.0)
axes.set_xlabel('spindle speed / (rev/min)')
axes.set_ylabel('depth of cut / mm')
axes.legend()
lc.show_figure('probability')
