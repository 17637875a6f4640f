"""The errors that lathe_chatter raises for a user's mistake: each is one readable sentence."""

from __future__ import annotations

import re
from collections.abc import Iterable
from difflib import get_close_matches
from importlib import import_module
from numbers import Number
from pathlib import Path
from typing import Any


class LatheChatterError(Exception):
    """Base of every error that the package raises on purpose; its text is for people."""

    def __reduce__(self) -> tuple[Any, ...]:
        """As another process gets it: whatever it was made from, with its text and its facts."""
        return _remade, (type(self), self.args, self.__dict__)


def _remade(
    kind: type[LatheChatterError], args: tuple[Any, ...], facts: dict[str, Any]
) -> LatheChatterError:
    error = kind.__new__(kind, *args)
    error.args = args
    error.__dict__.update(facts)
    return error


def shortened(text: str, most: int = 300) -> str:
    """A text as a sentence repeats it: of one that is very long the middle is left out."""
    return text if len(text) <= most else f'{text[: most // 2]} ... {text[-most // 4 :]}'


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
        shown = shortened(repr(value) if isinstance(value, str) else str(value))
        if unit and isinstance(value, Number) and not isinstance(value, bool):
            shown = f'{shown} {unit}'
        elif unit and unit not in allowed:  # what is no number has no unit
            allowed = f'{allowed}, in {unit}'
        super().__init__(f'{name} is {shown}: it must be {allowed}.')


class UnprovenError(LatheChatterError, ArithmeticError):
    """A root or multiplier that could not be found for certain, and what to change."""

    def __init__(self, what: str) -> None:
        """Say what was looked for."""
        super().__init__(
            f'{what} could not be found for certain: two modes may all but coincide, so change '
            'the frequency of one by 0.01 %, or the depths or speeds.'
        )


class LayoutError(LatheChatterError, ValueError):
    """A block of samples whose layout is not that of the contract."""


class StateError(LatheChatterError, ValueError):
    """A saved state that cannot be continued from; the text says which and why."""


class ScenarioError(LatheChatterError):
    """A scenario file that cannot be played; the text says what is wrong where."""


class MachineFileError(LatheChatterError, ValueError):
    """A machine file that cannot be used: with its line, and what is allowed there."""


class PlanError(LatheChatterError, ValueError):
    """A plan of a data set that cannot be carried out, and why."""


class DatasetError(LatheChatterError):
    """A folder that is no data set, or not the one wanted."""


class ResultFileError(LatheChatterError):
    """A file of results, as of a map of knocks, that is none, or not the one wanted."""


class RunReadError(LatheChatterError):
    """A path that holds no run that can be read; the text says why."""


class NothingSavedError(RunReadError):
    """Nothing of a damaged run could be saved.

    Attributes:
        damage: What could not be read, as sentences.
    """

    def __init__(self, path: Path, damage: list[str]) -> None:
        """Name the run."""
        self.damage = damage
        super().__init__(f'nothing of {path} could be saved')


class MixedSamplesError(RunReadError):
    """The samples of several lathes are mixed in one topic, and are no cut of one lathe."""

    def __init__(self, topic: str, since: float) -> None:
        """Name the topic, and the simulated time from which on it is so, s."""
        super().__init__(
            f'From {since:.6f} s on the samples of several publishers are mixed in {topic}, and '
            'nobody can tell which is whose.'
        )


class RunExistsError(LatheChatterError):
    """The folder of a new run exists already: nothing recorded is ever overwritten."""

    def __init__(self, folder: Path) -> None:
        """Name the folder."""
        self.folder = folder
        super().__init__(f'{folder} exists already, and no recorded run is overwritten.')


class DiskFullError(LatheChatterError):
    """The disk has too little room left to go on."""

    def __init__(self, folder: Path, free: int, wanted: int) -> None:
        """Name the folder, what is free on its disk and what must be, in bytes."""
        self.folder = folder
        super().__init__(
            f'The disk of {folder} has {free / 1e6:.1f} MB left and {wanted / 1e6:.1f} MB must '
            'stay free: the recording ends, complete up to here.'
        )


class ReplayError(LatheChatterError):
    """Something without which the samples cannot be computed; the text says what."""


class ExportExistsError(LatheChatterError):
    """A file that is there already: nothing is overwritten."""

    def __init__(self, path: Path) -> None:
        """Name the file."""
        super().__init__(f'{path} exists already, and no file is overwritten.')


class MissingPackageError(LatheChatterError):
    """A library that is not installed; the text says how to have it."""

    def __init__(self, name: str, use: str) -> None:
        """Name the library and what for."""
        package = {'sdypy.EMA': 'sdypy-EMA'}.get(name, name.partition('.')[0])
        super().__init__(
            f'{use} needs {package}, which is not installed: `pip install {package}`.'
        )


def optional(name: str, use: str) -> Any:
    """A library that not everybody has.

    Raises:
        MissingPackageError: If it is not installed.
    """
    try:
        return import_module(name)
    except ImportError:
        raise MissingPackageError(name, use) from None


class WorkerError(LatheChatterError):
    """Workers that are lost, or that have another version; the text says which."""


class FrequencyResponseError(LatheChatterError, ValueError):
    """A file that holds no frequency response that can be used, and why."""


class SignalFileError(LatheChatterError, ValueError):
    """A recording of sensors that cannot be listened to, and why."""


class ModalFitError(LatheChatterError, ValueError):
    """Frequency responses to which no modes can be fitted, and why."""


class RunFailedError(LatheChatterError):
    """The run could not be made; the text says why."""


class NodeFailedError(LatheChatterError):
    """A node of the cell ended by itself; the text holds what it said last."""


class ScenarioFailedError(LatheChatterError):
    """The lathe refused a step of the scenario; the text says which and why."""


class StartError(LatheChatterError):
    """A command line that a node does not understand."""


class UnknownParameterError(LatheChatterError):
    """A misspelt name given at the start: the default would be taken, and nobody notice."""


class RecordingFailedError(LatheChatterError):
    """The disk took no more: the run ends with what it has, and so does the node."""


class OutputError(LatheChatterError):
    """A file or folder that cannot be written, or that would be lost by writing it."""


def reason_of(error: Exception) -> str:
    """Why the system refused, in its words: without the number and the file, which is known."""
    return getattr(error, 'strerror', None) or str(error)


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
