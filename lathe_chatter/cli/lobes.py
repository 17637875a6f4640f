"""`lathe-chatter lobes`: the stability chart of a machine as a picture and as numbers."""

from __future__ import annotations

import csv
import math
from argparse import ArgumentParser, Namespace
from concurrent.futures import Executor
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lathe_chatter.arrays import Array
from lathe_chatter.cli.common_options import (
    add_force,
    add_json,
    picture_file,
)
from lathe_chatter.cli.console import INTERRUPTED, Screen, keep_existing, writing
from lathe_chatter.cli.executor_options import add_executor, executor_of
from lathe_chatter.cli.parameter_options import (
    add_parameter_options,
    config_of,
    given_parameters,
)
from lathe_chatter.errors import ParameterError
from lathe_chatter.lathe.config import LatheConfig
from lathe_chatter.model import BearingContact, Cut
from lathe_chatter.model.parameters import described_by
from lathe_chatter.model.quantities import Quantity, limits_of
from lathe_chatter.model.uncertainty import uncertainty_from
from lathe_chatter.plot_style import files_of_picture
from lathe_chatter.report.probability_chart import SURE
from lathe_chatter.report.stability_chart import chart_limits, chart_speeds, draw_lobes
from lathe_chatter.stability import GrowthMap, SafeLimit, SpeedLaw, growth_map, lowest_limit
from lathe_chatter.stability.probability import StabilityProbability, stability_probability

NAME = 'lobes'
HELP = 'draw the stability chart: both limits, the seating line and the safe region'
EXAMPLE = 'lathe-chatter lobes --bearing-clearance 1e-5 --map --csv lobes.csv'

_SPEED = limits_of(Cut, 'spindle_speed_rpm')
_USUAL = (1000.0, 12000.0)
"""Range of speeds of a chart where nothing is said of the spindle, rev/min."""
_DEPTH = Quantity('top of the chart', 'm', high=0.01, exclusive=True)
_HEADROOM = 2.6
_MAP = (222, 76)
_VARIED_MAP = (56, 20)
"""Speeds and depths of a map; each point of a varying speed is an eigenproblem of its own."""
_PROBABLE_SPEEDS, _PROBABLE_MACHINES = 200, 1000
_WORTH_A_WORD = 0.05
"""Share of the variance below which a figure is not named."""
_SHALLOWEST = 1000.0
"""Part of the top at which a map begins: at a depth of 0 there is no cut."""


def configure(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        '--from', dest='low', type=float, metavar='RPM',
        help="lowest speed, rev/min (default: that of the machine file's spindle, else 1000)",
    )  # fmt: skip
    parser.add_argument(
        '--to', dest='high', type=float, metavar='RPM',
        help="highest speed, rev/min (default: that of the machine file's spindle, else 12000)",
    )  # fmt: skip
    parser.add_argument(
        '--depth-limit', type=float, metavar='M', help='top of the chart, m (default: fits)'
    )
    parser.add_argument(
        '--uncertain', metavar='LIST',
        help='relative standard errors of the machine, as frequency=2%%,damping=20%%,'
        'stiffness=5%%,C=15%%: the chart shows the probability of being stable (default: '
        'those of the machine file, if it has any)',
    )  # fmt: skip
    parser.add_argument('--map', action='store_true', help='colour the chart with the growth rate')
    parser.add_argument(
        '--law', choices=[law.value for law in SpeedLaw], default=SpeedLaw.SPEED.value,
        help="what swings where the speed is varied: the spindle's speed, or the delay, as most "
        'of the literature has it (default: %(default)s)',
    )  # fmt: skip
    parser.add_argument(
        '--output', type=Path, default=Path('lobes.png'), metavar='FILE',
        help='picture to write: .png with an .svg beside it, .svg or .pdf (default: %(default)s)',
    )  # fmt: skip
    parser.add_argument('--csv', type=Path, metavar='FILE', help='write the limits as CSV too')
    add_executor(parser)
    add_force(parser)
    add_json(parser)
    add_parameter_options(
        parser, without=('force_noise', 'sensor_noise', 'runout', 'seed', 'sample_rate',
                         'spindle_acceleration'),
    )  # fmt: skip


