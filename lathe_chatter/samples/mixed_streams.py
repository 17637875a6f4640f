"""Samples that several publishers may send at once: what goes to and fro between them is no loss.

A lathe that goes on exactly where it was left had not been reset, and nothing of it is missing:
what came in between is of another one. So what a break counted is taken back once what it left
goes on.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

from lathe_chatter.array_types import Array
from lathe_chatter.samples.continuity import LONGEST_STEP, BlockOrder, Continuity

_STREAMS = 8
"""Streams of samples, left for others, of which the ends are kept."""


class _Break(NamedTuple):
    """Where samples did not follow those before, s, and what of it was counted."""

    before: float
    after: float
    order: BlockOrder
    lost: int


class MixedContinuity(Continuity):
    """Follows samples as `Continuity`, and knows those of several publishers when it sees them.

    Attributes:
        mixed: How often samples went on where they had been left for others.
        mixed_from: Simulated time at which that was so first, s; nan while it never was.
        mixed_until: At which it was so last, s.
        undone: Times before and after the break, s, that the latest of them showed to be none.
    """

    def __init__(self, *, remember: bool = False) -> None:
        """Begin with nothing known."""
        super().__init__(remember=remember)
        self.mixed = 0
        self.mixed_from = self.mixed_until = math.nan
        self.undone: tuple[float, float] | None = None
        self._left: deque[_Break] = deque(maxlen=_STREAMS)

    def _order(
        self, before: float, after: float, is_another: Callable[[], bool] = bool
    ) -> BlockOrder:
        lost = self.lost
        order = super()._order(before, after, is_another)
        if order is BlockOrder.CONTIGUOUS:
            return order
        here = _Break(before, after, order, self.lost - lost)
        longest = LONGEST_STEP * self.step
        left = next((each for each in self._left if 0.0 < after - each.before <= longest), None)
        if left is None:
            self._left.append(here)
            return order
        self._left.remove(left)
        self._left.append(here._replace(order=BlockOrder.RETURN))
        self._take_back(here)
        self._take_back(left)
        self.mixed += 1
        self.mixed_from = self.mixed_from if self.mixed > 1 else after
        self.mixed_until, self.undone = after, (left.before, left.after)
        return BlockOrder.RETURN

    def _take_back(self, counted: _Break) -> None:
        place = counted.before, counted.after
        if counted.order is BlockOrder.GAP:
            self.lost -= counted.lost
            self.gaps -= 1
            if self._remember:
                self.gap_places.remove(place)
        elif counted.order is BlockOrder.RESTART:
            self.restarts -= 1
            if self._remember:
                self.restart_places.remove(place)


def mixed_at(before: Array, after: Array, step: float) -> float:
    """Where samples of several publishers are seen to be mixed first, s; nan if nowhere.

    Args:
        before: Times of the last samples before each place where others may begin (n,), s.
        after: Times of the first samples after it (n,), s.
        step: The usual time between two samples, s.
    """
    heard = MixedContinuity()
    heard.step = step
    broken = ~((after > before) & (after - before <= LONGEST_STEP * step))
    for place in zip(before[broken].tolist(), after[broken].tolist(), strict=True):
        if heard._order(*place) is BlockOrder.RETURN:  # noqa: SLF001 -- of this module
            break
    return heard.mixed_from
