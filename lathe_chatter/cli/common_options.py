"""Options that many verbs have, and what several of them say alike."""

from __future__ import annotations

from argparse import ArgumentParser, ArgumentTypeError
from collections.abc import Callable
from pathlib import Path

from lathe_chatter.errors import ParameterError
from lathe_chatter.model.values_with_units import number_in

PICTURES = ('.png', '.svg', '.pdf')
"""Endings of pictures; beside a PNG there is an SVG."""


def path_of(text: str) -> Path:
    """What names a file or a folder.

    Raises:
        ArgumentTypeError: If it cannot: an empty text would mean the folder where one is.
    """
    if not text or '\0' in text:
        raise ArgumentTypeError(f'{text!r} must name a file or a folder')
    return Path(text)


def add_run(parser: ArgumentParser) -> None:
    """Declare the recorded run that a verb reads."""
    parser.add_argument(
        'run_path', type=path_of, metavar='RUN', help='folder or file of a recorded run'
    )


def add_topic(parser: ArgumentParser) -> None:
    """Declare which lathe of a recorded run is meant."""
    parser.add_argument(
        '--topic', metavar='TOPIC', help='of the samples, where the run has several lathes'
    )


def add_json(parser: ArgumentParser) -> None:
    """Declare that figures may be had as JSON."""
    parser.add_argument(
        '--json', action='store_true',
        help='print the figures as JSON, and all else on standard error',
    )  # fmt: skip


def in_unit(unit: str) -> Callable[[str], object]:
    """What an option with a unit is taken for: the number that a text is, or else the text.

    Args:
        unit: SI, or rev/min; what is written without a unit is in it.
    """

    def parsed(text: str) -> object:
        number = number_in(text, unit)
        return text if number is None else number  # what it must be is said where it is used

    return parsed


def names_in(option: str, text: str) -> tuple[str, ...]:
    """Names with commas between them.

    Raises:
        ParameterError: If one of them is empty.
    """
    names = tuple(name.strip() for name in text.split(','))
    if not all(names):
        raise ParameterError(option, text, '', 'names with commas between them')
    return names


def add_force(parser: ArgumentParser) -> None:
    """Declare that files which exist may be overwritten."""
    parser.add_argument('--force', action='store_true', help='overwrite files that exist')


def picture_file(path: Path) -> Path:
    """The file of a picture, as the user names it.

    Raises:
        ParameterError: If it is none that is written.
    """
    if path.suffix not in PICTURES:
        allowed = f'a file that ends in {", ".join(PICTURES[:-1])} or {PICTURES[-1]}'
        raise ParameterError('--output', str(path), '', allowed)
    return path


def utf8(option: str, path: Path) -> Path:
    """A path that the files of a run can name, which are in UTF-8.

    Raises:
        ParameterError: If its name is in another encoding.
    """
    try:
        str(path).encode()
    except UnicodeEncodeError:
        raise ParameterError(option, str(path), '', 'a path in UTF-8') from None
    return path
