"""`lathe-chatter simulate`: the same machine with no ROS, as fast as possible, into a run."""

from __future__ import annotations

import time
from argparse import ArgumentParser, Namespace
from dataclasses import replace

from lathe_chatter.cli.common_options import add_json, in_unit, path_of, utf8
from lathe_chatter.cli.console import INTERRUPTED, Screen, writing
from lathe_chatter.cli.parameter_options import add_parameter_options, given_parameters
from lathe_chatter.cli.report import show_run
from lathe_chatter.cli.scenario_verdict import scenario_help, verdict
from lathe_chatter.errors import ParameterError, ScenarioError
from lathe_chatter.lathe.change_and_knock_sentences import Knock
from lathe_chatter.lathe.config import config_from
from lathe_chatter.lathe.virtual_lathe import IMPULSE
from lathe_chatter.model.quantity_fields import Quantity
from lathe_chatter.model.values_with_units import number_in
from lathe_chatter.report.run_history import read_history
from lathe_chatter.scenario import (
    CLEARED,
    FLAGGED,
    Scenario,
    find_scenario,
    load_scenario,
)
from lathe_chatter.scenario.simulation import Simulated, needs_monitor, simulate

EXAMPLE = 'lathe-chatter simulate --depth-of-cut 0.001 --duration 20 --output runs/deep'

_DURATION = Quantity('simulated time', 's', high=86400.0, exclusive=True)
_USUAL_DURATION = 10.0


def configure(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        '--output', type=path_of, required=True, metavar='DIR', help='folder of the run, to make'
    )
    parser.add_argument(
        '--duration', type=in_unit('s'), metavar='S',
        help=f"simulated time, s (default: the scenario's, else {_USUAL_DURATION:g})",
    )  # fmt: skip
    parser.add_argument(
        '--scenario', metavar='FILE',
        help=f'{scenario_help()}; options below win',
    )  # fmt: skip
    parser.add_argument(
        '--knock', action='append', default=[], metavar='T:J',
        help='an impulse of J N s on the tool at T s; may be repeated',
    )  # fmt: skip
    parser.add_argument(
        '--monitor', action='store_true',
        help='have the monitor watch even if no scenario waits for it',
    )  # fmt: skip
    parser.add_argument('--report', action='store_true', help='report on the run when it is done')
    add_json(parser)
    add_parameter_options(parser)


def run(options: Namespace) -> int:
    """Simulate; 0 if the lathe got to the end and the monitor said what is expected, else 1."""
    utf8('--output', options.output)
    scenario = _scenario(options)
    knocks = [_knock(text, scenario.duration) for text in options.knock]
    screen = Screen(json=options.json)
    screen.compile()
    begun = time.perf_counter()
    try:
        done = _simulated(options, scenario, knocks, screen)
    except KeyboardInterrupt:
        if not options.output.exists():
            raise
        screen.say(f'Interrupted: the run up to there is in {options.output}.')
        return INTERRUPTED
    spent = time.perf_counter() - begun
    ratio = done.time / spent
    shown = f'{ratio:.0f}' if ratio >= 9.95 else f'{ratio:.2g}'
    screen.say(
        f'{done.time:g} s simulated in {spent:.2f} s, {shown} times real time: '
        f'{done.samples} samples.'
    )
    if done.guard:
        screen.say(done.guard)
    figures = {
        'run': done.folder,
        'samples': done.samples,
        'simulated_time': done.time,
        'wall_time': spent,
        'flagged': done.flagged,
        'cleared': done.cleared,
        'guard': done.guard,
    }
    if options.report:
        figures |= show_run(read_history(done.folder), screen)
    else:
        screen.name_file('run', done.folder)
    screen.json(figures)
    said = {FLAGGED: done.flagged, CLEARED: done.cleared}
    wrong = verdict(scenario, said, screen)
    return 1 if done.guard else wrong


def _scenario(options: Namespace) -> Scenario:
    """What to play: a file's or an empty one, with the options over it."""
    scenario = Scenario('cut', 'A cut', _USUAL_DURATION)
    if options.scenario is not None:
        scenario = load_scenario(utf8('--scenario', find_scenario(options.scenario)))
    if options.duration is not None:
        duration = _DURATION.check('--duration', options.duration)
        scenario = replace(scenario, duration=duration)
    if scenario.supervisor is not None:
        raise ScenarioError(
            f'The scenario {scenario.name} has a supervisor, which takes real nodes: play it with '
            '`lathe-chatter run`.'
        )
    parameters = {**scenario.parameters, **given_parameters(options)}
    config_from(parameters)  # or says what is wrong, before anything is compiled
    return replace(scenario, parameters=parameters)


def _knock(text: str, duration: float) -> Knock:
    """`T:J` as a knock in a run of so many seconds.

    Raises:
        ParameterError: If it is none.
    """
    time_text, _, impulse_text = text.partition(':')
    at, impulse = number_in(time_text, 's'), number_in(impulse_text, 'N s')
    if at is None or impulse is None:
        raise ParameterError('--knock', text, '', 'T:J, as 1.5:0.002')
    Quantity('time', 's', high=duration).check('--knock', at)
    IMPULSE.check('--knock', impulse)
    return Knock(at, impulse)


def _simulated(
    options: Namespace, scenario: Scenario, knocks: list[Knock], screen: Screen
) -> Simulated:
    """Simulate with a bar of simulated time."""
    with (
        screen.progress('simulating', scenario.duration, 's') as bar,
        writing(options.output),
    ):
        return simulate(
            scenario,
            options.output,
            knocks=knocks,
            monitor=options.monitor or needs_monitor(scenario),
            progress=bar.show,
            tell=lambda now, what: screen.say(f'{now:7.2f} s  {what}'),
        )
