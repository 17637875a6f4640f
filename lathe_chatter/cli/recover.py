"""`lathe-chatter recover`: what is sound of a damaged run, as a new one."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections import Counter
from pathlib import Path

from lathe_chatter.cli.common_options import add_json, add_run, path_of, utf8
from lathe_chatter.cli.console import Screen, writing
from lathe_chatter.errors import NothingSavedError
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
    screen, messages = Screen(json=options.json), Counter[str]()
    try:
        with writing(utf8('--output', output)):
            saved = recover(path, output)
    except NothingSavedError as error:
        made, damage, end = None, error.damage, str(error)
    else:
        made, damage, end = output, [*map(str, saved.damage), *saved.lost], f'saved into {output}'
        messages = saved.messages
    for name, count in sorted(messages.items()):
        screen.say(f'{count:9d}  {name}')
    for each in damage:
        screen.say(f'LOST  {each}')
    screen.say(end)
    screen.json({'run': made, 'messages': messages, 'damage': damage})
    return 1 if damage else 0
