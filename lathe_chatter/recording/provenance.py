"""What a run knows about its making: versions and machine."""

from __future__ import annotations

import hashlib
import json
import math
import os
import platform
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import datetime, timezone
from importlib.metadata import version
from pathlib import Path
from typing import Any

from lathe_chatter import __version__

OURS = 'lathe_chatter/'
"""With which the names of our records begin; in a file where one has its check, all have."""

IDENTITY = 'lathe_chatter/made_by'
"""Name of the MCAP metadata record in each file of a run."""
PARAMETERS = 'lathe_chatter/parameters'
"""Name of the records of a node's parameters, followed by its full name; values as JSON.

Of a node that was started again also those of its next starts, `parameters_2` and so on.
"""

RECEPTION = 'lathe_chatter/reception'
"""Name of the record of what came and what was lost on the way, by topic, as JSON."""

PUBLISHERS = 'lathe_chatter/publishers'
"""Name of the record of how many publishers a topic had, one after another too, as JSON; of one
that had several, for where it is not told a topic had one."""

STALLS, LONGEST_STALL = 'stalls', 'longest_stall'
"""Among these, how often the recorder took too long to take what had come; and at most, s."""

PAUSES = 'lathe_chatter/pauses'
"""Name of the record of what the recorder left out in pauses, as JSON: by topic of samples the
simulated times before and after each, and in `clock` when each began and ended, ns."""

ENDED_EARLY = 'lathe_chatter/ended_early'
"""Name of the record of a run whose writer was stopped before it had all: `reason`, a sentence."""

CHECK = 'check'
"""Name of the value in each record that tells whether the others are as they were written: no CRC
of MCAP covers a metadata record by itself, and none at all while a run is not finished."""

RECOVERED = 'lathe_chatter/recovered'
"""Name of the record of a run that was recovered: from which, and what could not be read."""

_CORE = (
    'array_types.py',
    'compiled.py',
    'lathe/doubts.py',
    'lathe/integrator/*.py',
    'lathe/state.py',
    'lathe/virtual_lathe.py',
    'model/cut.py',
    'model/machine_and_sampling.py',
    'model/machine.py',
    'model/quantity_fields.py',
)
"""What the bits of a sample depend on; a test holds that the lathe imports nothing else."""


def core_identity() -> dict[str, str]:
    """What the bits of a simulated sample depend on: the code of the lathe, and below it."""
    digest = hashlib.sha256()
    package = Path(__file__).resolve().parent.parent
    for pattern in _CORE:
        for file in sorted(package.glob(pattern)):
            digest.update(file.read_bytes())
    return {
        'lathe_chatter': __version__,
        'core': digest.hexdigest()[:16],
        **{name: version(name) for name in ('numpy', 'scipy', 'numba', 'llvmlite')},
        'machine': platform.machine(),
    }


def identity() -> dict[str, str]:
    """Who records, on what, since when."""
    return {
        **core_identity(),
        'mcap': version('mcap'),
        'python': platform.python_version(),
        'system': f'{platform.system()} {platform.release()}',
        'processors': str(os.cpu_count()),
        'host': platform.node(),
        'command': ' '.join(sys.argv),
        'started': datetime.now(timezone.utc).isoformat(timespec='milliseconds'),
    }


def sealed(name: str, values: Mapping[str, str]) -> dict[str, str]:
    """The values of a record with their check, which `checked` compares."""
    return {CHECK: _digest(name, values), **{k: v for k, v in values.items() if k != CHECK}}


def checked(name: str, values: Mapping[str, str]) -> bool | None:
    """Whether a record is as it was written; None where it has no check, as of other writers."""
    return values[CHECK] == _digest(name, values) if CHECK in values else None


def _digest(name: str, values: Mapping[str, str]) -> str:
    """Of a record: its name, and every value by its name."""
    content = [name, sorted((key, text) for key, text in values.items() if key != CHECK)]
    return hashlib.sha256(json.dumps(content).encode()).hexdigest()[:16]


def noted_number(text: str, name: str = '') -> int:
    """A number of a record, by its name where the value is a JSON object; 0 where it is none."""
    try:
        found = json.loads(text)
        return int(found[name] if name else found)
    except (ValueError, TypeError, KeyError):
        return 0


def noted_pauses(notes: Iterable[Any], name: str) -> list[tuple[float, float]]:
    """What the recorder left out in pauses, from and to; see `PAUSES`.

    Args:
        notes: Of a run, each with name and values.
        name: A topic of samples, or `clock`.
    """
    found: list[tuple[float, float]] = []
    for note in notes:
        if note.name == PAUSES and name in note.values:
            try:
                found = [(begin, end or math.inf) for begin, end in json.loads(note.values[name])]
            except (ValueError, TypeError):
                found = []
    return found


def ended_by(error: BaseException | None) -> str:
    """What `ENDED_EARLY` says of a writer that an error ends, a sentence; empty of any other end.

    Args:
        error: On its way while the writer is closed; None where none is.
    """
    if error is None or isinstance(error, SystemExit):
        return ''
    if isinstance(error, KeyboardInterrupt):
        return 'It was interrupted.'
    return f'It failed: {str(error) or type(error).__name__}'


def parameter_values(answers: Sequence[tuple[Mapping[str, Any], int]]) -> dict[str, str]:
    """The values of a record of parameters.

    Args:
        answers: The parameters of a node, and of the nodes of its name that came after it, each
            with the time at which it answered, ns since the epoch.
    """
    values: dict[str, str] = {}
    for k, (parameters, log_time) in enumerate(answers):
        suffix = f'_{k + 1}' if k else ''
        values[f'parameters{suffix}'] = json.dumps(dict(parameters))
        values[f'log_time{suffix}'] = str(log_time)
    return values


def parameter_history(values: Mapping[str, str]) -> Iterator[tuple[dict[str, Any], int]]:
    """What `parameter_values` was given, as far as it is legible."""
    for name, text in values.items():
        if not name.startswith('parameters'):
            continue
        try:
            parameters = json.loads(text)
            log_time = int(values.get(name.replace('parameters', 'log_time'), '0'))
        except ValueError:
            continue
        if isinstance(parameters, dict):
            yield parameters, log_time
