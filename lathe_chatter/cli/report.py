"""`lathe-chatter report`: what happened in a recorded run, as a table and a picture."""

from __future__ import annotations

import math
from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from lathe_chatter.cli.console import print_json
from lathe_chatter.lathe.cut_events import on_the_shop_floor
from lathe_chatter.model import BearingContact, Cut
from lathe_chatter.report import draw_run
from lathe_chatter.report.history import History, read_history
from lathe_chatter.report.signal_views import Moment, moments_of
from lathe_chatter.stability import rightmost_root

NAME = 'report'
HELP = 'print what happened in a recorded run and draw it'
EXAMPLE = 'lathe-chatter report runs/20260401-120000'

PICTURE = 'report.png'
_ROUNDING = 1e-12
"""m: what moves less has no frequency worth a name."""


def configure(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument('run_path', type=Path, metavar='RUN', help='folder of a recorded run')
    parser.add_argument('--json', action='store_true', help='print the figures as JSON')


def run(options: Namespace) -> int:
    """Report on a run."""
    figures = show_run(
        read_history(options.run_path), Console(stderr=options.json, highlight=False)
    )
    if options.json:
        print_json(figures)
    return 0


def show_run(history: History, console: Console) -> dict[str, Any]:
    """Print the table of a run, draw its picture beside it, and return the same as figures."""
    occurrences = _occurrences(history)
    table = Table(box=SIMPLE_HEAD, pad_edge=False)
    table.add_column('time / s', justify='right')
    table.add_column('what happened')
    for title in ('monitor', 'root, open', 'root, seated'):
        table.add_column(title, justify='right', no_wrap=True)
    for entry in occurrences:
        table.add_row(
            f'{entry["time"]:.3f}',
            entry['what'],
            _pair(entry['frequency'], entry['growth_rate']),
            *(_pair(root['frequency'], root['growth_rate']) for root in entry['roots'].values()),
        )
    console.print(table)
    console.print(
        'Pairs: chatter frequency / Hz and growth rate / (1/s), as the monitor measured them and '
        'as the rightmost characteristic root has them, of the machine open and on its bearing.'
    )
    folder = history.path if history.path.is_dir() else history.path.parent
    picture = folder / PICTURE
    try:
        draw_run(history, picture)
    except OSError as error:  # a full disk does not say which file it refuses
        raise OSError(error.errno, error.strerror, str(picture)) from None
    console.print(f'run      {history.path}\npicture  {picture}', soft_wrap=True)
    return {
        'run': str(history.path),
        'picture': str(picture),
        'occurrences': occurrences,
        'moments': [_moment_figures(moment) for moment in moments_of(history)],
    }


def _moment_figures(moment: Moment) -> dict[str, Any]:
    """What the portraits and spectra show, as figures."""
    spectrum = moment.spectrum('tool_displacement')
    moved = spectrum.amplitude.size > 0 and spectrum.amplitude.max() > _ROUNDING
    return {
        'title': moment.title,
        'time': moment.until,
        'tool_peak_to_peak': _known(moment.size('tool_displacement')),
        'workpiece_peak_to_peak': _known(moment.size('workpiece_displacement')),
        'frequency': spectrum.peak if moved else None,
        'out_of_cut': _known(moment.out_of_cut),
        'on_bearing': _known(moment.on_bearing),
    }


def _pair(frequency: float | None, growth_rate: float | None) -> str:
    """Frequency and growth rate, blank where unknown."""
    if frequency is None or growth_rate is None:
        return ''
    return f'{frequency:.1f}  {growth_rate:+7.2f}'


def _occurrences(history: History) -> list[dict[str, Any]]:
    """Start, changes, flags and end, in order of time."""
    start = history.start
    result = [_entry(history, 0.0, f'start: {_cut_text(start)}')]
    for change in history.changes:
        words = ', '.join(on_the_shop_floor(*changed) for changed in change.new.items())
        result.append(_entry(history, change.time, words))
    result += [
        _entry(history, knock.time, f'knock, {knock.impulse * 1e3:g} mN s')
        for knock in history.knocks
    ]
    for flag in history.flags:
        entry = _entry(history, flag.time, 'chatter flagged' if flag.chatter else 'flag cleared')
        if flag.chatter:
            entry['frequency'] = _known(flag.frequency)
            entry['growth_rate'] = _known(flag.growth_rate)
        result.append(entry)
    result.sort(key=lambda entry: float(entry['time']))
    result.append(_entry(history, history.duration, 'end'))
    return result


def _entry(history: History, time: float, what: str) -> dict[str, Any]:
    """One occurrence with the characteristic roots of the cut in force then."""
    cut = history.cut_at(time)
    roots: dict[str, dict[str, float | None]] = {}
    for regime, seated in (('open', False), ('seated', True)):
        # A machine without clearance in its model has no bearing to rest on.
        if seated and cut.bearing_contact is BearingContact.NONE:
            roots[regime] = {'frequency': None, 'growth_rate': None}
            continue
        root = rightmost_root(
            history.machine, cut.spindle_speed_rpm, cut.depth_of_cut, seated=seated
        )
        roots[regime] = {
            'frequency': root.imag / (2.0 * math.pi),
            'growth_rate': root.real,
        }
    return {'time': time, 'what': what, 'frequency': None, 'growth_rate': None, 'roots': roots}


def _cut_text(cut: Cut) -> str:
    """Speed, depth and bearing in the units of the shop floor."""
    names = ['spindle_speed_rpm', 'depth_of_cut', 'bearing_clearance']
    words = [on_the_shop_floor(name, getattr(cut, name)) for name in names]
    if cut.bearing_contact is BearingContact.NONE:
        words[-1] = 'no clearance'
    return ', '.join(words)


def _known(value: float) -> float | None:
    """None for nan, as JSON has no nan."""
    return value if math.isfinite(value) else None
