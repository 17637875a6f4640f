"""`lathe-chatter recover`: what is sound of a damaged run, as a new one."""

from __future__ import annotations

import json
from argparse import ArgumentParser, Namespace
from pathlib import Path

from rich.console import Console

from lathe_chatter.errors import LatheChatterError, reason_of
from lathe_chatter.recording import recover

NAME = 'recover'
HELP = 'save every whole part of a damaged run into a new one; the old one is only read'
EXAMPLE = 'lathe-chatter recover runs/damaged --output runs/saved'


class RecoverFailedError(LatheChatterError):
    """The new run cannot be written; the text says why."""


def configure(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument('run_path', type=Path, metavar='RUN', help='folder or file of a run')
    parser.add_argument(
        '--output', type=Path, metavar='DIR', help='folder to make (default: RUN-recovered)'
    )
    parser.add_argument('--json', action='store_true', help='print the figures as JSON')


def run(options: Namespace) -> int:
    """Recover; 0 if nothing had to be left behind, else 1."""
    path: Path = options.run_path
    output = options.output or path.with_name(f'{path.stem}-recovered')
    try:
        saved = recover(path, output)
    except OSError as error:
        raise RecoverFailedError(f'{output} cannot be written: {reason_of(error)}.') from None
    console = Console(highlight=False, soft_wrap=True)
    damage = [*map(str, saved.damage), *saved.lost]
    if options.json:
        figures = {'run': str(output), 'messages': dict(saved.messages), 'damage': damage}
        console.print(json.dumps(figures), markup=False)
        return 1 if damage else 0
    for name, count in sorted(saved.messages.items()):
        console.print(f'{count:9d}  {name}', markup=False)
    for each in damage:
        console.print(f'LOST  {each}', markup=False)
    console.print(f'saved into {output}', markup=False)
    return 1 if damage else 0
