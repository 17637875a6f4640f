"""What /diagnostics shows of a recording, and what the recorder says while it records."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from rclpy.node import Node

from lathe_chatter.nodes.diagnostics import ERROR, OK, WARN, Status
from lathe_chatter.nodes.log_rate_limit import BoundedLog
from lathe_chatter.nodes.polled_subscription import publisher_names, several_publish
from lathe_chatter.nodes.recorded_subscription import RecordedTopic
from lathe_chatter.nodes.recorder_topic_selection import Sink, TopicWatch
from lathe_chatter.recording import RunWriter
from lathe_chatter.recording.recorder_stalls import ReceiveStalls
from lathe_chatter.recording.recording_statistics import Discontinuity, RunLog, SamplesReceived
from lathe_chatter.samples.continuity import BlockOrder


def recording_status(
    sink: Sink | None,
    failure: str,
    watch: TopicWatch | None,
    log: RunLog,
    stalls: ReceiveStalls,
) -> Status:
    """The status of a recorder.

    Args:
        sink: What takes the messages; None while nothing is recorded.
        failure: Why a recording ended that should not have; empty where none did.
        watch: Over its topics; None before the first run.
        log: Of the run.
        stalls: Of the recorder.
    """
    topics = {} if watch is None else watch.topics
    run = sink.folder if isinstance(sink, RunWriter) else ''
    values = {
        'run': str(run),
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
    complaints += [f'nobody publishes {name}' for name in (watch.awaited if watch else ())]
    does = 'not recording' if sink is None else 'keeping the last in memory'
    said = '; '.join(['recording' if run else does, *complaints])
    mixed = any(received.mixture for received in log.samples.values())
    return Status('recording', ERROR if mixed else WARN if complaints else OK, said, values)


def mixture(node: Node, topic: str, received: SamplesReceived) -> str:
    """Who sends the samples of a topic at once, a sentence; empty if nobody, or it was said.

    Args:
        node: That knows who publishes.
        topic: Of the samples.
        received: Of them; it keeps what is said.
    """
    if received.mixture or not received.continuity.mixed:
        return ''
    names = publisher_names(node, topic)
    who = several_publish(names, topic) if len(names) > 1 else f'several publish {topic}'
    received.mixture = f'{who}: their samples are mixed, and whether any are missing is not known'
    return f'{received.mixture}.'


def log_news(logger: BoundedLog, log: RunLog) -> str:
    """Say where samples began, began again or are missing; each is said once.

    Args:
        logger: Of the node.
        log: Of the run; the discontinuities that are said are taken away.

    Returns:
        What was said last; empty where there was nothing to say.
    """
    said = ''
    for name, received in log.samples.items():
        gaps = [place for place in received.discontinuities if place.order is BlockOrder.GAP]
        for place in received.discontinuities:
            if place.order is not BlockOrder.GAP:
                said = f'{name} {_begins(place)}.'
                logger.info(said, f'{name} begins')
        if gaps:  # there may be many
            missing = sum(place.missing for place in gaps)
            where = f'between {gaps[0].before:.6f} s and {gaps[-1].after:.6f} s'
            said = f'{name}: {missing} samples {where} did not come.'
            logger.warning(said, f'{name} lost')
        received.discontinuities.clear()
    return said


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
        if received.mixture:
            yield received.mixture
        if received.complaint:
            yield f'{name}: {received.complaint}'
        if received.silent:
            yield f'no samples of {name} come'
