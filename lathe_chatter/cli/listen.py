"""`lathe-chatter listen`: the monitor over a recording of any shop."""

from __future__ import annotations

import math
from argparse import ArgumentParser, Namespace
from dataclasses import asdict

from lathe_chatter.cli.common_options import (
    add_force,
    add_json,
    add_topic,
    in_unit,
    names_in,
    path_of,
    picture_file,
)
from lathe_chatter.cli.console import Screen, counted, keep_existing, writing
from lathe_chatter.cli.parameter_options import say_what_is_assumed
from lathe_chatter.detection import ChatterDetector
from lathe_chatter.detection.filter_design import UNKNOWN_MACHINE
from lathe_chatter.detection.sensors_to_displacement import sensors_among
from lathe_chatter.detection.speed_adviser import speeds_to_recommend
from lathe_chatter.errors import SignalFileError
from lathe_chatter.listening import Judged, Score, judge, read_signals, score
from lathe_chatter.listening.detector_score import labels_beyond, read_labels
from lathe_chatter.model.machine_file import load_machine
from lathe_chatter.model.quantity_fields import Quantity
from lathe_chatter.plot_style import files_of_picture

EXAMPLE = 'lathe-chatter listen shop.wav --labels shop.csv --output heard.png'

_RATE = Quantity('a sample rate', 'Hz', high=1e6, exclusive=True)
_FREQUENCY = Quantity('a frequency', 'Hz', high=50_000.0)
_SPEED = Quantity('a spindle speed', 'rev/min', low=60.0, high=30_000.0, or_zero=True)


