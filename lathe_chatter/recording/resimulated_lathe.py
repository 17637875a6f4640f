"""A lathe that does again what a record says of it, beside the recorded samples."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from lathe_chatter.array_types import Array, Integers
from lathe_chatter.errors import ReplayError
from lathe_chatter.lathe.change_and_knock_sentences import BEGINNING, Change, Knock
from lathe_chatter.lathe.config import LatheConfig, recorded_config
from lathe_chatter.recording.cut_log import CutLog, CutSession
from lathe_chatter.recording.sample_blocks import SampleBlocks

_MAX_SAMPLES = 50_000
"""Samples that are computed at once where the record has none."""


class Difference(NamedTuple):
    """A sample that is not what the lathe computes.

    Attributes:
        time: Simulated time of the sample, s.
        column: The first that differs.
        recorded: What the run holds.
        computed: What follows from its parameters and changes.
    """

    time: float
    column: str
    recorded: float
    computed: float


class Replay:
    """A lathe that does again what was logged, sample by sample beside the record.

    Args:
        log: What the record says of the lathe.

    Attributes:
        compared: Samples that were equal.
        doubt: Why the next sample need not be what is computed; empty where nothing speaks so.
        session: The present one.
    """

    def __init__(self, log: CutLog) -> None:
        """Begin with no session."""
        self.compared = 0
        self.doubt = ''
        self.session: CutSession | None = None
        self._logged = log.logged
        self._waiting: list[Change | Knock] = []
        self._lathe = LatheConfig().lathe()

    def begin(self, session: CutSession) -> None:
        """Begin a session, at time zero.

        Raises:
            ReplayError: If the record says too little of it.
            ParameterError: If it says what no lathe can be.
        """
        if not session.parameters:
            raise ReplayError(
                'The lathe began again, and with what parameters is not in the record.'
                if self.session is not None
                else 'The run does not say with what parameters the lathe was started.'
            )
        self.session = session
        self._lathe = recorded_config(session.parameters).lathe()
        self._waiting = list(session.events)
        if not self._logged:
            self.doubt = (
                'The record has nothing of the log of the lathe: whether its cut was changed is '
                'not known.'
            )
        elif not session.beginning:
            self.doubt = (
                'The record does not begin with the cut: what was changed before it began is not '
                'known, so its samples cannot be computed.'
            )
        elif session.beginning == BEGINNING:
            self.doubt = ''  # whatever was missing before was of another process

    def compare(self, blocks: SampleBlocks) -> Difference | None:
        """Compare the blocks of some messages with what the lathe does; the first difference.

        Raises:
            ReplayError: If the lathe cannot follow them; the text says why.
        """
        if blocks.columns != self._lathe.columns:
            raise ReplayError('The samples have other columns than this lathe computes.')
        for samples in self._stretches(blocks):
            difference = self._compare_stretch(samples)
            if difference is not None:
                return difference
            self.compared += len(samples)
            self.doubt = self.doubt if not self._logged else ''
        return None

    def _stretches(self, blocks: SampleBlocks) -> Iterator[Array]:
        """Messages joined as far as their places follow each other; the lathe is at the first."""
        ends = np.cumsum(blocks.rows)
        begins = ends - blocks.rows
        places = _places(blocks, self._lathe.sample_rate)
        breaks = np.flatnonzero(places[1:] != places[:-1] + blocks.rows[:-1]) + 1
        for first, last in _spans(len(places), breaks):
            self._go_to(int(places[first]))
            yield blocks.samples[begins[first] : ends[last]]

    def _go_to(self, place: int) -> None:
        """Have the lathe where the next sample is number `place`, counted from 0."""
        if place < self._lathe.samples_taken:
            raise ReplayError(
                'Simulated time goes back, and the record does not say how the lathe began again.'
            )
        if self._lathe.samples_taken < place and self._lathe.samples_taken:
            self.doubt = (
                'Samples are missing before it, and what happened to the cut meanwhile may be '
                'missing too.'
            )
        while self._lathe.samples_taken < place:
            self._cut(min(place - self._lathe.samples_taken, _MAX_SAMPLES))
            if self._lathe.guard:
                raise ReplayError(f'The lathe ends before the samples do. {self._lathe.guard}')

    def _compare_stretch(self, samples: Array) -> Difference | None:
        done = 0
        while done < len(samples):
            computed = self._cut(min(len(samples) - done, _MAX_SAMPLES))
            recorded = np.ascontiguousarray(samples[done : done + len(computed)])
            wrong = np.argwhere(recorded.view(np.uint64) != computed.view(np.uint64))
            if len(wrong):
                row, column = (int(each) for each in wrong[0])
                if done + row and self._logged:
                    self.doubt = ''
                self.compared += done + row
                return Difference(
                    float(computed[row, 0]),
                    self._lathe.columns[column],
                    float(recorded[row, column]),
                    float(computed[row, column]),
                )
            done += len(computed)
            if self._lathe.guard and done < len(samples):
                raise ReplayError(f'The lathe ends before the samples do. {self._lathe.guard}')
        return None

    def _cut(self, samples: int) -> Array:
        """Cut on, at most up to the next change; what is due now happens before."""
        while self._waiting and self._when(self._waiting[0]) <= self._lathe.samples_taken:
            self._do(self._waiting.pop(0))
        if self._waiting:
            until = self._when(self._waiting[0]) - self._lathe.samples_taken
            samples = min(samples, until)
        return self._lathe.advance(samples)

    def _when(self, event: Change | Knock) -> int:
        """After how many samples it took effect: changes happen between two samples."""
        return round(event.time * self._lathe.sample_rate)

    def _do(self, event: Change | Knock) -> None:
        if isinstance(event, Knock):
            self._lathe.knock(event.impulse)
        else:
            self._lathe.retune(self._lathe.cut.with_changes(**event.new))


def _places(blocks: SampleBlocks, sample_rate: float) -> Integers:
    """The number of the first sample of each message, by the times of all of its samples.

    One altered time among them does not lead astray.
    """
    numbers = np.rint(blocks.samples[:, 0] * sample_rate)
    if len(np.unique(blocks.rows)) == 1:
        votes = numbers.reshape(len(blocks.rows), -1) - np.arange(1, blocks.rows[0] + 1)
        found = np.median(votes, axis=1)
    else:
        begins = np.cumsum(blocks.rows)[:-1]
        parts = np.split(numbers, begins)
        found = np.array([np.median(part - np.arange(1, len(part) + 1)) for part in parts])
    if not np.isfinite(found).all():
        raise ReplayError('The times of the samples are no numbers.')
    places: Integers = np.rint(found).astype(np.int64)
    return places


def _spans(count: int, breaks: Integers) -> Iterator[tuple[int, int]]:
    """First and last of each stretch between breaks."""
    edges = [0, *breaks.tolist(), count]
    for first, after in pairwise(edges):
        if after > first:
            yield first, after - 1
