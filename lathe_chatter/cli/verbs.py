"""The verbs of the command line, one module each, and the parser of them all.

A verb is a module of its name with EXAMPLE, configure(parser) and run(options) -> exit code. Only
the one that is called is imported: some need libraries that take seconds to load.
"""

from __future__ import annotations

import os
import sys
from argparse import Action, ArgumentError, ArgumentParser
from collections.abc import Sequence
from importlib import import_module
from typing import Any, NoReturn

from lathe_chatter import __version__
from lathe_chatter.errors import nearest_name

_USER_ERROR = 2

VERBS = {
    'run': 'start lathe, monitor and recorder, play a scenario, and leave the recorded run',
    'simulate': 'simulate a cut without ROS, as fast as possible, and record it',
    'report': 'print what happened in a recorded run and draw it',
    'page': 'show a recorded run in the browser: scrub, zoom to a sample, the path over the chart',
    'reproduce': "reproduce the paper's 14 runs: verdicts, exact roots, growth rates, figures",
    'lobes': 'draw the stability chart: the limits, where the clearance closes, what is safe',
    'knock-map': 'map the knock that turns a stable cut into lasting chatter',
    'identify': 'make a machine file from tap tests: the modes, and how sure they are',
    'listen': 'have the monitor judge a recording: WAV, CSV, MAT, Parquet, or a recorded run',
    'dataset': 'make labelled windows of simulated cuts on machines drawn by a plan',
    'verify': 'prove a run complete and unaltered, or say what is wrong (exit 1; 3: unproven)',
    'recover': 'save every whole part of a damaged run into a new one; the old one is only read',
    'export': 'write the samples of a run as CSV, Parquet, MAT, HDF5, or a message per sample',
    'bench': 'print the performance figures of this package on this machine',
}
"""What each does, in the order in which they are shown."""

BEGINNING = """\
A virtual lathe with bearing clearance. To begin with:

  lathe-chatter run
      the main job: cuts in real time, watches for chatter and records (needs ROS 2)
  lathe-chatter simulate --scenario clearance --output runs/first --report
      the same without ROS, as fast as possible
  lathe-chatter lobes
      the stability chart of the machine

Every verb: lathe-chatter --help. One of them: lathe-chatter VERB --help.
"""


class Parser(ArgumentParser):
    """A parser whose complaint is one line, and one that says where the options are told."""

    def _print_message(self, message: str, file: Any = None) -> None:
        """Print; argparse would pass over what the system refuses."""
        file = file or sys.stderr
        file.write(message)
        file.flush()

    def error(self, message: str) -> NoReturn:
        """Complain and end."""
        self.exit(_USER_ERROR, f'{self.prog}: {message}\nSee {self.prog} --help.\n')

    def _check_value(self, action: Action, value: Any) -> None:
        """Refuse a word that is none of the choices, and name the nearest."""
        choices = list(action.choices or ())
        if choices and value not in choices:
            near = nearest_name(str(value), [str(choice) for choice in choices])
            hint = f', perhaps {near}' if near else ''
            allowed = ', '.join(str(choice) for choice in choices)
            raise ArgumentError(action, f'{value!r} is none of {allowed}{hint}')

    def unknown(self, words: Sequence[str]) -> NoReturn:
        """Complain of words that are none of its options, and end."""
        option, _, _ = words[0].partition('=')
        why = (self.get_default('left_out') or {}).get(option.replace('--no-', '--'))
        if why:
            self.error(f'{option} is no option of this verb: {why}.')
        known = [option for action in self._actions for option in action.option_strings]
        near = nearest_name(option, known)
        hint = f', perhaps {near}' if near else ''
        self.error(f'unrecognized arguments: {" ".join(words)}{hint}')


def parser(words: Sequence[str] | None = None) -> Parser:
    """The command line, with the options of its first verb; without words those of every verb."""
    called = VERBS if words is None else [word for word in words if word in VERBS][:1]
    result = Parser(
        prog='lathe-chatter',
        description='A virtual lathe with bearing clearance: run it, record it, look into it.',
    )
    result.add_argument('--version', action='version', version=f'lathe-chatter {__version__}')
    result.set_defaults(usage_of=result)
    verbs = result.add_subparsers(dest='verb', metavar='VERB')
    for name, meaning in VERBS.items():
        entry = verbs.add_parser(name, help=meaning, description=meaning)
        if name in called:
            verb = import_module(f'{__package__}.{name.replace("-", "_")}')
            verb.configure(entry)
            entry.epilog = f'example: {verb.EXAMPLE}'
            entry.set_defaults(run=verb.run, usage_of=entry)
    if '_ARGCOMPLETE' in os.environ:  # a shell asks what may come next
        import argcomplete

        argcomplete.autocomplete(result)
    return result
