"""What /diagnostics shows of a recording, and what the recorder says while it records."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

from lathe_chatter.nodes.diagnostics import ERROR, OK, WARN, Status
from lathe_chatter.nodes.recorded_topic import RecordedTopic
from lathe_chatter.recording.cut_session import Journal, Seam
from lathe_chatter.recording.receive_stalls import Stalls
from lathe_chatter.samples.continuity import Joint


def recording_status(
    run: Path | None,
    failure: str,
    topics: Mapping[str, RecordedTopic],
    journal: Journal,
    stalls: Stalls,
) -> Status:
    """The status of a recorder.

    Args:
        run: Its folder; None while nothing is recorded.
        failure: Why a recording ended that should not have; empty where none did.
        topics: By name.
        journal: Of the run.
        stalls: Of the recorder.
    """
    values = {
        'run': str(run or ''),
        'messages': str(sum(topic.messages for topic in topics.values())),
        'lost': str(sum(topic.lost for topic in topics.values())),
        'topics': str(len(topics)),
        'stalls': str(stalls.count),
        'longest stall, s': f'{stalls.longest:.3g}',
    }
    for name, heard in journal.samples.items():
        values |= {
            f'{name}: samples': str(heard.continuity.samples),
            f'{name}: samples before the first': str(heard.head),
            f'{name}: samples lost': str(heard.continuity.lost),
            f'{name}: silences': str(heard.silences),
            f'{name}: restarts of the lathe': str(heard.continuity.restarts),
        }
    if failure:
        return Status('recording', ERROR, failure, values)
    complaints = '; '.join(_complaints(topics, journal))
    if complaints:
        return Status('recording', WARN, complaints, values)
    return Status('recording', OK, 'recording' if run else 'not recording', values)


def news(journal: Journal) -> Iterator[str]:
    """Sentences about where samples began, began again or are missing; each is told once.

    Args:
        journal: Of the run; the seams that are told are taken away.
    """
    for name, heard in journal.samples.items():
        gaps = [seam for seam in heard.seams if seam.joint is Joint.GAP]
        for seam in heard.seams:
            if seam.joint is not Joint.GAP:
                yield f'{name} {_begins(seam)}.'
        if gaps:  # there may be many
            missing = sum(seam.missing for seam in gaps)
            yield (
                f'{name}: {missing} samples between {gaps[0].before:.6f} s and '
                f'{gaps[-1].after:.6f} s did not come.'
            )
        heard.seams.clear()


def _begins(seam: Seam) -> str:
    since = f'is recorded from {seam.after:.6f} s on'
    if seam.joint is Joint.RESTART:
        since = f'{since}, after the lathe started again at {seam.before:.6f} s'
    return f'{since}, without the {seam.missing} samples before' if seam.missing else since


def _complaints(topics: Mapping[str, RecordedTopic], journal: Journal) -> Iterator[str]:
    lost = [f'{topic.lost} of {name}' for name, topic in topics.items() if topic.lost]
    if lost:
        yield f'messages were lost: {", ".join(lost)}'
    for name, heard in journal.samples.items():
        if heard.continuity.lost:
            yield f'{heard.continuity.lost} samples of {name} are missing'
        if heard.complaint:
            yield f'{name}: {heard.complaint}'
