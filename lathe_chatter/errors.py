"""The errors that lathe_chatter raises for a user's mistake: each is one readable sentence."""

from __future__ import annotations

import re
from collections.abc import Iterable
from difflib import get_close_matches


class LatheChatterError(Exception):
    """Base of every error that the package raises on purpose; its text is for people."""


class ParameterError(LatheChatterError, ValueError):
    """A value that the machine or the cut cannot have.

    Attributes:
        name: The field, as the user wrote it.
        value: What was given.
        unit: The unit of the field, empty where it has none.
        allowed: What would have been accepted, as the end of a sentence.
    """

    def __init__(self, name: str, value: object, unit: str, allowed: str) -> None:
        """Build the sentence from its parts."""
        self.name = name
        self.value = value
        self.unit = unit
        self.allowed = allowed
        shown = repr(value) if isinstance(value, str) else str(value)
        super().__init__(f'{name} is {shown}{unit and " " + unit}: it must be {allowed}.')


class LayoutError(LatheChatterError, ValueError):
    """A block of samples whose layout is not that of the contract."""


class StateError(LatheChatterError, ValueError):
    """A saved state that cannot be continued from; the text says which and why."""


class ScenarioError(LatheChatterError):
    """A scenario file that cannot be played; the text says what is wrong where."""


class MachineFileError(LatheChatterError, ValueError):
    """A machine file that cannot be used: with its line, and what is allowed there."""


class KnockMapError(LatheChatterError):
    """A file that is no map of knocks, or not the one wanted."""


def reason_of(error: OSError) -> str:
    """Why the system refused, in its words: without the number and the file, which is known."""
    return error.strerror or str(error)


def nearest_name(name: str, known: Iterable[str]) -> str | None:
    """The known name that may have been meant by one that is not.

    It is like the whole of it, or like one of its words, as `depht` for depth_of_cut.
    """
    names = list(known)
    near = get_close_matches(name, names, n=1)
    if near:
        return near[0]
    words = {word: full for full in reversed(names) for word in re.split(r'[_.]', full)}
    like = get_close_matches(name, words, n=1, cutoff=0.75)
    return words[like[0]] if like else None
