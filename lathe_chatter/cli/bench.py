"""`lathe-chatter bench`: the performance figures of the package on this machine."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from dataclasses import asdict

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.progress import track
from rich.table import Table

from lathe_chatter.cli.console import print_json
from lathe_chatter.errors import ParameterError
from lathe_chatter.precompile import precompile

NAME = 'bench'
HELP = 'print the performance figures of this package on this machine'
EXAMPLE = 'lathe-chatter bench lathe stability'

_MOST = 1000


def configure(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        'topics', nargs='*', metavar='TOPIC', help='lathe, detector or stability (default: all)'
    )
    parser.add_argument(
        '--repeats', type=int, default=7, metavar='N', help='of each call (default: %(default)s)'
    )
    parser.add_argument('--json', action='store_true', help='print the figures as JSON')


def run(options: Namespace) -> int:
    """Measure and print."""
    from lathe_chatter.bench import TOPICS, this_machine

    unknown = next((topic for topic in options.topics if topic not in TOPICS), None)
    if unknown is not None:
        raise ParameterError('TOPIC', unknown, '', f'one of {", ".join(TOPICS)}')
    if not 1 <= options.repeats <= _MOST:
        raise ParameterError('--repeats', options.repeats, '', f'from 1 to {_MOST}')
    console = Console(stderr=options.json, highlight=False)
    with console.status('Compiling the integrator (once on a machine) ...'):
        precompile()
    topics = options.topics or list(TOPICS)
    found = {
        topic: TOPICS[topic](options.repeats)
        for topic in track(topics, 'measuring', console=console, transient=True)
    }
    table = Table(box=SIMPLE_HEAD, pad_edge=False, title=this_machine(), title_justify='left')
    table.add_column('figure')
    table.add_column('median', justify='right', no_wrap=True)
    table.add_column('unit', no_wrap=True)
    for topic, figures in found.items():
        table.add_section()
        for figure in figures:
            table.add_row(f'{topic}: {figure.name}', f'{figure.value:.4g}', figure.unit)
    console.print(table)
    console.print('CPU time in one thread. The scripts of benchmarks/ in the source measure more.')
    if options.json:
        values = {topic: [asdict(f) for f in figures] for topic, figures in found.items()}
        print_json({'machine': this_machine(), 'figures': values})
    return 0
