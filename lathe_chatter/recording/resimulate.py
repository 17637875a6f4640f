"""`resimulate`: compute a recorded run again from what it says, and compare every bit.

A run tells the parameters of its lathe, and each change of the cut and each knock with its
simulated time (changes.py). The lathe is deterministic, its noise included; so the samples are
those that follow from the rest of the record, or somebody has altered the one or the other.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from lathe_chatter.changes import BEGINNING_AGAIN, Change, Knock
from lathe_chatter.errors import LatheChatterError, LayoutError, ParameterError
from lathe_chatter.lathe_parameters import cut_from, lathe_from
from lathe_chatter.model import SAMPLE_COLUMNS, Array, Cut, Integers
from lathe_chatter.recording.identity import IDENTITY, core_identity
from lathe_chatter.recording.reading.reader import Run, RunReadError
from lathe_chatter.recording.reading.sample_blocks import SAMPLES_TYPE, Blocks
from lathe_chatter.recording.told import Told, told_by
from lathe_chatter.recording.verify import Finding

_AT_ONCE = 50_000
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


@dataclass
class Resimulation:
    """What came of computing the samples of a topic again.

    Attributes:
        topic: Of the samples.
        compared: How many were compared and are equal, bit for bit, in order.
        difference: The first that is not.
        obstacle: Why the rest, or all, cannot be judged; a sentence, or empty.
    """

    topic: str
    compared: int = 0
    difference: Difference | None = None
    obstacle: str = ''

    @property
    def proven(self) -> bool:
        """Whether every sample of the record is what the lathe computes."""
        return self.difference is None and not self.obstacle


class _CannotError(LatheChatterError):
    """Something without which the samples cannot be computed; the text says what."""


def resimulate(run: Run) -> list[Resimulation]:
    """Compute the samples of every lathe of a run again.

    Where samples are missing the lathe cuts on without comparing.

    Raises:
        RunReadError: If a file is damaged and the run was not opened for that, or there are no
            samples of a lathe in it.
    """
    names = [
        name
        for name, kind in sorted(run.topics.items())
        if kind == SAMPLES_TYPE and name.endswith('/samples')
    ]
    if not names:
        raise RunReadError(f'{run.path} holds no samples of a lathe to compute again.')
    return [_resimulated(run, name) for name in names]


def _resimulated(run: Run, topic: str) -> Resimulation:
    found = Resimulation(topic)
    told = told_by(run, topic.removesuffix('/samples'))
    try:
        replay = _Replay(told)
    except (_CannotError, ParameterError) as error:
        found.obstacle = str(error)
        return found
    try:
        for blocks in run.sample_blocks(topic):
            found.difference = replay.compare(blocks)
            if found.difference is not None:
                break
    except (_CannotError, ParameterError, LayoutError) as error:
        found.obstacle = str(error)
        return found
    finally:
        found.compared = replay.compared
    if found.difference is not None:
        found.obstacle = _excuse(run, replay)
    return found


def finding_of(found: Resimulation) -> Finding:
    """What came of it as a finding among those of `verify`."""
    difference = found.difference
    if found.proven:
        text = f'all {found.compared} samples were computed again and are equal, bit for bit.'
    elif difference is None:
        text = f'its samples cannot be computed again beyond {found.compared}. {found.obstacle}'
    else:
        text = (
            f'the sample at {difference.time!r} s has {difference.column} '
            f'{difference.recorded!r}, and computed again it is {difference.computed!r}; '
            f'{found.compared} samples before it are equal.'
        )
        text += f' {found.obstacle}' if found.obstacle else ' The run was altered.'
    return Finding(loss=not found.proven, text=f'{found.topic}: {text}')


def _excuse(run: Run, replay: _Replay) -> str:
    """Why a difference need not mean that anything was altered; empty where nothing speaks so."""
    made_by: dict[str, str] = {}
    for note in run.notes():
        if note.name == IDENTITY:
            made_by = note.values
    other = [
        f'{name} {made_by.get(name, "unknown")} and not {value}'
        for name, value in core_identity().items()
        if made_by.get(name) != value
    ]
    if other:
        return f'It was computed by other software: {", ".join(other)}.'
    if replay.after_gap:
        return (
            'Samples are missing before it, and what happened to the cut meanwhile may be missing '
            'too.'
        )
    if not replay.logged:
        return (
            'The record has nothing of the log of the lathe: whether its cut was changed is not '
            'known.'
        )
    if not replay.whole and not replay.compared:
        return (
            'The record does not begin with the cut: what was changed before it began is not '
            'known, so its samples cannot be computed.'
        )
    return ''


class _Replay:
    """A lathe that does again what is told, sample by sample beside the record.

    Attributes:
        compared: Samples that were equal.
        whole: Whether the record says of the present act how it began.
        logged: Whether the record says anything of what happened to the cut.
        after_gap: Whether samples are missing between the last that was equal and the next.
    """

    def __init__(self, told: Told) -> None:
        if not told.parameters:
            raise _CannotError('The run does not say with what parameters the lathe was started.')
        self.compared = 0
        self.after_gap = False
        self.logged = told.logged
        self._told = told
        self._act = -1
        self._waiting: list[Change | Knock] = []
        self._parameters = told.parameters
        self._lathe = lathe_from(told.parameters)

    def _begin(self, published: int) -> None:
        """Begin the act of a block, at time zero, with the cut that those before it left.

        Args:
            published: When the block was, ns since the epoch: acts may have passed without one.
        """
        acts, cut = self._told.acts, self._lathe.cut
        for happened in self._waiting:  # no sample came after these
            cut = _after(cut, happened)
        self._act += 1
        while self._act + 1 < len(acts) and acts[self._act + 1].begun <= published:
            cut = self._started(cut)
            for happened in acts[self._act].happenings:
                cut = _after(cut, happened)
            self._act += 1
        if self._act >= len(acts):
            raise _CannotError(
                'Simulated time goes back, and the record does not say how the lathe began again.'
            )
        cut = self._started(cut)
        values = {name: getattr(cut, name) for name in Cut.__dataclass_fields__}
        self._lathe = lathe_from({**self._parameters, **values})
        self.whole = bool(acts[self._act].beginning)
        self._waiting = list(acts[self._act].happenings)

    def _started(self, cut: Cut) -> Cut:
        """The cut at time zero of the present act: as it was, or of a lathe started again."""
        act = self._told.acts[self._act]
        if not self._act or act.beginning == BEGINNING_AGAIN:
            return cut
        if not act.parameters:
            raise _CannotError(
                'The lathe was started a second time, and with what parameters is not recorded.'
            )
        self._parameters = act.parameters
        return cut_from(act.parameters)

    def compare(self, blocks: Blocks) -> Difference | None:
        """Compare the blocks of some messages with what the lathe does; the first difference."""
        if blocks.columns != SAMPLE_COLUMNS:
            raise _CannotError('The samples have other columns than this lathe computes.')
        for samples in self._pieces(blocks):
            difference = self._compare_piece(samples)
            if difference is not None:
                return difference
            self.compared += len(samples)
            self.after_gap = False
        return None

    def _pieces(self, blocks: Blocks) -> Iterator[Array]:
        """Messages joined as far as their places follow each other; the lathe is at the first."""
        ends = np.cumsum(blocks.rows)
        begins = ends - blocks.rows
        places = _places(blocks, self._lathe.sample_rate)
        breaks = np.flatnonzero(places[1:] != places[:-1] + blocks.rows[:-1]) + 1
        for first, last in _spans(len(places), breaks):
            self._go_to(int(places[first]), int(blocks.publish_times[first]))
            yield blocks.samples[begins[first] : ends[last]]

    def _go_to(self, place: int, published: int) -> None:
        """Have the lathe where the next sample is number `place`, counted from 0.

        Args:
            place: Of the sample.
            published: When it was, ns since the epoch.
        """
        if self._act < 0 or place < self._lathe.samples_taken:
            self._begin(published)
        while self._lathe.samples_taken < place:
            self.after_gap = self.compared > 0
            self._cut(min(place - self._lathe.samples_taken, _AT_ONCE))
            if self._lathe.guard:
                raise _CannotError(f'The lathe ends before the samples do. {self._lathe.guard}')

    def _compare_piece(self, samples: Array) -> Difference | None:
        done = 0
        while done < len(samples):
            computed = self._cut(min(len(samples) - done, _AT_ONCE))
            recorded = np.ascontiguousarray(samples[done : done + len(computed)])
            wrong = np.argwhere(recorded.view(np.uint64) != computed.view(np.uint64))
            if len(wrong):
                row, column = (int(each) for each in wrong[0])
                self.after_gap = self.after_gap and not done + row
                self.compared += done + row
                return Difference(
                    float(computed[row, 0]),
                    SAMPLE_COLUMNS[column],
                    float(recorded[row, column]),
                    float(computed[row, column]),
                )
            done += len(computed)
            if self._lathe.guard and done < len(samples):
                raise _CannotError(f'The lathe ends before the samples do. {self._lathe.guard}')
        return None

    def _cut(self, samples: int) -> Array:
        """Cut on, at most up to the next change; what is due now happens before."""
        while self._waiting and self._when(self._waiting[0]) <= self._lathe.samples_taken:
            self._do(self._waiting.pop(0))
        if self._waiting:
            until = self._when(self._waiting[0]) - self._lathe.samples_taken
            samples = min(samples, until)
        return self._lathe.advance(samples)

    def _when(self, happened: Change | Knock) -> int:
        """After how many samples it took effect: changes happen between two samples."""
        return round(happened.time * self._lathe.sample_rate)

    def _do(self, happened: Change | Knock) -> None:
        if isinstance(happened, Knock):
            self._lathe.knock(happened.impulse)
        else:
            self._lathe.retune(_after(self._lathe.cut, happened))


def _after(cut: Cut, happened: Change | Knock) -> Cut:
    """A cut after what happened to it."""
    return cut.with_changes(**happened.new) if isinstance(happened, Change) else cut


def _places(blocks: Blocks, sample_rate: float) -> Integers:
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
        raise _CannotError('The times of the samples are no numbers.')
    places: Integers = np.rint(found).astype(np.int64)
    return places


def _spans(count: int, breaks: Integers) -> Iterator[tuple[int, int]]:
    """First and last of each stretch between breaks."""
    edges = [0, *breaks.tolist(), count]
    for first, after in pairwise(edges):
        if after > first:
            yield first, after - 1