def configure(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument('recording', type=path_of, metavar='FILE', help='the recording')
    add_topic(parser)
    parser.add_argument(
        '--columns', metavar='NAMES',
        help='what its columns or channels are, with commas: time, spindle_angle (rev) or '
        'spindle_pulse (rises once a turn), tool_ and workpiece_ displacement, velocity or '
        'acceleration (SI), sound, force (default: their names in the file; the first channel of '
        'a WAV is sound)',
    )  # fmt: skip
    parser.add_argument(
        '--rate', type=in_unit('Hz'), metavar='HZ', help='sample rate, where there are no times'
    )
    parser.add_argument(
        '--machine', metavar='FILE', help='machine file, or the name of one that is shipped'
    )
    for which, usual in (('lowest', UNKNOWN_MACHINE.low), ('highest', UNKNOWN_MACHINE.high)):
        parser.add_argument(
            f'--{which}-frequency', type=in_unit('Hz'), metavar='HZ', default=0.0,
            help=f'{which} frequency at which chatter is looked for without a machine (default: '
            f'{usual:g} Hz{", if the sample rate allows" if which == "highest" else ""})',
        )  # fmt: skip
    parser.add_argument(
        '--spindle-speed-rpm', type=in_unit('rev/min'), metavar='RPM', default=0.0,
        help='nominal spindle speed, where no column is an angle or a pulse a turn',
    )  # fmt: skip
    parser.add_argument(
        '--labels', type=path_of, metavar='CSV',
        help='rows of start, end (s) and state: scores the flag against those that say chatter',
    )  # fmt: skip
    parser.add_argument('--output', type=path_of, metavar='FILE', help='picture to write')
    add_force(parser)
    add_json(parser)


def run(options: Namespace) -> int:
    """Listen, print, draw."""
    screen = Screen(json=options.json)
    if options.output is not None:
        keep_existing(*files_of_picture(picture_file(options.output)), force=options.force)
    columns = None if options.columns is None else names_in('--columns', options.columns)
    rate = None if options.rate is None else _RATE.check('--rate', options.rate)
    labels = [] if options.labels is None else read_labels(options.labels)
    signals = read_signals(options.recording, columns=columns, rate=rate, topic=options.topic)
    if signals.remark:
        screen.say(signals.remark)
    for sentence in labels_beyond(labels, signals):
        screen.say(f'WARNING  {sentence}')
    sensors = sensors_among(signals.columns)
    if sensors is None:
        raise SignalFileError(
            f'{options.recording} has the columns {", ".join(signals.columns)}: none of them is a '
            'sensor by its name; --columns says what they are.'
        )
    described = None if options.machine is None else load_machine(options.machine)
    detector = ChatterDetector(
        described.machine if described else None,
        speed_range=speeds_to_recommend(described.speed_range if described else None),
        lowest_frequency=_FREQUENCY.check('--lowest-frequency', options.lowest_frequency),
        highest_frequency=_FREQUENCY.check('--highest-frequency', options.highest_frequency),
        nominal_rpm=_SPEED.check('--spindle-speed-rpm', options.spindle_speed_rpm),
    )
    say_what_is_assumed(described, screen)
    screen.compile()
    with screen.progress('listening', len(signals.samples) / signals.rate, 's') as bar:
        judged = judge(signals, detector, bar.advance)
    found = score(judged, labels) if labels else None
    _show(screen, judged, found)
    if options.output is not None:
        from lathe_chatter.listening.picture import draw_judged

        with writing(options.output):
            draw_judged(signals, sensors.tool or sensors.workpiece, judged, labels, options.output)
        screen.name_file('picture', options.output)
    screen.json(
        {
            'recording': options.recording,
            'works_with': judged.estimates[-1].mode.value,
            'states': [
                {
                    'time': each.time, 'state': each.state, 'chatter': each.chatter,
                    'frequency': each.frequency, 'growth_rate': each.growth_rate,
                }
                for each in judged.spells()
            ],
            'flagged_share': float(judged.flagged.mean()),
            'score': None if found is None else asdict(found),
        }
    )  # fmt: skip
    return 0


def _show(screen: Screen, judged: Judged, found: Score | None) -> None:
    spells = judged.spells()
    rows = [
        (
            f'{each.time:.2f}',
            each.state,
            _known(each.frequency, '.1f'),
            _known(each.growth_rate, '+.2f'),
        )
        for each in spells
    ]
    titles = {
        'from / s': 'right',
        'state': 'left',
        'frequency / Hz': 'right',
        'growth / (1/s)': 'right',
    }
    screen.table(titles, rows)
    screen.say(f'works with  {judged.estimates[-1].mode.value}')
    screen.say(f'flagged     {judged.flagged.mean():.1%} of the time')
    lines = [each for each in spells if each.chatter and math.isfinite(each.frequency)]
    if lines and not judged.estimates[-1].mode.sees_spindle:
        hertz = ', '.join(dict.fromkeys(f'{each.frequency:.1f}' for each in lines))
        screen.say(
            f'Without a spindle speed any line that holds the power is flagged: it stands at '
            f'{hertz} Hz. If that is a multiple of the turns a second it is the spindle, not '
            'chatter: --spindle-speed-rpm tells them apart. A mode that the noise of cutting '
            'drives is such a line too: a sensor of motion on the tool tells it from chatter.'
        )
    if found is not None:
        delay = 'none' if math.isnan(found.delay) else f'{found.delay:.2f} s (median)'
        screen.say(
            f'labels      F1 of seconds {_known(found.f1, ".3f") or "none: no chatter in them"}, '
            f'of events {_known(found.event_f1, ".3f") or "none"} ({found.found} of '
            f'{found.events}), delay {delay}, {counted(found.false_alarms, "false alarm")} in '
            f'{_duration(3600.0 * found.quiet_hours)} without chatter'
        )


def _duration(seconds: float) -> str:
    """In the largest unit of which there is one at least."""
    units = (('h', 3600.0), ('min', 60.0), ('s', 0.0))
    unit, size = next(each for each in units if seconds >= each[1])
    return f'{seconds / (size or 1.0):.3g} {unit}'


def _known(value: float, form: str) -> str:
    return f'{value:{form}}' if math.isfinite(value) else ''
