"""When a monitor's flag rose: by its own word, and else by when that was received."""

from __future__ import annotations

from pathlib import Path

import pytest

from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.recording import RunWriter
from lathe_chatter.recording.ros_messages import LOG_TYPE, log_bytes, message_bytes, topic_of_type
from lathe_chatter.report.monitor_record import Flag
from lathe_chatter.report.run_history import read_history
from lathe_chatter.samples.codec import SAMPLES_TYPE, encode_block

BOOL = 'std_msgs/msg/Bool'
START = 1_700_000_000_000_000_000
TICK = 2_000_000
"""ns."""
ONSET = 'At 0.050000 s: chatter at 131.4 Hz, growing at 8.0 1/s.'


def flags_of(folder: Path, sentence: str, *, logger: str = 'cell.chatter_monitor',
             late: int = 0, reset: bool = False) -> list[Flag]:  # fmt: skip
    """Those of a run whose flag rises at 0.1 s of reception, with a sentence."""
    lathe = VirtualLathe()
    with RunWriter(folder / 'run') as writer:
        for topic, kind in (
            ('/cell/lathe/samples', SAMPLES_TYPE),
            ('/cell/chatter_monitor/chatter', BOOL),
            ('/rosout', LOG_TYPE),
        ):
            writer.add_topic(topic_of_type(topic, kind))
        for k in range(1, 101):
            if reset and k == 49:
                lathe = VirtualLathe()
            now = START + k * TICK
            block = encode_block(lathe.advance(20))
            writer.write('/cell/lathe/samples', block, log_time=now, publish_time=now)
            if k == 50:
                raised = message_bytes(BOOL, data=True)
                told = {'log_time': now, 'publish_time': now}
                writer.write('/cell/chatter_monitor/chatter', raised, **told)
                then = now + late
                said = log_bytes(logger, sentence, then)
                writer.write('/rosout', said, log_time=then, publish_time=then)
    return read_history(folder / 'run').flags


def test_a_flag_has_the_time_at_which_its_monitor_decided(tmp_path: Path) -> None:
    (flag,) = flags_of(tmp_path, ONSET)
    assert flag.time == pytest.approx(0.05)
    assert flag.received == pytest.approx(0.1)


def test_a_jump_of_the_clock_that_a_lathe_followed_is_in_the_report(tmp_path: Path) -> None:
    said = (
        '/clock went back to 120.009 s, 4.984 s before the next tick: the cut goes on from there.'
    )
    flags_of(tmp_path, said, logger='cell.lathe')
    assert read_history(tmp_path / 'run').remarks == [f'The lathe said: {said}']
    flags_of(tmp_path / 'other', said, logger='other.lathe')
    assert read_history(tmp_path / 'other' / 'run').remarks == []


def test_a_sentence_that_waited_for_its_advice_dates_its_flag(tmp_path: Path) -> None:
    (flag,) = flags_of(tmp_path, ONSET, late=1_500_000_000)
    assert flag.time == pytest.approx(0.05)


@pytest.mark.parametrize(
    ('sentence', 'other'),
    [
        (ONSET, {'logger': 'other.chatter_monitor'}),
        (ONSET, {'late': -1_000_000_000}),
        (ONSET, {'late': 10_000_000_000}),
        ('At 0.050000 s: the chatter has died out; the cut is stable.', {}),
        ('At 0.050000 s: try 3700 rev/min.', {}),
        ('At 5.000000 s: chatter flagged.', {}),
    ],
)
def test_what_is_said_of_something_else_moves_no_flag(
    sentence: str, other: dict[str, int], tmp_path: Path
) -> None:
    (flag,) = flags_of(tmp_path, sentence, **other)
    assert flag.time == flag.received == pytest.approx(0.1)


def test_a_flag_that_came_after_a_reset_has_no_time_of_the_cut_before(tmp_path: Path) -> None:
    (flag,) = flags_of(tmp_path, 'At 0.900000 s: chatter flagged.', reset=True)
    assert flag.time == flag.received
