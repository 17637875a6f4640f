"""`lathe-chatter verify`: whether a recorded run is complete."""

from __future__ import annotations

import json
from argparse import ArgumentParser, Namespace
from pathlib import Path

from rich.console import Console
from rich.progress import Progress

from lathe_chatter.recording import RunReadError, Verification, read_run, resimulate, verify
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
    found = _verified(options.run_path, again=options.resimulate)
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


def _verified(path: Path, *, again: bool) -> Verification:
    """What is found in a run, and what comes of computing it again if that is wanted."""
    # Nearly all of what a lathe's run has are its samples, which are looked at twice.
    total = 2 * read_run(path, damaged=True).count_of_messages()
    with Progress(console=Console(stderr=True), transient=True) as progress:
        bar = progress.add_task('messages', total=total or None)
        found = verify(path, lambda count: progress.advance(bar, count))
        if again:
            progress.update(bar, description='computing again', total=None)
            try:
                found.findings += [finding_of(each) for each in resimulate(found.run)]
            except RunReadError:
                if found.complete:  # else there are reasons enough
                    raise
    return found
