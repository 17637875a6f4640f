"""`resimulate`: compute a recorded run again from what it says, and compare every bit.

A run has the parameters of its lathe, and each change of the cut and each knock with its
simulated time (cut_events.py). The lathe is deterministic, its noise included; so the samples are
those that follow from the rest of the record, or somebody has altered the one or the other.
"""

from __future__ import annotations

from dataclasses import dataclass

from lathe_chatter.errors import LayoutError, ParameterError
from lathe_chatter.recording.cut_log import read_cut_log
from lathe_chatter.recording.provenance import IDENTITY, core_identity
from lathe_chatter.recording.replay import Difference, Replay, ReplayError
from lathe_chatter.recording.run import Run, RunReadError
from lathe_chatter.recording.verify import Finding
from lathe_chatter.samples.codec import SAMPLES_TYPE


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
    log = read_cut_log(run, topic.removesuffix('/samples'))
    try:
        replay = Replay(log)
    except (ReplayError, ParameterError) as error:
        found.obstacle = str(error)
        return found
    try:
        for blocks in run.sample_blocks(topic):
            found.difference = replay.compare(blocks)
            if found.difference is not None:
                break
    except (ReplayError, ParameterError, LayoutError) as error:
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


def _excuse(run: Run, replay: Replay) -> str:
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
    if not replay.has_beginning and not replay.compared:
        return (
            'The record does not begin with the cut: what was changed before it began is not '
            'known, so its samples cannot be computed.'
        )
    return ''
