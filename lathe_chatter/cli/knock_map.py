"""`lathe-chatter knock-map`: the knock that a cut survives, over speed, depth and clearance."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import Any

import numpy as np

from lathe_chatter.cli.common_options import add_force, add_json, in_unit, path_of
from lathe_chatter.cli.console import INTERRUPTED, Screen, keep_existing, writing
from lathe_chatter.cli.parameter_options import (
    add_parameter_options,
    config_of,
    only_of_samples,
    say_what_is_assumed,
)
from lathe_chatter.cli.worker_options import add_executor, executor_of
from lathe_chatter.errors import ParameterError
from lathe_chatter.knocks import KnockGrid, KnockLimit, KnockMap, Margin, run_knock_map
from lathe_chatter.knocks.knock_map import Point
from lathe_chatter.model import Cut
from lathe_chatter.model.quantity_fields import limits_of
from lathe_chatter.plot_style import files_of_picture, text_of
from lathe_chatter.stability import contact_at

EXAMPLE = 'lathe-chatter knock-map --speeds 2000:6000:33 --depths 0.0004:0.001:25'

_AXES = (
    ('speeds', 'spindle_speed_rpm', 'rev/min'),
    ('depths', 'depth_of_cut', 'm'),
    ('clearances', 'bearing_clearance', 'm'),
)


def configure(parser: ArgumentParser) -> None:
    """Declare the options."""
    for option, _, unit in _AXES:
        parser.add_argument(
            f'--{option}', metavar='A:B:N',
            help=f'N values from A to B, or one, {unit} (default: that of the cut)',
        )  # fmt: skip
    parser.add_argument(
        '--output', type=path_of, default=Path('knocks.jsonl'), metavar='FILE',
        help='file to keep the points in, with a PNG and an SVG beside it; one that was '
        'interrupted is continued (default: %(default)s)',
    )  # fmt: skip
    parser.add_argument(
        '--reach', type=float, default=30.0, metavar='X',
        help='largest knock over the largest that is sure to die out (default: %(default)g)',
    )  # fmt: skip
    parser.add_argument(
        '--step', type=float, default=1.12, metavar='X',
        help='ratio of one knock tried to the next (default: %(default)g)',
    )  # fmt: skip
    parser.add_argument(
        '--tolerance', type=float, default=0.01, metavar='X',
        help='relative width to which the smallest is bracketed (default: %(default)g)',
    )  # fmt: skip
    add_executor(parser)
    add_force(parser)
    add_json(parser)
    add_parameter_options(
        parser,
        without={
            **only_of_samples('a knock is followed without it'),
            **{field: f'give --{option}' for option, field, _ in _AXES},
            'speed_variation_amplitude': 'a knock is followed at a steady speed',
            'speed_variation_frequency': 'a knock is followed at a steady speed',
            'tool_leaves_cut': 'a knock is followed with a tool that leaves the cut',
        },
    )


_FEW = 25
"""Points of a map that shows no shape."""


def run(options: Namespace) -> int:
    """Compute, or continue, and draw."""
    from lathe_chatter.report.knock_map import draw_knock_map

    config = config_of(options)
    speeds, depths, clearances = (
        _axis(option, field, getattr(options, option), config.cut) for option, field, _ in _AXES
    )
    grid = KnockGrid(
        config, speeds, depths, clearances,
        options.reach, options.step, options.tolerance,
    )  # fmt: skip
    files = files_of_picture(options.output)
    if options.output in files:
        allowed = 'no name of a picture, which is drawn beside it, but one as knocks.jsonl'
        raise ParameterError('--output', str(options.output), '', allowed)
    if not options.output.exists():  # else they are pictures of it
        keep_existing(*files, force=options.force)
    screen = Screen(json=options.json)
    points = len(speeds) * len(depths) * len(clearances)
    if 1 < points < _FEW:
        axes = {'speeds': speeds, 'depths': depths, 'clearances': clearances}
        name, values = max(axes.items(), key=lambda axis: len(axis[1]))
        screen.say(
            f'A map of {points} points shows no shape: give axes more values, as '
            f'--{name} {values[0]:g}:{values[-1]:g}:15.'
        )
    screen.compile()
    try:
        with executor_of(options, screen) as executor, screen.progress('points') as bar:
            knocks = run_knock_map(grid, options.output, bar.show, executor=executor)
    except KeyboardInterrupt:
        screen.say(f'Interrupted: the same call goes on from {options.output}.')
        return INTERRUPTED
    with writing(options.output):
        draw_knock_map(knocks, options.output)
    say_what_is_assumed(config.described, screen, config.machine, config.cut)
    _show(knocks, screen)
    screen.name_file('points', options.output)
    for file in files:
        screen.name_file('picture', file)
    screen.json([_figures(point, limit) for point, limit in sorted(knocks.limits.items())])
    return 0


def _axis(option: str, field: str, text: str | None, cut: Cut) -> tuple[float, ...]:
    """`A:B:N`, a single value, or that of the cut as values of a field of it.

    Raises:
        ParameterError: If it is neither, or a value is not allowed.
    """
    limits = limits_of(Cut, field)
    if text is None:
        return (float(getattr(cut, field)),)
    parts = text.split(':')
    values = [in_unit(limits.unit)(part) for part in parts[:2]]
    count = int(parts[2]) if len(parts) == 3 and parts[2].isdigit() else 1
    if len(parts) not in {1, 3} or count < (2 if len(parts) == 3 else 1):
        raise ParameterError(f'--{option}', text, '', 'one value, or A:B:N with N of 2 or more')
    checked = [limits.check(f'--{option}', value) for value in values]
    if len(checked) == 1:
        return (checked[0],)
    if not checked[0] < checked[1]:
        raise ParameterError(f'--{option}', text, '', 'A:B:N with A below B')
    return tuple(np.linspace(checked[0], checked[1], count).tolist())


def _show(knocks: KnockMap, screen: Screen) -> None:
    """How the points are divided, and the weakest of the conditionally stable ones."""
    limits = list(knocks.limits.items())
    counts = {margin: sum(limit.margin is margin for _, limit in limits) for margin in Margin}
    screen.say(
        f'Of {len(limits)} cuts {counts[Margin.UNSTABLE]} chatter unknocked, '
        f'{counts[Margin.FINITE]} can be knocked into lasting chatter, '
        f'{counts[Margin.NONE_FOUND]} survive every knock that was tried.'
    )
    finite = [(point, limit) for point, limit in limits if limit.margin is Margin.FINITE]
    if finite:
        point, limit = min(finite, key=lambda entry: abs(entry[1].impulse))
        grid = knocks.grid
        stable = contact_at(grid.config.machine, grid.cut_at(point))
        screen.say(
            f'Weakest: {point.spindle_speed_rpm:g} rev/min, {point.depth_of_cut * 1e3:.4g} mm '
            f'(limit {stable.limit * 1e3:.4g} mm), clearance '
            f'{text_of(point.bearing_clearance, "m")}: a knock of '
            f'{text_of(abs(limit.impulse), "N s")} lasts, of {text_of(limit.survived, "N s")} '
            f'dies out; chatter of {text_of(limit.amplitude, "m")} peak to peak at the tool.'
        )


def _figures(point: Point, limit: KnockLimit) -> dict[str, Any]:
    """A point, SI units; what is unknown is null."""
    return {
        **point._asdict(),
        'margin': limit.margin.value,
        'impulse': limit.impulse,
        'survived': limit.survived,
        'searched': limit.searched,
    }