def run(options: Namespace) -> int:
    """Draw and print the chart."""
    config = config_of(options)
    low, high = _speed_range(options)
    if not low < high:
        raise ParameterError('--to', high, 'rev/min', f'above --from, {low:g} rev/min')
    files = files_of_picture(picture_file(options.output))
    keep_existing(*files, *([options.csv] if options.csv else []), force=options.force)
    if options.csv in files:
        raise ParameterError('--csv', str(options.csv), '', 'another file than the picture')
    limits = chart_limits(
        config.machine,
        config.cut,
        chart_speeds(low, high),
        tool_leaves_cut=config.setup.tool_leaves_cut,
    )
    top = _top(limits) if options.depth_limit is None else options.depth_limit
    top = _DEPTH.check('--depth-limit', top)
    screen = Screen(json=options.json)
    kept = options.output.with_suffix('.jsonl')
    growth, probability = None, None
    try:
        with executor_of(options, screen) as executor:
            wide = _Wide(screen, executor, kept)
            if options.map or config.cut.speed_variation_amplitude > 0.0:
                growth = _map(config, low, high, top, SpeedLaw(options.law), wide)
            else:
                probability = _probability(options, config, low, high, wide)
    except KeyboardInterrupt:
        screen.say(f'Interrupted: the same call goes on from {kept}.')
        return INTERRUPTED
    with writing(options.output):
        options.output.parent.mkdir(parents=True, exist_ok=True)
        draw_lobes(config.cut, limits, growth, top, options.output, probability=probability)
    if options.csv is not None:
        with writing(options.csv):
            _write_csv(options.csv, config, limits)
    if growth is not None or probability is not None:
        kept.unlink(missing_ok=True)
    _show(config, limits, screen)
    if probability is not None:
        _show_probability(config, probability, screen)
    for file in files:
        screen.name_file('picture', file)
    screen.json(_figures(config, limits, growth, probability))
    return 0


def _speed_range(options: Namespace) -> tuple[float, float]:
    """What is asked for, else the spindle's range, else a usual one, rev/min."""
    low, high = _USUAL
    described = described_by(given_parameters(options))
    if described is not None and described.fastest_speed < _SPEED.high:
        low, high = described.slowest_speed, described.fastest_speed
    low = low if options.low is None else options.low
    high = high if options.high is None else options.high
    return _SPEED.check('--from', low), _SPEED.check('--to', high)


def _top(limits: SafeLimit) -> float:
    """Where a chart may end: some lowest limits up."""
    lowest = float(np.min(limits.open_limit))
    return min(_HEADROOM * lowest, _DEPTH.high) if math.isfinite(lowest) else 1e-3


class _Wide(NamedTuple):
    """Where wide work is told of, done and kept until the picture is there."""

    screen: Screen
    executor: Executor
    kept: Path


def _map(  # noqa: PLR0913, PLR0917 -- what is drawn, and where
    config: LatheConfig, low: float, high: float, top: float, law: SpeedLaw, wide: _Wide
) -> GrowthMap:
    """The growth rates over the chart."""
    columns, rows = _VARIED_MAP if config.cut.speed_variation_amplitude > 0.0 else _MAP
    with wide.screen.progress('growth rates', columns * rows) as bar:
        return growth_map(
            config.machine,
            config.cut,
            chart_speeds(low, high, columns),
            np.linspace(top / _SHALLOWEST, top, rows),
            tool_leaves_cut=config.setup.tool_leaves_cut,
            law=law,
            executor=wide.executor,
            kept_in=wide.kept,
            progress=bar.advance,
        )


