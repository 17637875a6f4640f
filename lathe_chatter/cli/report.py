"""`lathe-chatter report`: what happened in a recorded run, as a table and a picture."""

from __future__ import annotations

import bisect
import math
from argparse import ArgumentParser, Namespace
from collections.abc import Iterator
from typing import Any

from lathe_chatter.cli.common_options import add_json, add_run, add_topic
from lathe_chatter.cli.console import Screen, counted, writing
from lathe_chatter.lathe.change_and_knock_sentences import on_the_shop_floor
from lathe_chatter.model import BearingContact, Cut
from lathe_chatter.report.monitor_record import Flag
from lathe_chatter.report.operating_points import probabilities_of
from lathe_chatter.report.probability_chart import cut_probability, probability_sentence
from lathe_chatter.report.run_excerpts import Excerpt, excerpts_of
from lathe_chatter.report.run_figure import draw_run
from lathe_chatter.report.run_history import History, Session, in_words, read_history
from lathe_chatter.stability import root_of

EXAMPLE = 'lathe-chatter report runs/20260401-120000'

PICTURE = 'report.png'
_LATE = 1e-3
"""s after which a record begins that has not the start of the cut."""
_EXPLAINS = 0.1
"""s before a flag in which advice is that of the flag."""
_SAME_SPEED = 0.02
"""Part by which speeds may differ that are one piece of advice."""
_ROUNDING = 1e-12
"""m: what moves less has no frequency worth a name."""


def configure(parser: ArgumentParser) -> None:
    """Declare the options."""
    add_run(parser)
    add_topic(parser)
    add_json(parser)


def run(options: Namespace) -> int:
    """Report on a run."""
    screen = Screen(json=options.json)
    history = read_history(options.run_path, options.topic)
    picture = PICTURE
    if options.topic is not None:  # each lathe of a run has its own
        lathe = options.topic.removesuffix('/samples').replace('/', '_')
        picture = f'report{lathe}.png'
    screen.json(show_run(history, screen, picture))
    return 0


def show_run(history: History, screen: Screen, name: str = PICTURE) -> dict[str, Any]:
    """Print the table of a run, draw its picture beside it, and return the same as figures.

    Args:
        history: Of the run.
        screen: To print on.
        name: Of the picture.
    """
    occurrences = _occurrences(history)
    titles = {'time / s': 'right', 'what happened': 'text'}
    titles |= dict.fromkeys(('monitor', 'root, open', 'root, seated'), 'right')
    rows = [
        (
            f'{entry["time"]:.3f}',
            entry['what'],
            _pair(entry['frequency'], entry['growth_rate']),
            *(_pair(root['frequency'], root['growth_rate']) for root in entry['roots'].values()),
        )
        for entry in occurrences
    ]
    screen.table(titles, rows)
    screen.say(
        'Pairs: frequency / Hz and growth rate / (1/s) of the chatter as the monitor measured '
        'them, medians from the flag until it fell or the cut was changed, and of the rightmost '
        'characteristic root, of the machine open and on its bearing.'
    )
    if not any(series.size for series in history.estimates.values()):
        screen.say('No figure of a monitor is in the record.')
    probable = probabilities_of(history)
    if probable:
        screen.say(
            'With the standard errors of its machine file (the errors that the model itself '
            'makes are not among them):'
        )
    sentences = dict.fromkeys(probability_sentence(stay.cut, known) for stay, known in probable)
    for sentence in (*sentences, *_gap_sentences(history), *history.remarks):
        screen.say(sentence)
    excerpts = excerpts_of(history)
    folder = history.path if history.path.is_dir() else history.path.parent
    picture = folder / name
    with writing(picture):
        draw_run(history, excerpts, picture)
    screen.name_file('run', history.path)
    screen.name_file('picture', picture)
    return {
        'run': history.path,
        'picture': picture,
        'occurrences': occurrences,
        'gaps': history.samples.gaps,
        'sessions': [session.time for session in history.sessions],
        'remarks': history.remarks,
        'probabilities': [
            {'time': stay.start, **cut_probability(stay.cut, known)} for stay, known in probable
        ],
        'moments': [_excerpt_figures(excerpt) for excerpt in excerpts],
    }


def _gap_sentences(history: History) -> Iterator[str]:
    """What the pictures leave out, in words."""
    gaps = history.samples.gaps
    if gaps:
        before, after = max(gaps, key=lambda gap: gap[1] - gap[0])
        yield (
            f'Samples are missing in {counted(len(gaps), "place")}, the longest from '
            f'{before:.6f} s to {after:.6f} s: lines end there, and nothing is '
            'computed across them.'
        )
    if history.later_sessions:
        yield (
            f'The simulated time went back to zero {counted(len(history.later_sessions), "time")}'
            ': here the times go on, from one cut to the next.'
        )


