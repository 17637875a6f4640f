"""Losses on the way, told by the numbers that publishers give their messages.

A message says its number but not its publisher, and topics such as /diagnostics have several.
So numbers are followed as sequences that grow by one; where there are more sequences than there
ever were publishers, one ended and another went on in its place, and what lies between was lost.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from lathe_chatter.array_types import Array, Integers

_SETTLING = 1.0
"""s that a new publisher may be heard before the graph has it."""


@dataclass
class _Sequence:
    """Numbers that followed each other; times in s."""

    first: int
    last: int
    begun: float
    heard: float


class Loss(NamedTuple):
    """Messages that are missing.

    Attributes:
        messages: How many.
        since: When the last one before them came, s.
        until: When the first one after them came, s.
    """

    messages: int
    since: float
    until: float


class Numbering:
    """Follows the numbers of the messages of one topic.

    Attributes:
        before: Messages of the first publisher that were published before the first one came.
        losses: What is known to be missing since.
    """

    def __init__(self) -> None:
        """Begin before the first message."""
        self.before = 0
        self.losses: list[Loss] = []
        self._sequences: list[_Sequence] = []

    @property
    def lost(self) -> int:
        """How many messages are known to be missing since the first one."""
        return sum(loss.messages for loss in self.losses)

    def take(self, number: int, now: float) -> None:
        """A message came, at a steady time in s."""
        self._take_all(number, number, now, now)

    def take_many(self, numbers: Integers, times: Array) -> None:
        """Messages came in this order, (n,) and (n,) s: as quick as they follow each other."""
        breaks = np.flatnonzero(np.diff(numbers) != 1) + 1
        for first, after in pairwise((0, *breaks.tolist(), len(numbers))):
            lowest, highest = int(numbers[first]), int(numbers[after - 1])
            if any(lowest <= each.last < highest for each in self._sequences):
                for place in range(first, after):  # whose they are must be seen one by one
                    self.take(int(numbers[place]), float(times[place]))
                continue
            self._take_all(lowest, highest, float(times[first]), float(times[after - 1]))

    def _take_all(self, first: int, last: int, begun: float, heard: float) -> None:
        """Messages of one publisher that follow each other."""
        for sequence in self._sequences:
            if sequence.last == first - 1:
                sequence.last, sequence.heard = last, heard
                return
        if not self._sequences:
            self.before = first - 1
        self._sequences.append(_Sequence(first, last, begun, heard))

    def settle(self, publishers: int, now: float) -> None:
        """Conclude what has been lost, where the graph is known to have so many publishers.

        Args:
            publishers: How many the topic has had.
            now: Steady time, s; infinite at the end, when nothing more will settle.
        """
        late = [each for each in self._sequences if each.begun <= now - _SETTLING]
        # Who counts from lower numbers is another publisher sooner than one that goes on.
        for sequence in sorted(late[1:], key=lambda each: not self._goes_on(each)):
            if len(self._sequences) <= max(publishers, 1):
                return
            self._join(sequence)

    def _goes_on(self, sequence: _Sequence) -> bool:
        return any(
            each.heard <= sequence.begun and each.last < sequence.first for each in self._sequences
        )

    def _join(self, sequence: _Sequence) -> None:
        """Join a sequence to the one that it goes on, if one had ended when it began."""
        ended = [each for each in self._sequences if each.heard <= sequence.begun]
        ended = [each for each in ended if each is not sequence]
        before = [each for each in ended if each.last < sequence.first]
        if before:
            origin = max(before, key=lambda each: each.last)
            missing = sequence.first - origin.last - 1
            if missing:
                self.losses.append(Loss(missing, origin.heard, sequence.begun))
            sequence.begun = origin.begun
            sequence.first = origin.first
            self._sequences.remove(origin)
        elif ended:
            # Its publisher was started again, and counts from the beginning.
            self._sequences.remove(min(ended, key=lambda each: each.heard))
