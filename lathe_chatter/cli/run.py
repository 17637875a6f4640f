"""`lathe-chatter run`: the main job. A cell of real nodes plays a scenario and is recorded."""

from __future__ import annotations

import math
import shutil
import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from datetime import datetime
from pathlib import Path

from lathe_chatter.cli.common_options import add_json, path_of, utf8
from lathe_chatter.cli.console import INTERRUPTED, Screen
from lathe_chatter.cli.scenario_verdict import scenario_help, verdict
from lathe_chatter.errors import (
    NodeFailedError,
    RunFailedError,
    RunReadError,
    ScenarioFailedError,
)
from lathe_chatter.model.lathe_parameter_table import MACHINE_FILE
from lathe_chatter.model.machine_file import load_machine
from lathe_chatter.nodes.end_signals import DeferredSignals
from lathe_chatter.nodes.entry_points import no_ros
from lathe_chatter.recording import read_run
from lathe_chatter.report.run_history import History, read_history
from lathe_chatter.scenario import (
    CLEARED,
    FLAGGED,
    Scenario,
    find_scenario,
    load_scenario,
)
from lathe_chatter.supervisor import Mode

EXAMPLE = 'lathe-chatter run --scenario no_clearance --output runs/without'
_PAGE_NOISE = 0.001
"""Of the force, N/sqrt(Hz): that of a calm workshop."""


def configure(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        '--scenario',
        default='clearance',
        metavar='FILE',
        help=f'{scenario_help()} (default: %(default)s)',
    )
    parser.add_argument(
        '--output', type=path_of, metavar='DIR', help='folder to make (default: runs/<date-time>)'
    )
    parser.add_argument(
        '--machine', metavar='FILE',
        help="machine file in place of the scenario's: a path, or the name of one that is shipped",
    )  # fmt: skip
    parser.add_argument(
        '--page', action='store_true',
        help="open the operator's page in the browser and play nothing: whoever has it open "
        'operates, and may play scenarios, until Ctrl-C; the force has a little noise, '
        f'{_PAGE_NOISE} N/sqrt(Hz), unless the scenario says otherwise',
    )  # fmt: skip
    parser.add_argument(
        '--supervise',
        choices=[mode.value for mode in Mode],
        help='have a supervisor too, that watches, waits for ~/accept, or acts',
    )
    add_json(parser)


def run(options: Namespace) -> int:
    """Play the scenario; 0 if the monitor said what the scenario expects, else 1.

    A run that fails is reported up to then; 1 too, where the scenario is not to blame.

    Raises:
        LatheChatterError: If it did not begin, or the lathe refused what the scenario asked.
    """
    file = utf8('--scenario', find_scenario(options.scenario))
    scenario = _scenario(file, options)
    output = options.output or Path('runs', f'{datetime.now().astimezone():%Y%m%d-%H%M%S}')
    if utf8('--output', output).exists():
        raise RunFailedError(f'{output} exists already: give another --output.')
    screen = Screen(json=options.json)
    if not options.page:
        screen.say(f'{scenario.title}  (scenario {scenario.name})', 'bold')
    play = _player()
    screen.compile()
    try:
        interrupted = play(scenario, file, output, screen, page=options.page)
    except (NodeFailedError, RunFailedError, ScenarioFailedError) as error:
        if not _has_samples(output):
            raise
        screen.say('It has failed: the run is reported up to then ...')
        with suppress(RunReadError):
            _report(output, screen)
        if isinstance(error, ScenarioFailedError):
            raise  # a mistake in what was asked
        sys.stderr.write(f'lathe-chatter run: {error}\n')
        return 1
    if interrupted and not _has_samples(output):
        shutil.rmtree(output, ignore_errors=True)  # else it would pass for a run
        screen.say('Interrupted while the nodes were still starting: nothing was recorded.')
        return INTERRUPTED
    if interrupted:
        word = 'Ended' if options.page else 'Interrupted'
        screen.say(f'{word}: the run is finished and reported ...')
    history = _report(output, screen)
    if options.page:
        return 0  # there is no other way to end it
    if interrupted:
        screen.say('Interrupted: the run above is recorded up to that moment.')
        return INTERRUPTED
    flags = [flag.chatter for flag in history.flags if not flag.started]
    said = {FLAGGED: any(flags), CLEARED: flags[-1:] == [False]}
    return verdict(scenario, said, screen)


def _scenario(file: Path, options: Namespace) -> Scenario:
    """The scenario of a file with what the options say otherwise."""
    scenario = load_scenario(file)
    if options.machine is not None:
        load_machine(options.machine)
        parameters = {**scenario.parameters, MACHINE_FILE.name: options.machine}
        scenario = replace(scenario, parameters=parameters)
    if options.page and 'force_noise' not in scenario.parameters:
        # Without any, a stable cut is at rest, and the page has neither growth nor margin to show.
        scenario = replace(
            scenario, parameters={**scenario.parameters, 'force_noise': _PAGE_NOISE}
        )
    if options.supervise is not None:
        supervisor = {**(scenario.supervisor or {}), 'mode': options.supervise}
        scenario = replace(scenario, supervisor=supervisor)
    return scenario


def _report(output: Path, screen: Screen) -> History:
    """Report a run, and name those that its recorder has begun after it, as somebody wished."""
    from lathe_chatter.cli.report import show_run  # with all that draws, and wanted only here

    history, metadata = read_history(output), output / 'metadata.yaml'
    screen.json(show_run(history, screen))
    ended = metadata.stat().st_mtime if metadata.exists() else math.inf
    later = [
        str(each)
        for each in sorted(output.parent.glob(f'{output.name}-*'))
        if each.is_dir() and each.stat().st_mtime >= ended
    ]
    if later:
        screen.say(f'Recorded anew meanwhile, and not in this report: {", ".join(later)}')
    return history


def _has_samples(output: Path) -> bool:
    """Whether a run was begun and has samples of a lathe."""
    try:
        run = read_run(output)
        topics = run.samples_topics()
        return any(True for _ in run.raw_messages(*topics)) if topics else False
    except RunReadError:
        return False


def _player() -> Callable[..., bool]:
    """What plays a scenario with a cell of nodes.

    Raises:
        RunFailedError: If there is no ROS 2 here.
    """
    try:
        with DeferredSignals():  # an import cut short would look like a ROS 2 that is not there
            from lathe_chatter.nodes.run_scenario import play
    except ImportError as error:
        raise RunFailedError(no_ros(error)) from None
    return play
