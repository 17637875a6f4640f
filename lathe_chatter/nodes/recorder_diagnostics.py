"""What /diagnostics shows of a recording, and what the recorder says while it records."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

from lathe_chatter.nodes.diagnostics import ERROR, OK, WARN, Status
from lathe_chatter.nodes.recorded_subscription import RecordedTopic
from lathe_chatter.recording.recorder_stalls import ReceiveStalls
from lathe_chatter.recording.recording_statistics import Discontinuity, RunLog
from lathe_chatter.samples.continuity import BlockOrder


def recording_status(
    run: Path | None,
    failure: str,
    topics: Mapping[str, RecordedTopic],
    log: RunLog,
    stalls: ReceiveStalls,
) -> Status:
    """The status of a recorder.

    Args:
        run: Its folder; None while nothing is recorded.
        failure: Why a recording ended that should not have; empty where none did.
        topics: By name.
        log: Of the run.
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
    for name, received in log.samples.items():
        values |= {
            f'{name}: samples': str(received.continuity.samples),
            f'{name}: samples before the first': str(received.head),
            f'{name}: samples lost': str(received.continuity.lost),
            f'{name}: silences': str(received.silences),
            f'{name}: restarts of the lathe': str(received.continuity.restarts),
        }
    if failure:
        return Status('recording', ERROR, failure, values)
    complaints = [*_complaints(topics, log)]
    said = '; '.join(['recording' if run else 'not recording', *complaints])
    return Status('recording', WARN if complaints else OK, said, values)


def news(log: RunLog) -> Iterator[str]:
    """Sentences about where samples began, began again or are missing; each is said once.

    Args:
        log: Of the run; the discontinuities that are said are taken away.
    """
    for name, received in log.samples.items():
        gaps = [place for place in received.discontinuities if place.order is BlockOrder.GAP]
        for place in received.discontinuities:
            if place.order is not BlockOrder.GAP:
                yield f'{name} {_begins(place)}.'
        if gaps:  # there may be many
            missing = sum(place.missing for place in gaps)
            yield (
                f'{name}: {missing} samples between {gaps[0].before:.6f} s and '
                f'{gaps[-1].after:.6f} s did not come.'
            )
        received.discontinuities.clear()


def _begins(place: Discontinuity) -> str:
    since = f'is recorded from {place.after:.6f} s on'
    if place.order is BlockOrder.RESTART:
        since = f'{since}, after the lathe started again at {place.before:.6f} s'
    return f'{since}, without the {place.missing} samples before' if place.missing else since


def _complaints(topics: Mapping[str, RecordedTopic], log: RunLog) -> Iterator[str]:
    lost = [f'{topic.lost} of {name}' for name, topic in topics.items() if topic.lost]
    if lost:
        yield f'messages were lost: {", ".join(lost)}'
    for name, received in log.samples.items():
        if received.continuity.lost:
            yield f'{received.continuity.lost} samples of {name} are missing'
        if received.complaint:
            yield f'{name}: {received.complaint}'
