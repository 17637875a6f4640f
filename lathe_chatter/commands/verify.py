"""`lathe-chatter verify`: whether a recorded run is complete."""

from __future__ import annotations

import json
from argparse import ArgumentParser, Namespace
from pathlib import Path

from rich.console import Console

from lathe_chatter.recording import RunReadError, resimulate, verify
from lathe_chatter.recording.resimulate import finding_of

NAME = 'verify'
HELP = 'prove a recorded run complete and unaltered, or say what is wrong (exit code 1)'
EXAMPLE = 'lathe-chatter verify runs/20260401-120000 --resimulate'


def configure(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument('run_path', type=Path, metavar='RUN', help='folder or file of a run')
    parser.add_argument(
        '--resimulate',
        action='store_true',
        help='also compute every sample again and compare it bit for bit',
    )
    parser.add_argument('--json', action='store_true', help='print the figures as JSON')


def run(options: Namespace) -> int:
    """Verify; 0 if nothing is missing, else 1."""
    found = verify(options.run_path)
    if options.resimulate:
        try:
            found.findings += [finding_of(again) for again in resimulate(found.run)]
        except RunReadError:
            if found.complete:  # else there are reasons enough
                raise
    console = Console(highlight=False, soft_wrap=True)
    if options.json:
        figures = {
            'complete': found.complete,
            'messages': dict(found.messages),
            'samples': {name: count._asdict() for name, count in found.samples.items()},
            'findings': [finding._asdict() for finding in found.findings],
        }
        console.print(json.dumps(figures), markup=False)
        return 0 if found.complete else 1
    for name, count in sorted(found.messages.items()):
        console.print(f'{count:9d}  {name}', markup=False)
    for name, samples in sorted(found.samples.items()):
        text = f'{name}: {samples.samples} samples, {samples.first:g} s to {samples.last:g} s'
        console.print(text, markup=False)
    for finding in found.findings:
        console.print(('WRONG  ' if finding.loss else 'note   ') + finding.text, markup=False)
    console.print('complete' if found.complete else 'NOT complete')
    return 0 if found.complete else 1
