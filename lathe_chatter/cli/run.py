"""`lathe-chatter run`: the main job. A cell of real nodes plays a scenario and is recorded."""

from __future__ import annotations

import json
from argparse import ArgumentParser, Namespace
from datetime import datetime
from pathlib import Path

from rich.console import Console

from lathe_chatter.cli.console import tell_verdict
from lathe_chatter.cli.report import show_run
from lathe_chatter.nodes.deferred_signals import DeferredSignals
from lathe_chatter.nodes.process_group import RunFailedError
from lathe_chatter.precompile import precompile
from lathe_chatter.recording import read_run
from lathe_chatter.recording.run import RunReadError
from lathe_chatter.report.history import read_history
from lathe_chatter.scenario import (
    CLEARED,
    FLAGGED,
    Scenario,
    find_scenario,
    load_scenario,
    shipped_scenarios,
)

NAME = 'run'
HELP = 'start lathe, monitor and recorder, play a scenario, and leave the recorded run'
EXAMPLE = 'lathe-chatter run --scenario no_clearance --output runs/without'

INTERRUPTED = 130


def configure(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        '--scenario',
        default='clearance',
        metavar='FILE',
        help=f'a YAML file, or one of {", ".join(shipped_scenarios())} (default: %(default)s)',
    )
    parser.add_argument(
        '--output', type=Path, metavar='DIR', help='folder to make (default: runs/<date-time>)'
    )
    parser.add_argument('--json', action='store_true', help='print the figures as JSON')


def run(options: Namespace) -> int:
    """Play the scenario; 0 if the monitor said what the scenario expects, else 1."""
    file = find_scenario(options.scenario)
    scenario = load_scenario(file)
    output = options.output or Path('runs', f'{datetime.now().astimezone():%Y%m%d-%H%M%S}')
    if output.exists():
        raise RunFailedError(f'{output} exists already: give another --output.')
    console = Console(stderr=options.json, highlight=False)
    console.print(f'[bold]{scenario.title}[/bold]  (scenario {scenario.name})')
    with console.status('Compiling the integrator (once on a machine) ...'):
        precompile()
    interrupted = _play(scenario, file, output, console)
    if interrupted and not _has_samples(output):
        console.print('Interrupted before anything was recorded.')
        return INTERRUPTED
    if interrupted:
        console.print('Interrupted: the run is finished and reported ...')
    history = read_history(output)
    figures = show_run(history, console)
    if options.json:
        Console(highlight=False, soft_wrap=True).print(json.dumps(figures))
    if interrupted:
        console.print('Interrupted: the run above is complete up to that moment.')
        return INTERRUPTED
    said = {
        FLAGGED: any(flag.chatter for flag in history.flags),
        CLEARED: bool(history.flags) and not history.flags[-1].chatter,
    }
    return tell_verdict(scenario, said, console)


def _has_samples(output: Path) -> bool:
    """Whether a run was begun and has samples of a lathe."""
    try:
        run = read_run(output)
        topics = [name for name in run.topics if name.endswith('/samples')]
        return any(True for _ in run.raw_messages(*topics)) if topics else False
    except RunReadError:
        return False


def _play(scenario: Scenario, file: Path, output: Path, console: Console) -> bool:
    """Play a scenario with a cell of nodes; whether it was interrupted.

    Raises:
        RunFailedError: If there is no ROS 2 here, or the run fails.
    """
    try:
        with DeferredSignals():  # an import cut short would look like a ROS 2 that is not there
            from lathe_chatter.nodes.run_scenario import play
    except ImportError as error:
        raise RunFailedError(
            f'ROS 2 is not there ({error}): source an installation, or use `make run`, '
            'which installs what it needs.'
        ) from None
    return play(scenario, file, output, console)
