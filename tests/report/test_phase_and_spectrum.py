"""Pictures of a excerpt: a cut at rest is said to be at rest, and no rounding is drawn."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure
from support.histories import history_of

from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.model import Cut, Machine, Mode
from lathe_chatter.report.phase_and_spectrum import draw_portrait, draw_section, draw_spectrum
from lathe_chatter.report.run_excerpts import excerpts_of
from lathe_chatter.samples import SAMPLE_COLUMNS


@pytest.mark.parametrize(
    ('depth', 'at_rest'), [(0.0005, True), (0.001, False)], ids=['at rest', 'chattering']
)
def test_a_cut_at_rest_is_said_to_be_at_rest(depth: float, at_rest: bool) -> None:
    lathe = VirtualLathe(cut=Cut(depth_of_cut=depth))
    samples = dict(zip(SAMPLE_COLUMNS, lathe.advance(40_000).T, strict=True))
    history = history_of(samples, lathe.machine, lathe.cut)
    excerpt = excerpts_of(history)[-1]
    for draw in (draw_portrait, draw_section, draw_spectrum):
        axes = Figure().add_subplot()
        draw(axes, excerpt)
        said = [text.get_text() for text in axes.texts]
        assert any('1 nm' in text for text in said) == at_rest
    # Of the spectrum nothing is left but the two lines that say where peaks would be.
    assert len(axes.lines) == (2 if at_rest else 4)


def test_a_run_too_short_for_a_spectrum_is_not_said_to_be_at_rest() -> None:
    lathe = VirtualLathe(cut=Cut(depth_of_cut=0.001))
    samples = dict(zip(SAMPLE_COLUMNS, lathe.advance(10).T, strict=True))
    history = history_of(samples, lathe.machine, lathe.cut)
    axes = Figure().add_subplot()
    draw_spectrum(axes, excerpts_of(history)[-1])
    assert [text.get_text() for text in axes.texts] == ['too short for a spectrum']


def test_a_spectrum_ends_beyond_its_lines_not_at_a_mode_that_nobody_hears() -> None:
    """A workpiece of 2 kHz, 20 kHz samples: five times that were 10 kHz, all of it empty."""
    stiff = Mode(50.0, 2.0 * np.pi * 2000.0, 0.03)
    lathe = VirtualLathe(replace(Machine(), workpiece=stiff), cut=Cut(bearing_contact='none'))
    time = np.arange(40_000) / 2e4
    samples = dict.fromkeys(SAMPLE_COLUMNS, 1e-6 * np.sin(2.0 * np.pi * 130.0 * time))
    samples |= {'time': time, 'spindle_angle': 50.0 * time}
    history = history_of(samples, lathe.machine, lathe.cut)
    axes = Figure().add_subplot()
    draw_spectrum(axes, excerpts_of(history)[-1])
    shown = axes.get_xlim()[1]
    root = axes.lines[2].get_xdata()[0]  # where a peak would be, which has to be in it
    assert max(130.0, root) < shown <= 3.0 * max(140.0, root)
