"""Pictures of a excerpt: a cut at rest is said to be at rest, and no rounding is drawn."""

from __future__ import annotations

from pathlib import Path

import pytest
from matplotlib.figure import Figure

from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.model import Cut
from lathe_chatter.report.phase_and_spectrum import draw_portrait, draw_section, draw_spectrum
from lathe_chatter.report.plotted_samples import RunSamples
from lathe_chatter.report.run_excerpts import excerpts_of
from lathe_chatter.report.run_history import History
from lathe_chatter.samples import SAMPLE_COLUMNS


@pytest.mark.parametrize(
    ('depth', 'at_rest'), [(0.0005, True), (0.001, False)], ids=['at rest', 'chattering']
)
def test_a_cut_at_rest_is_said_to_be_at_rest(depth: float, at_rest: bool) -> None:
    lathe = VirtualLathe(cut=Cut(depth_of_cut=depth))
    samples = dict(zip(SAMPLE_COLUMNS, lathe.advance(40_000).T, strict=True))
    history = History(Path('run'), lathe.machine, lathe.cut, RunSamples.of(samples))
    excerpt = excerpts_of(history)[-1]
    for draw in (draw_portrait, draw_section, draw_spectrum):
        axes = Figure().add_subplot()
        draw(axes, history, excerpt)
        said = [text.get_text() for text in axes.texts]
        assert any('1 nm' in text for text in said) == at_rest
    # Of the spectrum nothing is left but the two lines that say where peaks would be.
    assert len(axes.lines) == (2 if at_rest else 4)
