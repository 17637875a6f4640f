"""The verbs of the command line, one module each, and the parser of them all.

A verb has NAME, HELP, EXAMPLE, configure(parser) and run(options) -> exit code.
"""

from __future__ import annotations

import os
from argparse import Action, ArgumentError, ArgumentParser, Namespace
from collections.abc import Sequence
from typing import Any, NoReturn, Protocol

from lathe_chatter import __version__
from lathe_chatter.cli import (
    bench,
    dataset,
    export,
    identify,
    knock_map,
    listen,
    lobes,
    page,
    recover,
    report,
    reproduce,
    run,
    simulate,
    verify,
)
from lathe_chatter.errors import nearest_name

_USER_ERROR = 2


class Verb(Protocol):
    """What a module of this package offers."""

    NAME: str
    HELP: str
    EXAMPLE: str

    def configure(self, parser: ArgumentParser) -> None:
        """Declare arguments and options."""

    def run(self, options: Namespace) -> int:
        """Do it and return the exit code."""


VERBS: tuple[Verb, ...] = (
    run,
    simulate,
    report,
    page,
    reproduce,
    lobes,
    knock_map,
    identify,
    listen,
    dataset,
    verify,
    recover,
    export,
    bench,
)


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
        known = [option for action in self._actions for option in action.option_strings]
        near = nearest_name(words[0].partition('=')[0], known)
        hint = f', perhaps {near}' if near else ''
        self.error(f'unrecognized arguments: {" ".join(words)}{hint}')


def parser() -> Parser:
    """The command line with every verb."""
    result = Parser(
        prog='lathe-chatter',
        description='A virtual lathe with bearing clearance: run it, record it, look into it.',
    )
    result.add_argument('--version', action='version', version=f'lathe-chatter {__version__}')
    result.set_defaults(usage_of=result)
    verbs = result.add_subparsers(dest='verb', metavar='VERB')
    for verb in VERBS:
        entry = verbs.add_parser(
            verb.NAME,
            help=verb.HELP,
            description=verb.HELP,
            epilog=f'example: {verb.EXAMPLE}',
        )
        verb.configure(entry)
        entry.set_defaults(run=verb.run, usage_of=entry)
    if '_ARGCOMPLETE' in os.environ:  # a shell asks what may come next
        import argcomplete

        argcomplete.autocomplete(result)
    return result
