from __future__ import annotations

import numpy as np

from lathe_chatter.model import BearingContact, Cut, Machine, Mode
from lathe_chatter.plot_style import new_figure
from lathe_chatter.report.stability_chart import chart_limits, draw_chart, plot_lobes
from lathe_chatter.stability import growth_map


def test_growth_that_is_far_slower_than_decay_has_figures_beside_its_colours_too() -> None:
    machine = Machine(Mode(500.0, 40.0 * np.pi, 0.03), Mode(2e3, 70.0 * np.pi, 0.03), 0.0, 1.5e9)
    cut, speeds = Cut(bearing_contact=BearingContact.NONE), np.linspace(200.0, 1400.0, 40)
    limits = chart_limits(machine, cut, speeds)
    top = 1.2 * float(limits.depth_of_cut.min())
    growth = growth_map(machine, cut, speeds, np.linspace(0.01 * top, top, 12))
    fastest, slowest = growth.growth_rate.max(), growth.growth_rate.min()
    assert 0.0 < fastest < -0.3 * slowest
    figure = new_figure(11.0, 6.0)
    draw_chart(figure.subplots(), cut, limits, growth, top)
    figure.draw_without_rendering()
    ticks = figure.axes[-1].get_yticks()
    assert slowest <= ticks.min() < 0.5 * slowest
    assert 0.5 * fastest < ticks.max() <= fastest


def test_a_chart_of_the_usual_size_has_room_for_its_legend() -> None:
    figure = new_figure(6.4, 4.8)
    axes = figure.subplots()
    plot_lobes(Machine(), Cut(), axes=axes)
    figure.draw_without_rendering()
    legend = axes.get_legend()
    assert legend is not None
    box, room = legend.get_window_extent(), figure.bbox
    assert room.x0 <= box.x0 < box.x1 <= room.x1
    assert axes.get_window_extent().width > 0.8 * room.width
