"""An excerpt of a run as phase portraits, as spectra, and once in every turn."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from lathe_chatter.array_types import Array
from lathe_chatter.model import Machine
from lathe_chatter.plot_style import NEUTRAL, TOOL, WORKPIECE, grid, scale_for, widen
from lathe_chatter.report.run_excerpts import Excerpt, Spectrum
from lathe_chatter.stability import contact_at, root_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_BODIES = (('tool', TOOL, 'o'), ('workpiece', WORKPIECE, 's'))
_MODES_UP = 5.0
"""How far a spectrum goes at most, in highest natural frequencies of the machine."""
_HEARD, _LINES_UP = 0.05, 3.0
"""How far it goes, in frequencies of the highest line of that part of the largest amplitude."""
_HEADROOM = 0.12
"""Of a portrait, above its curves."""
_DECADES = 4.0
_LEAST = 0.1
"""Half an axis at least, in parts of the largest displacement. A cut at rest is a point: its
rounding is no motion."""
_FAINTEST = 1e-9
"""m: what moves less is at rest: its spectrum would be one of rounding."""
_TOP_AT_REST = 1e-6
"""m: top of the empty spectrum of a cut at rest."""


def draw_portrait(axes: Axes, excerpt: Excerpt) -> None:
    """Phase portraits of tool and workpiece."""
    columns = excerpt.portrait
    pairs = {
        name: (columns[f'{name}_displacement'], columns[f'{name}_velocity'])
        for name, _, _ in _BODIES
    }
    _draw_plane(axes, excerpt, pairs, lines=True)
    cut = excerpt.cut
    axes.set_title(
        f'{excerpt.title} (to {excerpt.until:.4g} s)\n{cut.spindle_speed_rpm:g} rev/min, '
        f'{cut.depth_of_cut * 1e3:g} mm',
        fontsize=10,
    )
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + _HEADROOM * (high - low))  # the legend covers no curve
    axes.legend(loc='upper center', frameon=False, fontsize=8, ncols=2)


def draw_section(axes: Axes, excerpt: Excerpt) -> None:
    """Displacement and velocity once per turn: a point for what repeats with the spindle."""
    sections = {name: tuple(excerpt.section(name)) for name, _, _ in _BODIES}
    _draw_plane(axes, excerpt, sections, lines=False)
    turns = len(sections['tool'][0])
    counted = {0: 'no whole turn', 1: '1 turn'}.get(turns, f'{turns} turns')
    axes.set_title(f'once per turn, {counted}', fontsize=10)


def draw_spectrum(axes: Axes, excerpt: Excerpt) -> None:
    """Amplitude spectra of both displacements, with the frequency that the root predicts."""
    session = excerpt.session
    spectra = {name: excerpt.spectrum(f'{name}_displacement') for name, _, _ in _BODIES}
    contact = contact_at(session.machine, excerpt.cut, tool_leaves_cut=session.tool_leaves_cut)
    root = root_of(session.machine, excerpt.cut, seated=contact.seated)
    expected = root.imag / (2.0 * math.pi)
    highest = _highest_frequency(session.machine, expected, list(spectra.values()))
    top = max(
        float(s.amplitude[s.frequency <= highest].max(initial=0.0)) for s in spectra.values()
    )
    scale = scale_for('m', max(top, _TOP_AT_REST))
    for name, colour, _ in _BODIES:
        spectrum = spectra[name]
        shown = (spectrum.frequency <= highest) & (spectrum.amplitude > 0.0)
        if not shown.any() or spectrum.amplitude[shown].max() < _FAINTEST:
            continue
        axes.plot(
            spectrum.frequency[shown], spectrum.amplitude[shown] * scale.factor,
            color=colour, lw=0.9, label=name,
        )  # fmt: skip
    if top < _FAINTEST:
        short = not any(spectrum.frequency.size for spectrum in spectra.values())
        _say_at_rest(axes, 'too short for a spectrum' if short else 'no amplitude above 1 nm')
        top = _TOP_AT_REST
    axes.axvline(expected, color='k', lw=0.9, ls='--', label=f'root, {expected:.1f} Hz')
    axes.axvline(excerpt.cut.spindle_speed_rpm / 60.0, color='k', lw=0.9, ls=':', label='spindle')
    axes.set_yscale('log')
    axes.set_xlim(0.0, highest)
    axes.set_ylim(top * scale.factor * 10.0**-_DECADES, 3.0 * top * scale.factor)
    axes.set_xlabel('frequency / Hz')
    axes.set_ylabel(scale.label('amplitude'))
    axes.legend(loc='upper right', frameon=False, fontsize=8)
    grid(axes)


def _highest_frequency(machine: Machine, expected: float, spectra: Sequence[Spectrum]) -> float:
    """Where spectra end, Hz: beyond the highest line, and no farther than the modes explain."""
    modes = (*machine.tool.modes, *machine.workpiece.modes)
    most = _MODES_UP * max(mode.natural_frequency for mode in modes) / (2.0 * math.pi)
    top = max(float(s.amplitude.max(initial=0.0)) for s in spectra)
    if top < _FAINTEST:
        return most
    lines = [s.frequency[s.amplitude > _HEARD * top].max(initial=expected) for s in spectra]
    known = max(s.frequency.max(initial=0.0) for s in spectra)
    return float(min(most, _LINES_UP * max(lines), known))


def _draw_plane(
    axes: Axes, excerpt: Excerpt, pairs: Mapping[str, tuple[Array, ...]], *, lines: bool
) -> None:
    """Velocity over displacement of both bodies, as lines that end in a dot or as points."""
    from matplotlib.colors import to_rgb

    least = max(
        _FAINTEST, *(_LEAST * float(np.abs(x).max(initial=0.0)) for x, _ in pairs.values())
    )
    modes = (*excerpt.session.machine.tool.modes, *excerpt.session.machine.workpiece.modes)
    least_velocity = least * min(mode.natural_frequency for mode in modes)
    places = scale_for('m', least, *(pair[0] for pair in pairs.values()))
    speeds = scale_for('m/s', least_velocity, *(pair[1] for pair in pairs.values()))
    for name, colour, marker in _BODIES:
        place, velocity = pairs[name]
        x, y = place * places.factor, velocity * speeds.factor
        if lines:
            axes.plot(x, y, color=colour, lw=0.8, label=name, marker=marker, ms=3, markevery=[-1])
            continue
        # From faint to full: whether the points run in or out is then plain.
        shades = [(*to_rgb(colour), alpha) for alpha in np.linspace(0.15, 1.0, x.size).tolist()]
        axes.scatter(x, y, s=9, color=shades, marker=marker, lw=0)
    widen(axes, x=least * places.factor, y=least_velocity * speeds.factor)
    if all(excerpt.size(f'{name}_displacement') < _FAINTEST for name, _, _ in _BODIES):
        _say_at_rest(axes, 'both at rest, within 1 nm')
    axes.set_xlabel(places.label('displacement'))
    axes.set_ylabel(speeds.label('velocity'))
    grid(axes)


def _say_at_rest(axes: Axes, text: str) -> None:
    """Say in the middle of a plot why it is empty."""
    axes.text(0.6, 0.25, text, transform=axes.transAxes, ha='center', fontsize=9, color=NEUTRAL)
