"""A monitor that is started anew while its flag is up: nobody said that the chatter had ended."""

from __future__ import annotations

from pathlib import Path

import pytest

from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.recording import RunWriter
from lathe_chatter.recording.ros_messages import message_bytes, topic_of_type
from lathe_chatter.report.run_history import in_words, read_history
from lathe_chatter.samples.codec import SAMPLES_TYPE, encode_block

FLAG, BOOL = '/chatter_monitor/chatter', 'std_msgs/msg/Bool'
START = 1_700_000_000_000_000_000
FLAGS = {
    0: (1, False),
    100: (2, True),
    200: (1, False),  # by another monitor
    300: (2, True),
    400: (3, False),
    450: (1, False),
}
"""By block: the number that the publisher gives, and the flag."""


@pytest.fixture
def run(tmp_path: Path) -> Path:
    lathe = VirtualLathe()
    with RunWriter(tmp_path / 'run') as writer:
        writer.add_topic(topic_of_type('/lathe/samples', SAMPLES_TYPE))
        writer.add_topic(topic_of_type(FLAG, BOOL))
        for k in range(500):
            now = START + k * 2_000_000
            told = {'log_time': now, 'publish_time': now}
            block = encode_block(lathe.advance(20))
            writer.write('/lathe/samples', block, sequence=k + 1, **told)
            if k in FLAGS:
                number, up = FLAGS[k]
                writer.write(FLAG, message_bytes(BOOL, data=up), sequence=number, **told)
                # As a file begins with what one before had last.
                again = {**told, 'log_time': now + 1}
                writer.write(FLAG, message_bytes(BOOL, data=up), sequence=number, **again)
    return tmp_path / 'run'


def test_a_monitor_that_is_started_anew_clears_nothing(run: Path) -> None:
    history = read_history(run)
    assert [(round(flag.time, 1), in_words(flag)) for flag in history.flags] == [
        (0.2, 'chatter flagged'),
        (0.4, 'the monitor was started anew'),
        (0.6, 'chatter flagged'),
        (0.8, 'flag cleared'),
        (0.9, 'the monitor was started anew'),
    ]
    assert history.chatter_spans() == [
        pytest.approx((0.2, 0.4), abs=0.01),
        pytest.approx((0.6, 0.8), abs=0.01),
    ]


def test_what_is_said_of_a_cut_that_ended_is_not_of_the_one_after(tmp_path: Path) -> None:
    with RunWriter(tmp_path / 'run') as writer:
        writer.add_topic(topic_of_type('/lathe/samples', SAMPLES_TYPE))
        writer.add_topic(topic_of_type(FLAG, BOOL))

        def write(topic: str, data: bytes, number: int, at: float) -> None:
            now = START + round(1e9 * at)
            writer.write(topic, data, sequence=number, log_time=now, publish_time=now)

        for begin in (0.0, 5.0):  # a reset, after the lathe has stood still for a while
            lathe = VirtualLathe()
            for k in range(100):
                block = encode_block(lathe.advance(20))
                write('/lathe/samples', block, k + 1, begin + 0.002 * (k + 1))
            if not begin:
                write(FLAG, message_bytes(BOOL, data=True), 1, 0.25)
    history = read_history(tmp_path / 'run')
    (flag,) = history.flags
    assert flag.time == pytest.approx(0.2)
    assert flag.time <= history.later_sessions[0].time
    assert [in_words(event) for event in history.in_order()][:2] == [
        'chatter flagged',
        in_words(history.later_sessions[0]),
    ]
