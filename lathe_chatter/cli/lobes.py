"""`lathe-chatter lobes`: the stability chart of a machine as a picture and as numbers."""

from __future__ import annotations

import csv
import math
from argparse import ArgumentParser, Namespace
from collections.abc import Iterator
from concurrent.futures import Executor
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lathe_chatter.array_types import Array
from lathe_chatter.cli.common_options import (
    PICTURES,
    add_force,
    add_json,
    in_unit,
    path_of,
    picture_file,
)
from lathe_chatter.cli.console import INTERRUPTED, Screen, keep_existing, writing
from lathe_chatter.cli.parameter_options import (
    add_parameter_options,
    config_of,
    only_of_samples,
    say_what_is_assumed,
)
from lathe_chatter.cli.worker_options import add_executor, executor_of
from lathe_chatter.errors import ParameterError, UnprovenError
from lathe_chatter.lathe.config import LatheConfig
from lathe_chatter.model import BearingContact, Cut, Machine
from lathe_chatter.model.quantity_fields import Quantity, limits_of
from lathe_chatter.model.uncertainty import Uncertainty, uncertainty_from
from lathe_chatter.plot_style import files_of_picture
from lathe_chatter.report.probability_chart import (
    SURE,
    cut_probability,
    interpolation_speeds,
    probability_sentence,
)
from lathe_chatter.report.stability_chart import (
    chart_limits,
    chart_speeds,
    draw_lobes,
    top_of_chart,
    usual_speeds,
)
from lathe_chatter.stability import GrowthMap, SafeLimit, SpeedLaw, growth_map, lowest_limit
from lathe_chatter.stability.probability import StabilityProbability, stability_probability

EXAMPLE = 'lathe-chatter lobes --bearing-clearance 1e-5 --map --csv lobes.csv'

_SPEED = limits_of(Cut, 'spindle_speed_rpm')
_DEPTH = Quantity(
    'top of the chart', 'm', high=limits_of(Cut, 'depth_of_cut').high, exclusive=True
)
_PROBABLE_MACHINES = 600
_MAP = (222, 76)
_VARIED_MAP = (56, 20)
"""Speeds and depths of a map; each point of a varying speed is an eigenproblem of its own."""
_PROBABILITIES = (0.05, 0.25, 0.5, 0.75, 0.95)
"""At which JSON has the depth that is stable with them."""
_SHALLOWEST = 1000.0
"""Part of the top at which a map begins: at a depth of 0 there is no cut."""


def configure(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        '--from', dest='low', type=in_unit('rev/min'), metavar='RPM',
        help="lowest speed, rev/min (default: that of the machine file's spindle, else one that "
        'suits its most flexible mode)',
    )  # fmt: skip
    parser.add_argument(
        '--to', dest='high', type=in_unit('rev/min'), metavar='RPM',
        help='highest speed, rev/min (default: likewise)',
    )  # fmt: skip
    parser.add_argument(
        '--depth-limit', type=in_unit('m'), metavar='M', help='top of the chart, m (default: fits)'
    )
    parser.add_argument(
        '--uncertain', metavar='LIST',
        help='relative standard errors of the machine, as frequency=2%%,damping=20%%,'
        'stiffness=5%%,C=15%%, in place of those of the machine file and beside its others: the '
        'chart shows the probability of being stable',
    )  # fmt: skip
    parser.add_argument('--map', action='store_true', help='colour the chart with the growth rate')
    parser.add_argument(
        '--law', choices=[law.value for law in SpeedLaw], default=SpeedLaw.SPEED.value,
        help="what swings where the speed is varied: the spindle's speed, or the delay, as most "
        'of the literature has it (default: %(default)s)',
    )  # fmt: skip
    parser.add_argument(
        '--output', type=path_of, default=Path('lobes.png'), metavar='FILE',
        help='picture to write: .png with an .svg beside it, .svg or .pdf (default: %(default)s)',
    )  # fmt: skip
    parser.add_argument(
        '--csv',
        type=path_of,
        metavar='FILE',
        help='write the limits as CSV too, and with --map its points beside them as FILE-map.csv',
    )
    add_executor(parser)
    add_force(parser)
    add_json(parser)
    add_parameter_options(parser, without=only_of_samples('no limit of a cut depends on it'))