def _excerpt_figures(excerpt: Excerpt) -> dict[str, Any]:
    """What the portraits and spectra show, as figures."""
    spectrum = excerpt.spectrum('tool_displacement')
    moved = spectrum.amplitude.size > 0 and spectrum.amplitude.max() > _ROUNDING
    return {
        'title': excerpt.title,
        'time': excerpt.until,
        'tool_peak_to_peak': excerpt.size('tool_displacement'),
        'workpiece_peak_to_peak': excerpt.size('workpiece_displacement'),
        'frequency': spectrum.peak if moved else None,
        'out_of_cut': excerpt.out_of_cut,
        'on_bearing': excerpt.on_bearing,
    }


def _pair(frequency: float | None, growth_rate: float | None) -> str:
    """Frequency and growth rate, blank where unknown."""
    if frequency is None or growth_rate is None or math.isnan(frequency + growth_rate):
        return ''
    return f'{frequency:.1f}  {growth_rate:+7.2f}'


def _occurrences(history: History) -> list[dict[str, Any]]:
    """Start, changes, flags, advice and end, in order of time."""
    # The start itself has no sample.
    begin, word = (0.0, 'start') if history.begin < _LATE else (history.begin, 'record begins')
    result = [_entry(history, begin, f'{word}: {_cut_text(history.cut_at(begin))}')]
    spans = history.chatter_spans()
    for event in history.in_order():
        entry = _entry(history, event.time, in_words(event))
        if isinstance(event, Session):
            cut = _cut_text(event.start) if event.known else 'with what is not in the record'
            entry['what'] += f': {cut}'
        if isinstance(event, Flag) and event.chatter:
            ends = [end for start, end in spans if start == event.time]
            ends += [change.time for change in history.changes if change.time > event.time]
            until = min(ends, default=event.received)  # what comes after is another cut
            for name in ('frequency', 'growth_rate'):
                settled = history.settled(name, event.received, until)
                entry[name] = settled if math.isfinite(settled) else getattr(event, name)
        result.append(entry)
    result += [
        _entry(history, ramp.end, f'the spindle is at {ramp.high:g} rev/min')
        for ramp in history.ramps
        if ramp.start < ramp.end <= history.duration
    ]
    result += [
        _entry(history, time, f'advice: {speed:.0f} rev/min') for time, speed in _advice(history)
    ]
    result.sort(key=lambda entry: float(entry['time']))
    result.append(_entry(history, history.duration, 'end'))
    return result


def _advice(history: History) -> Iterator[tuple[float, float]]:
    """When the monitor recommended which speed, s and rev/min.

    At first, where it changed, and the last before the spindle was set, which may have been to it.
    """
    recommended = history.estimates.get('recommended_speed_rpm')
    turns = [flag.received for flag in history.flags]
    raised = [flag for flag in history.flags if flag.chatter]
    last, last_turn = math.nan, -1
    sets = [change.time for change in history.changes if 'spindle_speed_rpm' in change.new]
    told = [] if recommended is None else recommended.T.tolist()
    following = [*(time for time, _ in told[1:]), math.inf]
    for (time, speed), until in zip(told, following, strict=False):
        was_set = f'{speed:.0f}' != f'{last:.0f}' and any(time < at <= until for at in sets)
        # The figures that explain a flag are published before it.
        after = next((f for f in raised if time <= f.received < time + _EXPLAINS), None)
        turn = bisect.bisect_right(turns, time if after is None else after.received)
        time = time if after is None else after.time  # noqa: PLW2901 -- when it was of use
        if turn != last_turn or was_set or not abs(speed / last - 1.0) <= _SAME_SPEED:
            yield time, speed
            last, last_turn = speed, turn


def _entry(history: History, time: float, what: str) -> dict[str, Any]:
    """One occurrence with the characteristic roots of the cut in force then."""
    cut, session = history.cut_at(time), history.session_at(time)
    roots: dict[str, dict[str, float | None]] = {}
    for regime, seated in (('open', False), ('seated', True)):
        # A machine without clearance in its model has no bearing to rest on.
        if not session.known or (seated and cut.bearing_contact is BearingContact.NONE):
            roots[regime] = {'frequency': None, 'growth_rate': None}
            continue
        root = root_of(session.machine, cut, seated=seated)
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
