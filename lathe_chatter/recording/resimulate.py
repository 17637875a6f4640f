"""`resimulate`: compute a recorded run again from what it says, and compare every bit.

A run has the parameters of its lathe, and each change of the cut and each knock with its
simulated time (change_and_knock_sentences.py). The lathe is deterministic, its noise included; so
the samples are those that follow from the rest of the record, or somebody has altered the one or
the other.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from lathe_chatter.errors import (
    LayoutError,
    MixedSamplesError,
    ParameterError,
    ReplayError,
    RunReadError,
)
from lathe_chatter.recording.cut_log import CutSession
from lathe_chatter.recording.provenance import (
    IDENTITY,
    PUBLISHERS,
    RECEPTION,
    core_identity,
    noted_number,
)
from lathe_chatter.recording.recorded_cuts import RecordedCuts, recorded_cuts
from lathe_chatter.recording.resimulated_lathe import Difference, Replay
from lathe_chatter.recording.run import Run, read_run
from lathe_chatter.recording.run_timeline import blocks_as_written
from lathe_chatter.recording.sample_blocks import SampleBlocks
from lathe_chatter.recording.verify import Finding


@dataclass
class Resimulation:
    """What came of computing the samples of a topic again.

    Attributes:
        topic: Of the samples.
        compared: How many were compared and are equal, bit for bit, in order.
        difference: The first that is not.
        obstacle: Why the rest, or all, cannot be judged; a sentence, or empty.
        contradictions: What of the record does not fit, with both witnesses; sentences.
        follows: Which of two witnesses that do not fit the samples follow from.
    """

    topic: str
    compared: int = 0
    difference: Difference | None = None
    obstacle: str = ''
    contradictions: list[str] = field(default_factory=list)
    follows: str = ''

    @property
    def reproduced(self) -> bool:
        """Whether every sample of the record is what the lathe computes."""
        return self.difference is None and not self.obstacle

    @property
    def proven(self) -> bool:
        """Whether, besides, nothing of the record contradicts it."""
        return self.reproduced and not self.contradictions


def resimulate(run: Run | Path | str) -> list[Resimulation]:
    """Compute the samples of every lathe of a run again.

    Where samples are missing the lathe cuts on without comparing.

    Args:
        run: That was read, or where it is.

    Raises:
        RunReadError: If a file is damaged and the run was not opened for that, or there are no
            samples of a lathe in it.
    """
    run = run if isinstance(run, Run) else read_run(run)
    if not (names := run.samples_topics()):
        raise RunReadError(f'{run.path} holds no samples of a lathe to compute again.')
    return [_resimulated(run, name) for name in names]


def _resimulated(run: Run, topic: str) -> Resimulation:
    try:
        cuts = recorded_cuts(run, topic.removesuffix('/samples'))
    except MixedSamplesError as error:
        return Resimulation(topic, obstacle=str(error))
    found = _replayed(run, topic, cuts)
    found.contradictions = cuts.log.contradictions
    if found.contradictions and not found.reproduced:
        # Of two that do not fit, the samples may follow from the other one.
        cuts.log.believe_notes()
        other = _replayed(run, topic, cuts)
        if other.reproduced:
            found.compared, found.difference, found.obstacle = other.compared, None, ''
            found.follows = 'noted'
    elif found.contradictions:
        found.follows = 'announced'
    if found.difference is not None and not found.obstacle:
        found.obstacle = _doubt(run, topic)
    return found


def _replayed(run: Run, topic: str, cuts: RecordedCuts) -> Resimulation:
    """One attempt, by the parameters that the sessions have."""
    found, replay, done = Resimulation(topic), Replay(cuts.log), 0
    try:
        for blocks in blocks_as_written(run, topic):
            for session, part in _by_session(cuts, blocks, done):
                if session is not replay.session:
                    replay.begin(session)
                found.difference = replay.compare(part)
                if found.difference is not None:
                    found.obstacle = replay.doubt
                    return found
            done += len(blocks.rows)
    except (ReplayError, ParameterError, LayoutError) as error:
        found.obstacle = str(error)
    finally:
        found.compared = replay.compared
    return found


def _by_session(
    cuts: RecordedCuts, blocks: SampleBlocks, done: int
) -> Iterator[tuple[CutSession, SampleBlocks]]:
    """Blocks, of which `done` were before, by the session that they are of."""
    for session in cuts.sampled:
        first = max(session.blocks.start - done, 0)
        after = min(session.blocks.stop - done, len(blocks.rows))
        if first < after:
            yield session, blocks.some(first, after)


def finding_of(found: Resimulation) -> Finding:
    """What came of it as a finding among those of `verify`."""
    difference = found.difference
    if found.reproduced:
        text = f'all {found.compared} samples were computed again and are equal, bit for bit.'
    elif difference is None:
        text = f'not provable beyond {found.compared} samples, because: {found.obstacle}'
    else:
        text = (
            f'the sample at {difference.time!r} s has {difference.column} '
            f'{difference.recorded!r}, and computed again it is {difference.computed!r}; '
            f'{found.compared} samples before it are equal. '
        )
        text += (
            f'That proves nothing, because: {found.obstacle}'
            if found.obstacle
            else 'The record contradicts itself.'
            if found.contradictions
            else 'The run was altered.'
        )
    if found.contradictions:
        text += f' {" ".join(found.contradictions)}'
        if found.follows:
            text += f' The samples follow from what was {found.follows}; the other is not true.'
    altered = bool(found.contradictions) or (difference is not None and not found.obstacle)
    return Finding(altered, f'{found.topic}: {text}', unproven=not altered and not found.proven)


def _doubt(run: Run, topic: str) -> str:
    """Why a difference need not mean that anything was altered; empty where nothing speaks so."""
    made_by: dict[str, str] = {}
    publishers, missing = 1, 0
    for note in run.notes():
        if note.name == IDENTITY:
            made_by = note.values
        elif note.name == PUBLISHERS:
            publishers = max(publishers, noted_number(note.values.get(topic, '1')))
        elif note.name == RECEPTION:
            missing = noted_number(note.values.get('/rosout', ''), 'lost')
    other = [
        f'{name} {made_by.get(name, "unknown")} and not {value}'
        for name, value in core_identity().items()
        if made_by.get(name) != value
    ]
    if other:
        return f'It was computed by other software: {", ".join(other)}.'
    if missing:
        return f'Of the log {missing} messages are missing, and with them perhaps a change.'
    if publishers > 1:
        return f'Up to {publishers} nodes published these samples at the same time.'
    return ''