def run(options: Namespace) -> int:
    """Draw and print the chart."""
    config = config_of(options)
    low, high = _speed_range(options, config)
    if not low < high:
        raise ParameterError('--to', high, 'rev/min', f'above --from, {low:g} rev/min')
    if options.uncertain is not None and _is_mapped(options, config):
        allowed = 'left out where growth rates colour the chart: it has one colour'
        raise ParameterError('--uncertain', options.uncertain, '', allowed)
    files = files_of_picture(picture_file(options.output))
    keep_existing(*files, *_tables(options, config), force=options.force)
    limits = chart_limits(
        config.machine,
        config.cut,
        chart_speeds(low, high),
        tool_leaves_cut=config.setup.tool_leaves_cut,
    )
    top = top_of_chart(config.cut, limits) if options.depth_limit is None else options.depth_limit
    top = _DEPTH.check('--depth-limit', top)
    screen = Screen(json=options.json)
    kept = options.output.with_suffix('.jsonl')
    known = _uncertainty(options, config)
    try:
        with executor_of(options, screen) as executor:
            wide = _Wide(screen, executor, kept)
            growth, probability = _coloured(options, config, limits, known, top, wide)
    except KeyboardInterrupt:
        screen.say(f'Interrupted: the same call goes on from {kept}.')
        return INTERRUPTED
    with writing(options.output):
        options.output.parent.mkdir(parents=True, exist_ok=True)
        draw_lobes(
            config.cut, limits, growth, top, options.output,
            probability=probability, mark=_is_cut_known(config),
        )  # fmt: skip
    if options.csv is not None:
        with writing(options.csv):
            _write_csv(options.csv, _columns(config, limits), growth, probability)
    if growth is not None or probability is not None:
        kept.unlink(missing_ok=True)
    say_what_is_assumed(config.described, screen, config.machine, config.cut)
    for sentence in _doubts(config, limits):
        screen.say(f'WARNING  {sentence}')
    _show(config, limits, top, screen)
    figures = _figures(config, limits, growth)
    if probability is not None and known:
        of_cut = stability_probability(
            config.machine, known, config.cut, config.cut.spindle_speed_rpm,
            tool_leaves_cut=config.setup.tool_leaves_cut,
        )  # fmt: skip
        sure = float(np.min(probability.safe_depth(SURE))) * 1e3
        screen.say(f'lowest depth that is safe with {SURE:.0%}: {sure:.4g} mm')
        if _is_cut_known(config):
            screen.say(probability_sentence(config.cut, of_cut))
        figures |= _probable_figures(config, probability, of_cut)
    for file in files:
        screen.name_file('picture', file)
    screen.json(figures)
    return 0


def _is_cut_known(config: LatheConfig) -> bool:
    """Whether it is said what is cut: a machine of one's own does not cut as the paper's."""
    usual, cut = Cut(), config.cut
    told = cut.spindle_speed_rpm, cut.depth_of_cut
    return config.described is None or told != (usual.spindle_speed_rpm, usual.depth_of_cut)


def _doubts(config: LatheConfig, limits: SafeLimit) -> Iterator[str]:
    """What a machine's own file leads one to doubt: the coefficient, the feed, or the speeds."""
    described, cut = config.described, config.cut
    deepest, lowest = limits_of(Cut, 'depth_of_cut').high, float(np.min(limits.open_limit))
    if deepest < lowest < math.inf:
        yield (
            f'No cut is as deep as the lowest limit, {lowest:.3g} m: is the cutting coefficient, '
            f'{config.machine.cutting_coefficient:g} N/m2, in its unit?'
        )
    if described is None:
        return
    own = described.machine.workpiece != Machine().workpiece
    fed = cut.feed_per_revolution or cut.feed_speed != Cut().feed_speed
    if own and not fed and cut.bearing_contact is not BearingContact.NONE:
        yield (
            f'Where the workpiece seats is drawn for a feed of {cut.feed_speed * 1e3:g} mm/s, '
            "the paper's: give --feed-per-revolution or `cut: {feed: ...}`."
        )
    low, high = limits.spindle_speed_rpm[[0, -1]]
    if _is_cut_known(config) and (doubt := described.speed_doubt(cut)):
        yield doubt
    ends = [described.speed_doubt(cut.with_changes(spindle_speed_rpm=end)) for end in (low, high)]
    if any(ends):
        swing = cut.speed_variation_amplitude
        with_swing = f' with its swing of {swing:.0%}' if swing else ''
        yield f'The chart has speeds at which the spindle{with_swing} leaves its range.'


def _tables(options: Namespace, config: LatheConfig) -> list[Path]:
    """The files of figures that are wanted."""
    if options.csv is None:
        return []
    if options.csv.suffix in PICTURES:
        raise ParameterError('--csv', str(options.csv), '', 'another file than a picture')
    return [options.csv, *([_map_file(options.csv)] if _is_mapped(options, config) else [])]


def _is_mapped(options: Namespace, config: LatheConfig) -> bool:
    """Whether the chart is coloured with growth rates: where asked for, and where speed varies."""
    return bool(options.map or config.cut.speed_variation_amplitude > 0.0)


def _speed_range(options: Namespace, config: LatheConfig) -> tuple[float, float]:
    """What is asked for, else the spindle's range, else one that suits the machine, rev/min.

    Where the speed is varied those at which all of its swing is in the spindle's range.
    """
    spindle = config.described.speed_range if config.described else None
    low, high = spindle or usual_speeds(config.machine, config.cut)
    if spindle:
        swing = config.cut.speed_variation_amplitude
        low, high = low / (1.0 - swing), high / (1.0 + swing)
        if not low < high:
            allowed = f'a swing that a spindle of {spindle[0]:g} to {spindle[1]:g} rev/min has'
            raise ParameterError('speed_variation_amplitude', swing, '', allowed)
    low = low if options.low is None else options.low
    high = high if options.high is None else options.high
    return _SPEED.check('--from', low), _SPEED.check('--to', high)


