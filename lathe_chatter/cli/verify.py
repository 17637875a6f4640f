"""`lathe-chatter verify`: whether a recorded run is complete."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from pathlib import Path

from lathe_chatter.cli.common_options import add_json, add_run
from lathe_chatter.cli.console import Screen
from lathe_chatter.errors import LatheChatterError
from lathe_chatter.recording import (
    Finding,
    Verification,
    read_run,
    resimulate,
    verify,
)
from lathe_chatter.recording.resimulate import finding_of

_NOT_PROVEN = 3
"""Exit code where nothing is wrong, and the run is still being recorded, or its samples can be
neither confirmed nor denied."""
EXAMPLE = 'lathe-chatter verify runs/20260401-120000 --resimulate'


def configure(parser: ArgumentParser) -> None:
    """Declare the options."""
    add_run(parser)
    parser.add_argument(
        '--resimulate',
        action='store_true',
        help='also compute every sample again and compare it bit for bit',
    )
    add_json(parser)


def run(options: Namespace) -> int:
    """Verify; 0 if nothing is wrong, 1 if something is, 3 if that cannot be told."""
    screen = Screen(json=options.json)
    found = _verified(options.run_path, screen, again=options.resimulate)
    for name, count in sorted(found.messages.items()):
        screen.say(f'{count:9d}  {name}')
    for name, samples in sorted(found.samples.items()):
        screen.say(f'{name}: {samples.samples} samples, {samples.first:g} s to {samples.last:g} s')
    for finding in found.findings:
        screen.say(_rank(finding) + finding.text)
    unproven = any(finding.unproven for finding in found.findings)
    nothing = '' if found.samples else ', and without samples of a lathe'
    unfinished = 'NOT complete' if found.lossy else 'not complete yet: nothing is missing so far'
    screen.say(f'{"complete" if found.complete else unfinished}{nothing}')
    if unproven and found.finished:
        screen.say('NOT PROVEN: what cannot be computed again is neither confirmed nor denied')
    screen.json(
        {
            'complete': found.complete,
            'messages': found.messages,
            'samples': found.samples,
            'findings': found.findings,
        }
    )
    return 1 if found.lossy else _NOT_PROVEN if unproven else 0


def _rank(finding: Finding) -> str:
    """How a finding is to be taken."""
    if finding.loss:
        return 'WRONG  '
    return 'UNSURE ' if finding.unproven else 'note   '


def _verified(path: Path, screen: Screen, *, again: bool) -> Verification:
    """What is found in a run, and what comes of computing it again if that is wanted."""
    # Nearly all of what a lathe's run has are its samples, which are looked at twice.
    total = 2 * read_run(path, damaged=True).count_of_messages()
    with screen.progress('messages', total or None) as bar:
        found = verify(path, bar.advance)
        if again:
            bar.show(what='computing again')
            try:
                found.findings += [finding_of(each) for each in resimulate(found.run)]
            except LatheChatterError:
                if found.complete:  # else there are reasons enough
                    raise
    return found
