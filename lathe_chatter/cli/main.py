"""`lathe-chatter`: carries out a command line, and ends in order whatever interrupts it.

What takes time to import is imported in `main`, which from its first line on ends at Ctrl-C
without a traceback.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from types import FrameType
from typing import Any

from lathe_chatter.nodes.end_signals import END_SIGNALS, raise_lost_interrupts_again
from lathe_chatter.standard_streams import hold_standard_streams

USER_ERROR = 2
INTERRUPTED = 130
_BROKEN_PIPE = 128 + 13


def main(arguments: Sequence[str] | None = None) -> int:
    """Carry out a command line.

    Returns:
        The exit code: 0, what the verb says (1 for a verdict that is no), 2 for a user's
        mistake, 128 and the number of the signal when interrupted: 130 after Ctrl-C.
    """
    if 'stdout' in hold_standard_streams():
        _complain('lathe-chatter: standard output is closed: send it to a file or /dev/null.')
        return USER_ERROR
    if not _has_working_directory():
        _complain('The working directory is not there any more: change to one that is.')
        return USER_ERROR
    received: list[int] = []
    before = {each: signal.getsignal(each) for each in END_SIGNALS}
    unraisable = raise_lost_interrupts_again()
    # One that is ignored, as under nohup, stays so.
    heard = [each for each in END_SIGNALS if before[each] != signal.SIG_IGN]

    def interrupt(number: int, _frame: FrameType | None) -> None:
        """End in order: what was begun is finished."""
        received.append(number)
        raise KeyboardInterrupt

    def end(number: int, _frame: FrameType | None) -> None:
        """End at once while libraries are imported: nothing has begun."""
        os._exit(128 + number)

    try:
        _have_handled(heard, end)
        words = sys.argv[1:] if arguments is None else arguments
        code = _carried_out(words, lambda: _have_handled(heard, interrupt))
    except BaseException as error:
        # Amid an import an interrupt can come out as another error.
        if not received and not isinstance(error, KeyboardInterrupt):
            raise
        code = INTERRUPTED
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        sys.unraisablehook = unraisable
        for each in heard:
            signal.signal(each, before[each])
    return 128 + received[0] if code == INTERRUPTED and received else code


def _has_working_directory() -> bool:
    """Whether there is one: libraries want it as they are imported, and so do relative paths."""
    try:
        os.getcwd()  # noqa: PTH109 -- pathlib takes time to import
    except OSError:
        return False
    return True


def _have_handled(numbers: Sequence[int], handler: Callable[[int, Any], None]) -> None:
    for number in numbers:
        signal.signal(number, handler)


def _carried_out(words: Sequence[str], begin: Callable[[], None]) -> int:
    """Call the verb of a command line; the exit code. A user's mistake is a sentence.

    Args:
        words: The command line.
        begin: To call before the verb.
    """
    from lathe_chatter.cli.verbs import BEGINNING, parser
    from lathe_chatter.errors import LatheChatterError

    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, 'reconfigure'):
            stream.reconfigure(errors='replace')  # where the terminal lacks a letter
    code, who = 0, 'lathe-chatter'
    try:
        asked = os.environ.get('COMP_LINE', '') if '_ARGCOMPLETE' in os.environ else ''
        options, unknown = parser(asked.split() or words).parse_known_args(words)
        if unknown:  # argparse itself would show how to give a verb, not its options
            options.usage_of.unknown(unknown)
        if options.verb is None:
            sys.stdout.write(BEGINNING)
        else:
            who = f'lathe-chatter {options.verb}'
            begin()
            code = options.run(options)
        sys.stdout.flush()
    except BrokenPipeError:  # whoever read has enough, as `head` has
        _print_no_more()
        return _BROKEN_PIPE
    except KeyboardInterrupt:
        _complain(f'{who}: interrupted before it was done.')
        return INTERRUPTED
    except LatheChatterError as error:
        _complain(f'{who}: {error}')
        return USER_ERROR
    except OSError as error:
        where = f'{error.filename}: ' if error.filename else ''
        _complain(f'{who}: {where}{error.strerror or error}.')
        _print_no_more()
        return USER_ERROR
    return code


def _complain(sentence: str) -> None:
    with suppress(OSError):  # of what cannot be said, nothing can be said
        sys.stderr.write(f'{sentence}\n')


def _print_no_more() -> None:
    """Have what is still to be printed go nowhere: Python would try, and complain, as it ends."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


if __name__ == '__main__':
    sys.exit(main())
