"""`lathe-chatter`: one verb a module of `lathe_chatter.cli.verbs`."""

from __future__ import annotations

import argparse
import io
import signal
import sys
from collections.abc import Sequence
from types import FrameType

from lathe_chatter import __version__
from lathe_chatter.cli.verbs import VERBS
from lathe_chatter.errors import LatheChatterError

USER_ERROR = 2
INTERRUPTED = 130


def parser() -> argparse.ArgumentParser:
    """The command line with every verb."""
    result = argparse.ArgumentParser(
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
    told: list[int] = []

    def interrupt(number: int, _frame: FrameType | None) -> None:
        """End on SIGTERM and SIGHUP as on Ctrl-C: what was begun is finished."""
        told.append(number)
        raise KeyboardInterrupt

    for wish in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(wish, interrupt)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors='replace')  # where the terminal lacks a letter
    options, unknown = parser().parse_known_args(arguments)
    if unknown:  # argparse itself would show how to give a verb, not its options
        options.usage_of.error(f'unrecognized arguments: {" ".join(unknown)}')
    try:
        code: int = options.run(options)
    except LatheChatterError as error:
        sys.stderr.write(f'lathe-chatter {options.verb}: {error}\n')
        return USER_ERROR
    except OSError as error:
        where = f'{error.filename}: ' if error.filename else ''
        sys.stderr.write(f'lathe-chatter {options.verb}: {where}{error.strerror or error}.\n')
        return USER_ERROR
    except KeyboardInterrupt:
        code = INTERRUPTED
    return 128 + told[0] if code == INTERRUPTED and told else code


if __name__ == '__main__':
    sys.exit(main())
