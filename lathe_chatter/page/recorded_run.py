"""A recorded run as a page shows it: all of it at once, any part of it closely, any moment.

The first picture is made of some chunks of the file; then all samples pass by, and what is shown
gets complete. What is looked at closely is read from the file when it is asked for.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from lathe_chatter.array_types import Array, Integers
from lathe_chatter.errors import LatheChatterError, reason_of
from lathe_chatter.page.live_signals import COLUMNS, closeup
from lathe_chatter.page.server import Viewer
from lathe_chatter.page.stability_chart import draw_chart, fits
from lathe_chatter.page.versioned_values import Board
from lathe_chatter.recording import read_run
from lathe_chatter.recording.chunk_messages import messages_of
from lathe_chatter.recording.mcap_chunk_walk import Chunk, record_at
from lathe_chatter.recording.recorded_file import RecordedFile
from lathe_chatter.recording.sample_blocks import (
    BlockJoiner,
    CutsInARow,
    SampleBlocks,
    stretches_of,
)
from lathe_chatter.report.monitor_record import value_near
from lathe_chatter.report.operating_points import stays_of
from lathe_chatter.report.run_history import History, in_words, read_history

_GLANCES = 150
"""Chunks that the first picture is made of."""
_POINTS = 1000
"""Stretches of a picture."""
_FEWEST, _STRETCH, _MOST = 500, 0.002, 2_000_000
"""Stretches that suffice for a picture; their length, s, at least; and how many are kept."""
_CLOSEUP = 1.0
_SLACK = 300_000_000
"""ns about a time of reception within which a sample is looked for."""


class RecordedRun:
    """What a page has of a recorded run.

    Args:
        path: Of the run.
        topic: Of the samples; may be left out where the run has one lathe.

    Raises:
        RunReadError: If there is no such run, it has no samples, or several lathes and no topic
            is named.
    """

    def __init__(self, path: Path, topic: str | None = None) -> None:
        """Glance at the run; `read` reads it."""
        self._path, self._run = path, read_run(path, damaged=True)
        self._topic = self._run.samples_topic(topic)
        self._board = Board()
        self._history: History | None = None
        self._chart_of: Any = None
        glances = [*self._glances()]
        if not glances:
            raise self._run.without_samples(self._topic)
        # Of each place that was read: simulated time from the start of the run on, the same less
        # that of the samples, and the time of reception.
        self._places = np.array([place for place, _, _ in glances])
        self._low: Array = np.array([low for _, low, _ in glances])
        self._high: Array = np.array([high for _, _, high in glances])
        self._times: Array = self._places[:, 0]
        self._only_glanced = True
        self._show('The first picture is of some places only.')
        self._size = sum(file.path.stat().st_size for file in self._run.opened) / 1e6
        self._show_reading(0.0)
        for name, value in (('recorded', True), ('scenarios', []), ('lathes', [self._topic])):
            self._board.put(name, value)

    def _show(self, state: str) -> None:
        begin = float(self._times[0])
        self._board.put('run', {'name': str(self._path), 'begin': begin, 'end': self._end,
                                'state': state, 'version': len(self._times)})  # fmt: skip

    def _show_reading(self, share: float) -> None:
        done = min(share, 1.0) * self._size
        self._board.put('reading', f'Reading: {done:.0f} of {self._size:.0f} MB.')

    # -- reading ---------------------------------------------------------------------------

    def _glances(self) -> Iterator[tuple[tuple[float, float, float], Array, Array]]:
        """Some chunks of each file: where, and their smallest and largest values."""
        self._end, cuts = -math.inf, CutsInARow()
        for file in self._run.opened:
            places = file.known.chunks
            every = max(1, len(places) * len(self._run.opened) // _GLANCES)
            for place in [*places[:-1:every], *places[-1:]]:
                block, received = self._chunk(file, place.offset)
                if len(block):
                    (before,) = cuts.before(block[:1, 0], block[-1:, 0]).tolist()
                    self._end = float(block[-1, 0]) + before
                    where = float(block[0, 0]) + before, before, float(received[0])
                    yield where, block[:, 2:].min(axis=0), block[:, 2:].max(axis=0)
        if self._end == -math.inf:  # a file without an index
            for part in self._run.sample_blocks(self._topic):
                if part.times.size:
                    values, self._end = _picked(part)[:, 2:], float(part.times[-1])
                    where = part.times[0], 0.0, float(part.log_times[0])
                    yield where, values.min(axis=0), values.max(axis=0)

    def _chunk(self, file: RecordedFile, offset: int) -> tuple[Array, Integers]:
        """The samples of a chunk (n, 6), and when each was received, ns."""
        chunk, joiner = record_at(file.path, offset), BlockJoiner(COLUMNS)
        if isinstance(chunk, Chunk):  # else it is damaged: `read` says so
            messages = messages_of(chunk).of(*file.channels_of(self._topic))
            joiner.add_all(stretches_of(messages))
        parts = joiner.taken()
        blocks = [np.zeros((0, len(COLUMNS))), *map(_picked, parts)]
        received = [np.zeros(0, np.int64), *(np.repeat(p.log_times, p.rows) for p in parts)]
        return np.concatenate(blocks), np.concatenate(received)

    async def read(self) -> None:
        """Let all samples pass by, then find out what happened."""
        try:
            await asyncio.to_thread(self._read_all)
            self._history = await asyncio.to_thread(read_history, self._path, self._topic)
            self._show_history(self._history)
        except LatheChatterError as error:
            self._show(f'What happened cannot be read: {error}')
        self._board.put('reading', '')

    def _read_all(self) -> None:
        length = max(_STRETCH, self._end / _MOST)
        numbers: list[Integers] = []
        lows: list[Any] = []
        highs: list[Any] = []
        places: list[Array] = []
        cuts, passed, end = CutsInARow(), 0, self._end
        expected = sum(file.count(self._topic) for file in self._run.opened)
        for part in self._run.sample_blocks(self._topic, COLUMNS):
            some = part.rows > 0
            if not some.any():
                continue
            before = cuts.before(*part.spans[:, some])
            on_axis = part.times + np.repeat(before, part.rows[some])
            end = float(on_axis[-1])
            number = np.floor(on_axis / length + 1e-6).astype(np.int64)
            change = np.flatnonzero(np.diff(number, prepend=number[0] - 1))
            values = _picked(part)[:, 2:]
            numbers.append(number[change])
            # As float32, of which an hour takes 60 MB.
            lows.append(np.minimum.reduceat(values, change).astype(np.float32))
            highs.append(np.maximum.reduceat(values, change).astype(np.float32))
            first = (np.cumsum(part.rows) - part.rows)[some]
            kept = np.diff(before, prepend=-1.0) > 0.0  # the first block of each cut
            kept[::16] = True
            where = np.column_stack((on_axis[first], before, part.log_times[some]))
            places.append(where[kept])
            passed += len(part.rows)
            self._show_reading(passed / expected if expected else end / max(self._end, 1e-9))
        self._places, self._only_glanced = np.concatenate(places), False
        self._low, self._high = np.concatenate(lows), np.concatenate(highs)
        self._times = np.concatenate(numbers).astype(float) * length
        self._end = end
        self._board.put('reading', f'What happened is sought in all {self._size:.0f} MB.')
        damage = '; '.join(f'{d.file.name}: {d.reason}' for d in self._run.damage)
        self._show(f'Not all can be read: {damage}.' if damage else '')

    def _closely(self, begin: float, end: float) -> Array:
        """The samples between two times of the run, s, by times of the run (n, 6)."""
        on, offset, received = self._places.T
        about = slice(
            max(int(np.searchsorted(on, begin, 'right')) - 1, 0), int(np.searchsorted(on, end)) + 1
        )
        from_, to = received[about].min(), received[about].max()
        if self._only_glanced:  # at places that are far from each other
            from_, to = np.interp((begin, end), on, received)
        found = [
            self._chunk(file, place.offset)
            for file in self._run.opened
            for place in file.known.chunks
            if place.first <= to + _SLACK and place.last >= from_ - _SLACK
        ]
        samples = np.concatenate([np.zeros((0, len(COLUMNS))), *(block for block, _ in found)])
        times = np.concatenate([np.zeros(0), *(times for _, times in found)])
        # Which session a sample is of is told by when it came.
        order = np.argsort(received, kind='stable')
        latest = np.maximum(np.searchsorted(received[order], times, 'right') - 1, 0)
        samples[:, 0] += offset[order[latest]]
        samples = samples[(samples[:, 0] >= begin) & (samples[:, 0] <= end)]
        in_order: Array = samples[np.argsort(samples[:, 0], kind='stable')]
        return in_order

    # -- what is shown ---------------------------------------------------------------------

    def frame(self, viewer: Viewer) -> tuple[dict[str, Any], dict[str, Any]]:
        """What is new for a viewer."""
        header: dict[str, Any] = {}
        if news := self._board.news(viewer.seen.setdefault('page', {})):
            header['page'] = news
        pictures = viewer.cursors.get('pictures')
        more, arrays = pictures.pop(0) if pictures else ({}, {})
        return {**header, **more}, arrays

    async def look(self, viewer: Viewer, wish: Mapping[str, Any]) -> bool:
        """Show a part of the run, or a moment."""
        try:
            if wish['do'] == 'view':
                begin, end = float(wish['from']), float(wish['to'])
                picture = await asyncio.to_thread(self._view, begin, end, str(wish['plot'])[:20])
            elif wish['do'] == 'at':
                picture = await asyncio.to_thread(self._moment, float(wish['time']))
            else:
                return bool(wish['do'] == 'choose')
        except OSError as error:
            raise LatheChatterError(f'{self._path} cannot be read: {reason_of(error)}.') from None
        viewer.cursors.setdefault('pictures', []).append(picture)
        return True

    async def act(self, viewer: Viewer, wish: Mapping[str, Any]) -> str:  # noqa: ARG002 -- a source's
        """Nothing can be done to a recorded run."""
        raise LatheChatterError(f'A recorded run is only looked at: {wish["do"]!r:.40} cannot be.')

    def _view(self, begin: float, end: float, name: str) -> tuple[dict[str, Any], dict[str, Any]]:
        """A part of the run as the smallest and largest values of some stretches."""
        times = self._times
        first, stop = np.searchsorted(times, (begin, end))
        inside = slice(max(int(first) - 1, 0), int(stop) + 1)
        times, low, high = times[inside], self._low[inside], self._high[inside]
        if len(times) < _FEWEST and end - begin < _FEWEST * _STRETCH:
            samples = self._closely(begin, end)
            times, low = samples[:, 0], samples[:, 2:]
            high = low
        if len(times) > _POINTS:
            # Stretches of one length in time, so that what is missing stays open.
            number = ((times - times[0]) * (_POINTS / (times[-1] - times[0] + 1e-12))).astype(int)
            starts = np.flatnonzero(np.diff(number, prepend=-1))
            low, high = np.minimum.reduceat(low, starts), np.maximum.reduceat(high, starts)
            times = times[starts]
        shown = {'from': begin, 'to': end, 'plot': name}
        return {'view': shown}, {'times': times - begin, 'values': np.stack((low, high))}

    def _moment(self, time: float) -> tuple[dict[str, Any], dict[str, Any]]:
        """Portraits and spectrum just before a time, and what was known then."""
        samples = self._closely(time - _CLOSEUP, time)
        figures, arrays = closeup(samples) if len(samples) > 1 else ({}, {})
        cell: dict[str, Any] = {}
        history = self._history
        if history is not None:
            cut = history.cut_at(time)
            figures['depth'] = cut.depth_of_cut
            figures['speed'] = figures.get('speed') or cut.spindle_speed_rpm
            before = [flag for flag in history.flags if flag.time <= time]
            cell['figures'] = {
                name: value_near(series, time)
                for name, series in history.estimates.items()
                if np.any(np.abs(series[0] - time) < 1.0)
            }
            # No figure about then: no monitor was there, or it heard nothing.
            up, since = (before[-1].chatter, before[-1].time) if before else (False, None)
            cell['flag'] = {'up': up, 'since': since} if cell['figures'] else None
            states = [each for at, each in history.states if at <= time and each != 'chatter']
            cell['state'] = states[-1] if states else None  # of chatter the flag tells
            recommended = cell['figures'].get('recommended_speed_rpm')
            cell['chart'] = self._chart(history, time, recommended)
        return {'closeup': figures, 'cell': cell, 'moment': time}, arrays

    def _chart(self, history: History, time: float, recommended: float | None) -> Any:
        """The chart that held at a time; a new one only where it is another, or falls short."""
        session, cut = history.session_at(time), history.cut_at(time)
        key = session.machine, session.tool_leaves_cut, cut.with_changes(
            spindle_speed_rpm=3000.0, depth_of_cut=0.0
        )  # fmt: skip
        shown = None if self._chart_of is None else self._chart_of[1]
        speeds = cut.spindle_speed_rpm, recommended
        if self._chart_of is None or self._chart_of[0] != key or not fits(shown, speeds):
            chart = draw_chart(
                session.machine, cut, session.described, speeds,
                tool_leaves_cut=session.tool_leaves_cut,
            )  # fmt: skip
            self._chart_of = key, chart
        return self._chart_of[1]

    def _show_history(self, history: History) -> None:
        """What happened, in order."""
        found = [[event.time, in_words(event)] for event in history.in_order()]
        self._board.put('events', [*found, [history.duration, 'the record ends']])
        self._board.put('flags', history.chatter_spans())
        points = [(stay.start, stay.cut) for stay in stays_of(history)]
        self._board.put('path', [[t, c.spindle_speed_rpm, c.depth_of_cut] for t, c in points])


def _picked(part: SampleBlocks) -> Array:
    """The COLUMNS of some blocks (n, 6), nan where there is no such column."""
    none = np.full(part.times.size, np.nan)
    rows = [part.signals[part.columns.index(n)] if n in part.columns else none for n in COLUMNS]
    return np.column_stack(rows)
