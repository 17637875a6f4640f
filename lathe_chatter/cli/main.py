"""`lathe-chatter`: one verb a module of `lathe_chatter.cli.verbs`."""

from __future__ import annotations

import argparse
import io
import os
import signal
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from difflib import get_close_matches
from types import FrameType
from typing import NoReturn

from lathe_chatter import __version__
from lathe_chatter.errors import LatheChatterError

USER_ERROR = 2
INTERRUPTED = 130
_BROKEN_PIPE = 128 + 13


class Parser(argparse.ArgumentParser):
    """A parser whose complaint is one line, and one that says where the options are told."""

    def error(self, message: str) -> NoReturn:
        """Complain and end."""
        self.exit(USER_ERROR, f'{self.prog}: {message}\nSee {self.prog} --help.\n')


def parser() -> Parser:
    """The command line with every verb."""
    from lathe_chatter.cli.verbs import VERBS

    result = Parser(
        prog='lathe-chatter',
        description='A virtual lathe with bearing clearance: run it, record it, look into it.',
    )
    result.add_argument('--version', action='version', version=f'lathe-chatter {__version__}')
    verbs = result.add_subparsers(dest='verb', metavar='VERB', required=True)
    for verb in VERBS:
        entry = verbs.add_parser(
            verb.NAME,
            help=verb.HELP,
            description=verb.HELP,
            epilog=f'example: {verb.EXAMPLE}',
        )
        verb.configure(entry)
        entry.set_defaults(run=verb.run, usage_of=entry)
    return result


def main(arguments: Sequence[str] | None = None) -> int:
    """Carry out a command line.

    Returns:
        The exit code: 0, what the verb says (1 for a verdict that is no), 2 for a user's
        mistake, 128 and the number of the signal when interrupted: 130 after Ctrl-C.
    """
    with _ended_at_once():
        whole = parser()
    received: list[int] = []
    with _interrupted_by_signals(received):
        for stream in (sys.stdout, sys.stderr):
            if isinstance(stream, io.TextIOWrapper):
                stream.reconfigure(errors='replace')  # where the terminal lacks a letter
        options, unknown = whole.parse_known_args(arguments)
        if unknown:  # argparse itself would show how to give a verb, not its options
            options.usage_of.error(_unknown(options.usage_of, unknown))
        try:
            code: int = options.run(options)
            sys.stdout.flush()
        except LatheChatterError as error:
            sys.stderr.write(f'lathe-chatter {options.verb}: {error}\n')
            return USER_ERROR
        except BrokenPipeError:  # whoever read has enough, as `head` has
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            return _BROKEN_PIPE
        except OSError as error:
            where = f'{error.filename}: ' if error.filename else ''
            sys.stderr.write(f'lathe-chatter {options.verb}: {where}{error.strerror or error}.\n')
            return USER_ERROR
        except KeyboardInterrupt:
            code = INTERRUPTED
    return 128 + received[0] if code == INTERRUPTED and received else code


def _unknown(verb: argparse.ArgumentParser, words: Sequence[str]) -> str:
    """What is wrong with words that a verb does not know."""
    known = [option for action in verb._actions for option in action.option_strings]  # noqa: SLF001 -- argparse tells them nowhere else
    near = get_close_matches(words[0].partition('=')[0], known, n=1)
    hint = f', perhaps {near[0]}' if near else ''
    return f'unrecognized arguments: {" ".join(words)}{hint}'


@contextmanager
def _ended_at_once() -> Iterator[None]:
    """End without a word on Ctrl-C while libraries are imported: nothing has begun."""
    before = signal.signal(signal.SIGINT, lambda number, _frame: os._exit(128 + number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def _interrupted_by_signals(received: list[int]) -> Iterator[None]:
    """End on SIGTERM and SIGHUP as on Ctrl-C: what was begun is finished."""

    def interrupt(number: int, _frame: FrameType | None) -> None:
        received.append(number)
        raise KeyboardInterrupt

    before = {each: signal.signal(each, interrupt) for each in (signal.SIGTERM, signal.SIGHUP)}
    try:
        yield
    finally:
        for each, handler in before.items():
            signal.signal(each, handler)


if __name__ == '__main__':
    sys.exit(main())