class _Wide(NamedTuple):
    """Where wide work is told of, done and kept until the picture is there."""

    screen: Screen
    executor: Executor
    kept: Path


def _coloured(  # noqa: PLR0913, PLR0917 -- what is drawn, and where
    options: Namespace, config: LatheConfig, limits: SafeLimit, known: Uncertainty | None,
    top: float, wide: _Wide,
) -> tuple[GrowthMap | None, StabilityProbability | None]:  # fmt: skip
    """What the chart is coloured with: growth rates, a probability, or nothing."""
    try:
        if _is_mapped(options, config):
            low, high = limits.spindle_speed_rpm[[0, -1]]
            return _map(config, low, high, top, SpeedLaw(options.law), wide), None
        return None, _probability(config, known, limits, wide) if known else None
    except UnprovenError:  # no other call would get further from there
        wide.kept.unlink(missing_ok=True)
        raise


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


def _uncertainty(options: Namespace, config: LatheConfig) -> Uncertainty | None:
    """Of the machine, None where nothing is said of any."""
    known = config.described.uncertainty if config.described else None
    if options.uncertain is not None:
        return uncertainty_from(options.uncertain, config.machine, known, given_as='--uncertain')
    return known


def _probability(
    config: LatheConfig, known: Uncertainty, limits: SafeLimit, wide: _Wide
) -> StabilityProbability:
    """How probable it is to be stable, over the chart."""
    with wide.screen.progress('machines as the truth may be', _PROBABLE_MACHINES) as bar:
        return stability_probability(
            config.machine,
            known,
            config.cut,
            interpolation_speeds(limits),
            machines=_PROBABLE_MACHINES,
            tool_leaves_cut=config.setup.tool_leaves_cut,
            executor=wide.executor,
            kept_in=wide.kept,
            progress=bar.advance,
        )


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


def _write_csv(
    path: Path, columns: dict[str, Array], growth: GrowthMap | None,
    probability: StabilityProbability | None,
) -> None:  # fmt: skip
    """Limits over speed, m and rev/min; an infinite limit is `inf`.

    With a probability the depth that is safe with 95 %, between its speeds along a line; a map
    is a file of its own beside it, a row for each of its points.
    """
    if probability is not None:
        known = probability.spindle_speed_rpm, probability.safe_depth(SURE)
        sure = np.interp(columns['spindle_speed_rpm'], *known)
        columns = {**columns, 'safe_depth_with_95_percent': sure}
    _write_table(path, columns)
    if growth is not None:
        speed, depth = np.meshgrid(growth.spindle_speed_rpm, growth.depth_of_cut)
        points = {
            'spindle_speed_rpm': speed,
            'depth_of_cut': depth,
            'growth_rate': growth.growth_rate,
            'seated': growth.seated.astype(int),
        }
        _write_table(_map_file(path), {name: each.ravel() for name, each in points.items()})


def _map_file(path: Path) -> Path:
    """Where the map goes whose limits are in a CSV file."""
    return path.with_name(f'{path.stem}-map{path.suffix}')


def _write_table(path: Path, columns: dict[str, Array]) -> None:
    with path.open('w', newline='', encoding='utf-8') as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(zip(*(values.tolist() for values in columns.values()), strict=True))


def _figures(config: LatheConfig, limits: SafeLimit, growth: GrowthMap | None) -> dict[str, Any]:
    """The chart as figures; an infinite limit is null in JSON."""
    machine = config.description.sections() if config.described else None
    return {
        'parameters': config.parameters() | {'machine': machine},
        **_columns(config, limits),
        **({} if growth is None else {'map': growth}),
    }


def _probable_figures(
    config: LatheConfig, chart: StabilityProbability, of_cut: StabilityProbability
) -> dict[str, Any]:
    """How sure that is."""
    return {
        'safe_with_95_percent': {
            'spindle_speed_rpm': chart.spindle_speed_rpm,
            'depth_of_cut': chart.safe_depth(SURE),
            'probabilities': _PROBABILITIES,
            'depths': [chart.safe_depth(share) for share in _PROBABILITIES],
        },
        'cut': cut_probability(config.cut, of_cut),
    }


def _show(config: LatheConfig, limits: SafeLimit, top: float, screen: Screen) -> None:
    """The lowest limits, and the highest one that the chart has no room for."""
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
        screen.say(f'lowest limit, {name}: {lowest * 1e3:.4g} mm {where}')
    depth = np.where(np.isfinite(limits.depth_of_cut), limits.depth_of_cut, 0.0)
    if depth[k := int(depth.argmax())] > top:
        where = f'{depth[k] * 1e3:.4g} mm at {limits.spindle_speed_rpm[k]:.0f} rev/min'
        screen.say(f'highest limit, safe: {where}, above the chart (--depth-limit)')
