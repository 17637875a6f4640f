"""The samples of a run as signals: which are wanted, joined, with what is missing between them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from numbers import Real
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lathe_chatter.array_types import Array, Integers
from lathe_chatter.errors import LayoutError, ParameterError
from lathe_chatter.recording.clock_steps import STEP_BACK
from lathe_chatter.recording.sample_blocks import SampleBlocks
from lathe_chatter.samples.continuity import Continuity, time_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes


class Selection(NamedTuple):
    """Which samples of a run.

    Attributes:
        topic: Of the samples; None where the run has one lathe.
        columns: Names; None for all.
        start: Simulated time of the first, s.
        end: Simulated time of the last, s.
    """

    topic: str | None = None
    columns: tuple[str, ...] | None = None
    start: float = -np.inf
    end: float = np.inf

    def inside(self, times: Array) -> NDArray[np.bool_] | None:
        """Which of some times (n,) are wanted; None if all are."""
        if (self.start, self.end) == (-np.inf, np.inf) or not times.size:
            return None
        if self.start <= times.min() and times.max() <= self.end:
            return None
        inside: NDArray[np.bool_] = (times >= self.start) & (times <= self.end)
        return inside


def selection(topic: str | None, columns: object, start: object, end: object) -> Selection:
    """What a caller asks for, checked before anything is read.

    Raises:
        ParameterError: If columns are no list of names, an end is no number, or the range empty.
    """
    names: tuple[str, ...] | None = None
    if columns is not None:
        names = tuple(columns) if isinstance(columns, Iterable) else ()
        if isinstance(columns, str) or not names or not all(isinstance(n, str) for n in names):
            raise ParameterError('columns', columns, '', 'a list of names of columns')
    for name, value in (('start', start), ('end', end)):
        if not isinstance(value, Real) or isinstance(value, bool) or math.isnan(value):
            raise ParameterError(name, value, 's', 'a number')
    first, last = float(start), float(end)  # type: ignore[arg-type]  # checked above
    if first > last:
        raise ParameterError('start', first, 's', f'at most the end, {last:g} s')
    return Selection(topic, names, first, last)


class Samples(NamedTuple):
    """The samples of one lathe.

    Attributes:
        columns: Each signal by name (n,), SI.
        log_times: When each block was received, ns since the epoch (blocks,).
        block_ends: Simulated time of the last sample of each block, s (blocks,).
        gaps: Where samples are missing: simulated times before and after, s.
        restarts: Where simulated time went back: simulated times before and after, s.
    """

    columns: dict[str, Array]
    log_times: Integers
    block_ends: Array
    gaps: list[tuple[float, float]]
    restarts: list[tuple[float, float]]

    def simulated_time(self, log_times: ArrayLike) -> Array:
        """Simulated times when other things were recorded, s: those of the blocks about them.

        A clock that was set back showed the same twice: of what came then it is nan, as nothing
        says which time it was.

        Args:
            log_times: Of these, ns since the epoch (m,).
        """
        relative = (self.log_times - self.log_times[0]).astype(float)
        asked = (np.asarray(log_times, np.int64) - self.log_times[0]).astype(float)
        found: Array = np.full(asked.shape, np.nan)
        answers = np.zeros(asked.shape, int)
        set_back = np.flatnonzero(np.diff(relative) < -STEP_BACK) + 1
        for blocks in np.split(np.arange(len(relative)), set_back):
            begin, end = relative[blocks[0]], relative[blocks[-1]]
            inside = (asked >= begin) | (begin == relative.min())
            inside &= (asked <= end) | (end == relative.max())
            found[inside] = np.interp(asked[inside], relative[blocks], self.block_ends[blocks])
            answers += inside
        found[answers > 1] = np.nan
        return found

    def plot(self, *columns: str, axes: Axes | None = None) -> Axes:
        """Plot columns of one unit, by default the displacements, over simulated time.

        Args:
            columns: Their names.
            axes: To draw into; by default those of a new figure.

        Returns:
            The axes.

        Raises:
            ParameterError: If there is no such column, or they have several units.
        """
        from lathe_chatter.recording.plot_samples import plot_samples

        return plot_samples(self, columns, axes)

    def __repr__(self) -> str:
        """How many of what from when to when."""
        count = len(self.block_ends) and len(next(iter(self.columns.values())))
        times = self.columns.get('time', self.block_ends)
        span = f' from {times[0]:g} to {times[-1]:g} s' if len(times) else ''
        breaks = _broken_at('gap', self.gaps) + _broken_at('restart', self.restarts)
        return f'<Samples: {count} of {", ".join(self.columns)}{span}{breaks}>'


def _broken_at(name: str, places: list[tuple[float, float]]) -> str:
    """How often something breaks the samples, and where first."""
    times = ', '.join([f'{before:g}' for before, _ in places[:3]] + ['...'] * (len(places) > 3))
    return f', {len(places)} {name}{"s" * (len(places) > 1)} at {times} s' if places else ''


def joined(blocks: Iterable[SampleBlocks], expected: int, wanted: Selection) -> Samples | None:
    """All samples that are wanted; None where there is not one at all.

    Args:
        blocks: In order.
        expected: How many messages there are, as far as is known.
        wanted: Columns and range.

    Raises:
        LayoutError: If a column is not there from some time on.
    """
    signals: _Signals | None = None
    log_times: list[Integers] = []
    ends: list[Array] = []
    continuity = Continuity(remember=True)
    for part in blocks:
        if not len(part.times):
            continue
        names = part.columns if wanted.columns is None else wanted.columns
        if signals is None:
            names = tuple(name for name in part.columns if name in names)
            signals = _Signals(names, expected * int(part.rows[0]))
        lacking = signals.names - set(part.columns)
        if lacking:
            since = time_text(part.times[0])
            raise LayoutError(f'The samples from {since} on have no {", ".join(sorted(lacking))}.')
        times, chosen = part.times, part.signals
        last = times[np.maximum(np.cumsum(part.rows) - 1, 0)]
        log = part.log_times
        inside = wanted.inside(times)
        if inside is not None:
            chosen, times = chosen[:, inside], times[inside]
            first = last - (part.rows - 1) * continuity.step
            kept = (last >= wanted.start) & (first <= wanted.end)
            last, log = last[kept], log[kept]
        log_times.append(log)
        ends.append(last)
        continuity.follow(times)
        signals.append(part.columns, chosen)
    if signals is None:
        return None
    return Samples(
        signals.taken(),
        np.concatenate(log_times),
        np.concatenate(ends),
        [*continuity.gap_places],
        [*continuity.restart_places],
    )


class _Signals:
    """Signals that grow at their ends, each in one array, so that nothing is held twice."""

    def __init__(self, names: Sequence[str], expected: int) -> None:
        self._arrays = {name: np.empty(expected) for name in names}
        self._room = expected
        self._size = 0

    @property
    def names(self) -> set[str]:
        """Of the signals."""
        return set(self._arrays)

    def append(self, names: Sequence[str], signals: Array) -> None:
        """Add named signals (k, n); all that were there at the beginning."""
        end = self._size + signals.shape[1]
        if end > self._room:
            self._room = max(end, self._room * 3 // 2)
            self._arrays = {n: np.resize(a, self._room) for n, a in self._arrays.items()}
        for name, array in self._arrays.items():
            array[self._size : end] = signals[names.index(name)]
        self._size = end

    def taken(self) -> dict[str, Array]:
        """What was added, by name."""
        return {name: array[: self._size] for name, array in self._arrays.items()}
