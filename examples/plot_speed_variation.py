"""
A speed that swings
===================

Where no constant speed helps, one that varies may: the waves of two turns never stay in step for
long. The growth rate is that of the dominant multiplier over a period of the variation.
"""

import matplotlib.pyplot as plt
import numpy as np

import lathe_chatter as lc

cut = lc.Cut(spindle_speed_rpm=2500.0, depth_of_cut=0.0008, bearing_contact='none')
amplitudes = np.linspace(0.0, 0.3, 25)
figure, axes = plt.subplots(figsize=(8, 4), layout='constrained')
for frequency in (1.0, 2.0, 4.0):
    rates = [
        lc.floquet(
            lc.Machine(),
            cut.with_changes(
                speed_variation_amplitude=amplitude, speed_variation_frequency=frequency
            ),
            seated=False,
        ).growth_rate
        for amplitude in amplitudes
    ]
    axes.plot(amplitudes * 100, rates, label=f'{frequency:g} Hz')
axes.axhline(0.0, color='black', linewidth=0.8)
axes.set_xlabel('amplitude of the variation / %')
axes.set_ylabel('growth rate / (1/s)')
axes.legend(title='frequency')
lc.show_figure('speed_variation')
