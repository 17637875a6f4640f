"""`lathe-chatter recover`: what is sound of a damaged run, as a new one."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from pathlib import Path

from lathe_chatter.cli.common_options import add_json, add_run, path_of, utf8
from lathe_chatter.cli.console import Screen, writing
from lathe_chatter.recording import recover

EXAMPLE = 'lathe-chatter recover runs/damaged --output runs/saved'


def configure(parser: ArgumentParser) -> None:
    """Declare the options."""
    add_run(parser)
    parser.add_argument(
        '--output', type=path_of, metavar='DIR', help='folder to make (default: RUN-recovered)'
    )
    add_json(parser)


def run(options: Namespace) -> int:
    """Recover; 0 if nothing had to be left behind, else 1."""
    path: Path = options.run_path
    output = options.output or path.with_name(f'{path.stem}-recovered')
    with writing(utf8('--output', output)):
        saved = recover(path, output)
    screen = Screen(json=options.json)
    damage = [*map(str, saved.damage), *saved.lost]
    for name, count in sorted(saved.messages.items()):
        screen.say(f'{count:9d}  {name}')
    for each in damage:
        screen.say(f'LOST  {each}')
    screen.say(f'saved into {output}')
    screen.json({'run': output, 'messages': saved.messages, 'damage': damage})
    return 1 if damage else 0
