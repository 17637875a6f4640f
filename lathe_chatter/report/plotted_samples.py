"""The samples of a run as pictures need them: extremes of all, and every one of a few seconds.

A run may have more samples than fit into memory; they are passed by and never held.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from lathe_chatter.array_types import Array
from lathe_chatter.recording.sample_blocks import SampleBlocks
from lathe_chatter.samples.continuity import Continuity
from lathe_chatter.samples.extremes import TIME, Extremes

Spans = Sequence[tuple[float, float]]
"""Begin and end of each, s."""
_AT_ONCE = 50_000
"""Samples that are looked at together: more would only take more memory."""


class RunSamples:
    """Samples that pass by once when this is made, and once more for each call of `between`.

    Args:
        blocks: Gives all blocks from the first on, at each call; those outside of some spans of
            simulated time, s, may be left out where such are given.

    Attributes:
        count: Of the samples.
        first: Simulated time of the first, s.
        last: Simulated time of the last, s.
        step: Time from one to the next, s.
        gaps: Where samples are missing: simulated times before and after, s.
        restarts: Where simulated time went back: before and after, s.
        extremes: Of all signals.
    """

    def __init__(self, blocks: Callable[[Spans], Iterable[SampleBlocks]]) -> None:
        """Let them pass by."""
        self._blocks = blocks
        self.first = 0.0
        continuity = Continuity(remember=True)
        self.extremes = Extremes.none((TIME,))
        for block in blocks(()):
            samples, columns = block.samples, block.columns
            if not len(samples):
                continue
            if not continuity.samples:
                self.first = float(samples[0, columns.index(TIME)])
                self.extremes = Extremes.none(columns)
            places = [columns.index(name) for name in self.extremes.columns]
            for start in range(0, len(samples), _AT_ONCE):
                part = samples[start : start + _AT_ONCE][:, places]
                self.extremes = self.extremes.extended(part, continuity)
        self.count, self.last = continuity.samples, continuity.last or 0.0
        self.gaps, self.restarts = continuity.gap_places, continuity.restart_places
        self.step = continuity.step

    def between(self, spans: Spans) -> list[dict[str, Array]]:
        """Every sample within some spans of simulated time: after the begin, up to the end.

        Of a span with a gap in it, what comes after the last gap: what is computed from the
        samples takes them for evenly spaced.

        Args:
            spans: Begin and end of each, s.

        Returns:
            For each the signals (n,) by name.
        """
        whole = [(self._after_gaps(begin, end), end) for begin, end in spans]
        parts: list[list[Array]] = [[] for _ in spans]
        columns = self.extremes.columns
        for block in self._blocks(whole):
            names, times = block.columns, block.times
            if not len(times):
                continue
            for (begin, end), part in zip(whole, parts, strict=True):
                if times.min() <= end and times.max() > begin:
                    inside = (times > begin) & (times <= end)
                    places = [names.index(name) for name in columns]
                    part.append(block.samples[inside][:, places])
        joined = [np.concatenate([np.zeros((0, len(columns))), *part]) for part in parts]
        return [dict(zip(columns, each.T.copy(), strict=True)) for each in joined]

    def _after_gaps(self, begin: float, end: float) -> float:
        """From when on there is no gap before `end`, s."""
        inside = [after for _, after in (*self.gaps, *self.restarts) if begin < after <= end]
        # The first sample after the gap belongs to it.
        return max([begin, *(after - 0.5 * self.step for after in inside)])
