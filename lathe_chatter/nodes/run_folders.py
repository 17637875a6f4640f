"""Where a recorder puts its runs, and how they are written."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from datetime import datetime
from pathlib import Path
from typing import Any, TypeVar

from lathe_chatter.errors import LatheChatterError, RunExistsError, reason_of
from lathe_chatter.recording.open_chunk import Compression

_Made = TypeVar('_Made')


class RunFolders:
    """Gives each run of a node a folder of its own.

    Args:
        values: The parameters of the recorder.
    """

    def __init__(self, values: Mapping[str, Any]) -> None:
        """Begin with the first run."""
        self._values = values
        self._runs = 0

    def new_run(self, make: Callable[..., _Made]) -> _Made:
        """Make something in a new folder.

        Args:
            make: Takes the folder, and the options of a `RunWriter`.

        Raises:
            RunExistsError: If the folder that was asked for exists.
            LatheChatterError: If it cannot be made.
        """
        values = self._values
        output = str(values['output'])
        now = f'{datetime.now().astimezone():%Y%m%d-%H%M%S}'
        folder = first = Path(output or Path('runs', now))
        if self._runs and output:  # the second of this node stands beside its first
            folder = first.with_name(f'{first.name}-{self._runs + 1}')
        options = {
            'min_free_space': values['min_free_space'],
            'split_duration': values['split_duration'],
            'split_size': values['split_size'] or math.inf,
            'compression': Compression(values['compression']),
        }
        number = 1
        while True:
            try:
                made = make(folder, **options)
            except RunExistsError:  # noqa: PERF203 -- seldom twice
                if output:
                    raise
                number += 1  # another recorder began in the same second
                folder = first.with_name(f'{first.name}-{number}')
            except OSError as error:
                said = f'The run {folder} cannot be made: {reason_of(error)}.'
                raise LatheChatterError(said) from None
            else:
                self._runs += 1
                return made
