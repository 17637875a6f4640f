"""What happens to the cut: into the log, and into a run of its own where `record` asks for it."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lathe_chatter.array_types import Array
from lathe_chatter.errors import LatheChatterError, reason_of
from lathe_chatter.lathe.change_and_knock_sentences import (
    BEGINNING,
    BEGINNING_AGAIN,
    change_sentence,
    knock_sentence,
)
from lathe_chatter.lathe.config import recorded_config
from lathe_chatter.lathe.doubts import doubts
from lathe_chatter.model import Cut
from lathe_chatter.nodes.diagnostics import ERROR, OK, Status
from lathe_chatter.nodes.log_rate_limit import QuickLog
from lathe_chatter.nodes.parameter_node import ParameterNode
from lathe_chatter.recording import LatheRun
from lathe_chatter.recording.provenance import ended_by

_COMMIT_PERIOD = 0.25
"""s between two commits: what a kill can lose."""


class LatheRecord:
    """Logs what happens to the cut; with `record` it also writes the samples, in this process.

    A disk that takes no more ends the record, not the lathe.

    Args:
        node: The lathe.

    Raises:
        RunExistsError: If the folder of the run exists.
        LatheChatterError: If it cannot be made.
    """

    def __init__(self, node: ParameterNode) -> None:
        """Begin, at time zero."""
        values: Mapping[str, Any] = node.values
        # What tells of the pace moves no sample: its log is bounded.
        self._logger, self._bounded_log = QuickLog(node.get_logger()), node.bounded_log
        self._run: LatheRun | None = None
        self._folder, self._failure = values['record'], ''
        if self._folder:
            name = node.get_fully_qualified_name()
            try:
                self._run = LatheRun(Path(self._folder), values, name=name)
            except OSError as error:
                said = f'record: the run {self._folder} cannot be made: {reason_of(error)}.'
                raise LatheChatterError(said) from None
            node.every(_COMMIT_PERIOD, self._commit)
        self._log(BEGINNING)
        config = recorded_config(values)
        self._setup, self._doubts = config.setup, list[str]()
        self._described, self._speed_doubt = config.described, ''
        file = config.described
        if file and (lacking := file.assumption(config.machine, config.cut)):
            self._logger.warning(lacking)
        self._doubt(config.cut)

    def write(self, samples: Array) -> None:
        """Write the samples of a tick (n, 8)."""
        if self._run is not None:
            try:
                self._run.write(samples)
            except (OSError, LatheChatterError) as error:
                self._fail(error)

    def changed(self, time: float, old: Cut, new: Cut) -> None:
        """The cut was changed at a simulated time, s."""
        self._log(change_sentence(time, old, new))
        self._doubt(new)

    def knocked(self, time: float, impulse: float) -> None:
        """The tool was hit with an impulse, N s."""
        self._log(knock_sentence(time, impulse))

    def paced(self, time: float, factor: float) -> None:
        """Simulated time goes at another pace from a simulated time on, s."""
        pace = f'{factor:g} times as fast as the clock' if factor else 'as fast as it can'
        said = f'At {time:.6f} s: from here on simulated time is to go {pace}.'
        self._bounded_log.info(said, 'pace')

    def restarted(self, time: float, old: Cut, new: Cut) -> None:
        """The lathe begins again, with a cut that may have been asked for since its last tick."""
        self._log(change_sentence(time, old, new))
        self._log(BEGINNING_AGAIN)

    def statuses(self) -> list[Status]:
        """What diagnostics show of the record, if there is one."""
        if not self._folder:
            return []
        if self._failure:
            return [Status('own record', ERROR, self._failure)]
        return [Status('own record', OK, 'recording', {'run': self._folder})]

    def close(self) -> None:
        """Finish the run, which says so where an error ends the node."""
        if self._run is not None:
            try:
                self._run.close(ended_by(sys.exc_info()[1]))
            except OSError as error:
                self._fail(error)
            self._run = None

    def _doubt(self, cut: Cut) -> None:
        """Say why the samples may not be what was meant; each sentence once.

        That the spindle turns too fast or too slowly is said each time that it begins to.
        """
        before, self._speed_doubt = self._speed_doubt, ''
        if self._described is not None:
            self._speed_doubt = self._described.speed_doubt(cut)
        if self._speed_doubt and not before:
            self._logger.warning(self._speed_doubt)
        for sentence in doubts(self._setup, cut):
            if sentence not in self._doubts:
                self._doubts.append(sentence)
                self._logger.warning(sentence)

    def _log(self, sentence: str) -> None:
        if sentence:
            self._logger.info(sentence)
            if self._run is not None:
                self._run.log(sentence)

    def _commit(self) -> None:
        if self._run is not None:
            try:
                self._run.commit()
            except (OSError, LatheChatterError) as error:
                self._fail(error)

    def _fail(self, error: Exception) -> None:
        said = isinstance(error, LatheChatterError)
        self._failure = str(error) if said else f'{self._folder}: {error}.'
        sentence = f'The lathe goes on without its record. {self._failure}'
        self._logger.error(sentence)
        if self._run is not None:
            self._run.abandon()
            self._run = None
