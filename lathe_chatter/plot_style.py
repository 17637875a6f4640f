"""What every picture has in common: colours, units with their prefixes, files.

Okabe and Ito's palette is told apart with any colour vision, and the same thing has the same
colour in every picture.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from lathe_chatter.array_types import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TOOL, WORKPIECE, ALARM, NEUTRAL = '#0072B2', '#D55E00', '#CC79A7', '#555555'
ALARM_TEXT = '#8a3c66'
"""The same, dark enough to be read."""
KNOCK = '#8A6D00'
OPEN, SEATED, LINE, SAFE = '#0072B2', '#D55E00', '#000000', '#009E73'
_PREFIXES = {-4: 'p', -3: 'n', -2: 'µ', -1: 'm', 0: '', 1: 'k', 2: 'M', 3: 'G', 4: 'T'}
_UNSAID = {
    '.png': ('Software',),
    '.svg': ('Date', 'Creator'),
    '.pdf': ('CreationDate', 'Creator', 'Producer'),
}
"""What a file would tell of when and with what it was made."""
_DPI = 110
_WITHOUT_SCREEN = {'agg', 'cairo', 'pdf', 'pgf', 'ps', 'svg', 'template'}
"""Matplotlib's backends that show nothing."""


class Scale(NamedTuple):
    """How to show a quantity: a factor to multiply by, and the unit that it is then in."""

    factor: float
    unit: str

    def label(self, name: str) -> str:
        """A label of an axis, name / unit."""
        return f'{name} / {self.unit}' if '/' not in self.unit else f'{name} / ({self.unit})'


def scale_for(unit: str, *values: Any) -> Scale:
    """The SI prefix with which the largest of some values has one to three digits.

    Args:
        unit: Without prefix: m, m/s, N.
        values: Arrays or numbers in that unit.
    """
    largest = max((float(np.max(np.abs(v), initial=0.0)) for v in values), default=0.0)
    if not math.isfinite(largest) or largest == 0.0:
        return Scale(1.0, unit)
    # Just below a power of a thousand the larger prefix would give 0.999.
    power = math.floor(math.log10(largest) / 3.0 + 1e-9)
    power = min(max(power, min(_PREFIXES)), max(_PREFIXES))
    return Scale(1000.0**-power, f'{_PREFIXES[power]}{unit}')


def text_of(value: float, unit: str) -> str:
    """A quantity with the prefix that suits it, such as 200 µm.

    Args:
        value: In the unit.
        unit: Without prefix.
    """
    scale = scale_for(unit, value)
    return f'{value * scale.factor:.4g} {scale.unit}'


def new_figure(width: float, height: float) -> Figure:
    """An empty figure, inches.

    Not pyplot's: that would choose a backend and keep every figure in a global list.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout='constrained')
    FigureCanvasAgg(figure)
    return figure


def axes_or_new(axes: Axes | None) -> Axes:
    """Axes to draw into: those given, or of a figure of pyplot's, which a notebook shows."""
    if axes is not None:
        return axes
    from matplotlib import pyplot as plt

    made: Axes = plt.subplots(layout='constrained')[1]
    return made


def show_figure(name: str) -> None:
    """Show pyplot's newest figure; where there is no screen, write it and say where it is.

    Args:
        name: Of the file, which is a PNG in the folder where one is.
    """
    from matplotlib import pyplot as plt

    if plt.get_backend().lower() not in _WITHOUT_SCREEN:
        plt.show()
        return
    file = Path(f'{name}.png').absolute()
    plt.savefig(file)
    print(f'There is no screen here: the picture is in {file}')  # noqa: T201 -- for scripts


def save(figure: Figure, path: Path) -> None:
    """Write a figure: as SVG or PDF if the path says so, else as PNG with an SVG beside it."""
    from matplotlib import rc_context

    # The layout serves both files: to work it out takes as long as to draw one.
    layout = figure.get_layout_engine()
    if layout is not None:
        layout.execute(figure)
    figure.set_layout_engine('none')
    # Neither file tells when or with what it was made: the same picture is the same bytes.
    with rc_context({'svg.fonttype': 'none', 'svg.hashsalt': ascii(path.stem)}):
        for file in files_of_picture(path):
            unsaid = _UNSAID[file.suffix]
            figure.savefig(file, dpi=_DPI, metadata=dict.fromkeys(unsaid))


def files_of_picture(path: Path) -> list[Path]:
    """The files that `save` writes."""
    if path.suffix in {'.svg', '.pdf'}:
        return [path]
    return [path.with_suffix('.png'), path.with_suffix('.svg')]


def draw_band(
    axes: Axes, time: Array, values: tuple[Array, Array], colour: str, label: str = ''
) -> None:
    """Draw the band between smallest and largest values (n,), or a line where they are the same.

    A nan in them is a gap, which is left open.
    """
    low, high = values
    if np.array_equal(low, high, equal_nan=True):
        axes.plot(time, low, color=colour, lw=0.8, label=label)
    else:
        axes.fill_between(time, low, high, color=colour, lw=0.4, label=label)


def widen(axes: Axes, *, x: float = 0.0, y: float = 0.0) -> None:
    """Give the axes at least so much to each side of their middle, and plain numbers.

    What has come to rest else fills them with its rounding, and is labelled by differences from
    a number of ten digits.
    """
    for limits, setter, least in (
        (axes.get_xlim(), axes.set_xlim, x),
        (axes.get_ylim(), axes.set_ylim, y),
    ):
        middle, half = 0.5 * sum(limits), 0.5 * (limits[1] - limits[0])
        if half < least:
            setter(middle - least, middle + least)
    axes.ticklabel_format(useOffset=False)


def grid(axes: Axes) -> None:
    """A faint grid."""
    axes.grid(visible=True, alpha=0.25)