def _probability(
    options: Namespace, config: LatheConfig, low: float, high: float, wide: _Wide
) -> StabilityProbability | None:
    """Of a machine that is known with errors, None where nothing is said of any."""
    known = None
    if options.uncertain is not None:
        known = uncertainty_from(options.uncertain, config.machine)
    elif described := described_by(given_parameters(options)):
        known = described.uncertainty
    if not known:
        return None
    with wide.screen.progress('machines as the truth may be', _PROBABLE_MACHINES) as bar:
        return stability_probability(
            config.machine,
            known,
            config.cut,
            chart_speeds(low, high, _PROBABLE_SPEEDS),
            machines=_PROBABLE_MACHINES,
            tool_leaves_cut=config.setup.tool_leaves_cut,
            executor=wide.executor,
            kept_in=wide.kept,
            progress=bar.advance,
        )


def _show_probability(
    config: LatheConfig, probability: StabilityProbability, screen: Screen
) -> None:
    """What is safe at the speed of the cut, and what makes it uncertain."""
    speed = config.cut.spindle_speed_rpm
    sure = np.interp(speed, probability.spindle_speed_rpm, probability.safe_depth(SURE))
    screen.say(f'stable with {SURE:.0%} at {speed:g} rev/min: up to {sure * 1e3:.4f} mm')
    shares = [
        f'{name} {share:.0%}'
        for name, share in probability.worth_repeating(speed)
        if share >= _WORTH_A_WORD
    ]
    if shares:
        screen.say(f'uncertain there by: {", ".join(shares[:4])}')


def _columns(config: LatheConfig, limits: SafeLimit) -> dict[str, Array]:
    """The chart as columns; without what the machine has not."""
    columns = {
        'spindle_speed_rpm': limits.spindle_speed_rpm,
        'safe_depth': limits.depth_of_cut,
        'open_limit': limits.open_limit,
    }
    if config.cut.bearing_contact is not BearingContact.NONE:
        columns |= {'seated_limit': limits.seated_limit, 'seating_line': limits.seating_line}
    return columns


def _write_csv(path: Path, config: LatheConfig, limits: SafeLimit) -> None:
    """Limits over speed, m and rev/min; an infinite limit is `inf`."""
    columns = _columns(config, limits)
    with path.open('w', newline='', encoding='utf-8') as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(zip(*(values.tolist() for values in columns.values()), strict=True))


def _figures(
    config: LatheConfig,
    limits: SafeLimit,
    growth: GrowthMap | None,
    probability: StabilityProbability | None,
) -> dict[str, Any]:
    """The chart as figures; an infinite limit is null in JSON."""
    return {
        'parameters': config.parameters(),
        **_columns(config, limits),
        **({} if growth is None else {'map': growth}),
        **(
            {}
            if probability is None
            else {
                'safe_with_95_percent': {
                    'spindle_speed_rpm': probability.spindle_speed_rpm,
                    'depth_of_cut': probability.safe_depth(SURE),
                },
                'worth_repeating': dict(probability.worth_repeating(config.cut.spindle_speed_rpm)),
            }
        ),
    }


def _show(config: LatheConfig, limits: SafeLimit, screen: Screen) -> None:
    """The lowest limits, and what holds at the speed of the cut."""
    names = [('open', limits.open_limit)]
    if config.cut.bearing_contact is not BearingContact.NONE:
        names.append(('on its bearing', limits.seated_limit))
    names.append(('safe', limits.depth_of_cut))
    for name, values in names:
        lowest, low, high = lowest_limit(limits.spindle_speed_rpm, values)
        if math.isinf(lowest):
            screen.say(f'no limit, {name}, at any of these speeds')
            continue
        where = f'at {low:.0f} rev/min'
        if high > low:
            where = f'in every lobe from {low:.0f} to {high:.0f} rev/min'
        screen.say(f'lowest limit, {name}: {lowest * 1e3:.4f} mm {where}')
