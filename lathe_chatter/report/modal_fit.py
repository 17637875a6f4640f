"""The picture of a tap test: what was measured, what was fitted, and what is left."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lathe_chatter.array_types import Array
from lathe_chatter.plot_style import LINE, NEUTRAL, TOOL, WORKPIECE, grid, new_figure, save
from lathe_chatter.tap_test import ModalFit
from lathe_chatter.tap_test.measured_response import ORDERS, Complex

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_UNITS = {'receptance': 'm/N', 'mobility': '(m/s)/N', 'accelerance': '(m/s²)/N'}
_COLOURS = {'tool': TOOL, 'workpiece': WORKPIECE}


def draw_fits(fits: Mapping[str, ModalFit], path: Path) -> None:
    """Draw the fit of each body into a file, a column each.

    Args:
        fits: By name of the body.
        path: Of the PNG; an SVG is written beside it.
    """
    figure = new_figure(6.2 * len(fits), 6.4)
    panels = figure.subplots(
        3, len(fits), sharex='col', squeeze=False, gridspec_kw={'height_ratios': (3, 2, 2)}
    )
    for (body, fit), column in zip(fits.items(), panels.T, strict=True):
        column[0].set_title(f'{body}: {len(fit.modes)} mode{"s" * (len(fit.modes) > 1)}')
        _draw_magnitude(column[0], fit, _COLOURS.get(body, NEUTRAL))
        _draw_phase(column[1], fit, _COLOURS.get(body, NEUTRAL))
        _draw_residual(column[2], fit, _COLOURS.get(body, NEUTRAL))
        column[2].set_xlabel('frequency / Hz')
    save(figure, path)


def _draw_magnitude(axes: Axes, fit: ModalFit, colour: str) -> None:
    form = fit.responses[0].form
    for k, (response, model) in enumerate(zip(fit.responses, fit.fitted, strict=True)):
        axes.plot(
            response.frequency, np.abs(response.response), '.', ms=2.5, color=colour, alpha=0.6,
            label='measured' if k == 0 else None,
        )  # fmt: skip
        axes.plot(
            response.frequency, np.abs(model), color=LINE, lw=1.0, label=None if k else 'fitted'
        )
    for mode in fit.modes:
        axes.axvline(mode.frequency, color=NEUTRAL, lw=0.6, ls=':')
        axes.annotate(
            f'{mode.frequency:.4g} Hz\nζ {mode.damping_ratio:.2%}',
            (mode.frequency, 0.02), xycoords=('data', 'axes fraction'), fontsize=7,
            xytext=(3, 0), textcoords='offset points', color=NEUTRAL,
        )  # fmt: skip
    axes.set_yscale('log')
    axes.set_ylabel(f'{form} / ({_UNITS[form]})')
    axes.legend(loc='upper right', fontsize=8)
    grid(axes)


def _draw_phase(axes: Axes, fit: ModalFit, colour: str) -> None:
    """The angle of the receptance, whatever was measured: 0 below a mode, -180 above."""
    for response, model in zip(fit.responses, fit.fitted, strict=True):
        turn = 1j ** ORDERS[response.form]
        angle = _unfolded(response.response / turn)
        axes.plot(response.frequency, angle, '.', ms=2.5, color=colour, alpha=0.6)
        axes.plot(response.frequency, _unfolded(model / turn), color=LINE, lw=1.0)
    axes.set_ylabel('phase of the\nreceptance / °')
    axes.set_ylim(-280, 100)
    axes.set_yticks((-270, -180, -90, 0, 90))
    grid(axes)


def _unfolded(response: Complex) -> Array:
    """The angle from -270 to 90 degrees: noise about -180 does not jump to the other side."""
    angle: Array = np.degrees(np.angle(response))
    return np.where(angle > 90.0, angle - 360.0, angle)


def _draw_residual(axes: Axes, fit: ModalFit, colour: str) -> None:
    """What is left, in standard deviations of the noise: even where the model is complete."""
    for response, model, noise in zip(fit.responses, fit.fitted, fit.deviations, strict=True):
        left = np.abs(response.response - model) / noise
        axes.plot(response.frequency, left, '.', ms=2.5, color=colour, alpha=0.6)
    axes.axhline(2.45, color=NEUTRAL, lw=0.8, ls='--')
    axes.annotate(
        '95 % of them below', (0.99, 2.45), xycoords=('axes fraction', 'data'), fontsize=7,
        ha='right', va='bottom', color=NEUTRAL,
        bbox={'boxstyle': 'square,pad=0.1', 'fc': 'white', 'ec': 'none', 'alpha': 0.8},
    )  # fmt: skip
    axes.set_ylabel('left over /\nits noise')
    axes.set_ylim(bottom=0.0)
    grid(axes)
