"""What the recorder answers and says of itself: each sentence where it is true."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rcl_interfaces.msg import Log
from std_msgs.msg import Float64, Float64MultiArray
from support.node_bench import LATCHED, Bench

from lathe_chatter.errors import LatheChatterError
from lathe_chatter.nodes.diagnostics import OK, WARN
from lathe_chatter.nodes.recorder_node import RecorderNode
from lathe_chatter.nodes.topic_types import MissingTypeError, _message_class
from lathe_chatter.recording.clock_steps import ClockWatch
from lathe_chatter.samples.codec import encode_block

Start = Callable[..., Any]
NOTHING = 'Nothing is being recorded.'
NO_MEMORY = 'Nothing is kept in memory: the parameter snapshot says how long to keep it.'


def said(log: list[Any]) -> list[str]:
    return [entry.msg for entry in log if entry.name == 'run_recorder']


def test_each_request_is_answered_by_what_is_so(
    start: Start, bench: Bench, tmp_path: Path
) -> None:
    log = bench.listen_first(Log, '/rosout', LATCHED)
    run = tmp_path / 'run'
    recorder = start(RecorderNode, output=str(run), topics=['/n'], autostart=False)

    def ask(name: str) -> str:
        return str(bench.trigger(f'/run_recorder/{name}').message)

    assert [ask(name) for name in ('stop', 'split', 'snapshot')] == [NOTHING, NOTHING, NO_MEMORY]
    assert bench.pause('/run_recorder').message == NOTHING
    assert recorder._status().message == 'not recording'
    assert ask('start') == f'Recording into {run}.'
    assert ask('start') == f'Already recording into {run}.'
    assert recorder._status().message == 'recording'
    assert ask('split') == 'Going on in a new file.'
    assert ask('snapshot') == NO_MEMORY
    assert bench.pause('/run_recorder', pause=False).message == 'It is so already.'
    assert bench.pause('/run_recorder').message == 'What comes is left out.'
    assert bench.pause('/run_recorder', pause=False).message == 'Recording goes on.'
    held = f'{run} holds 0 messages, and 0 were lost on the way.'
    assert [ask('stop'), ask('stop')] == [held, NOTHING]
    bench.spin_until(lambda: held in said(log), 'the log')
    assert f'Recording into {run}.' in said(log)


def test_a_black_box_says_what_it_keeps(start: Start, bench: Bench, tmp_path: Path) -> None:
    run = tmp_path / 'run'
    values = {'output': str(run), 'topics': ['/n'], 'snapshot': 5.0, 'autostart': False}
    log = bench.listen_first(Log, '/rosout', LATCHED)
    recorder = start(RecorderNode, **values)

    def ask(name: str) -> str:
        return str(bench.trigger(f'/run_recorder/{name}').message)

    assert ask('start') == 'Keeping the last in memory.'
    assert ask('start') == 'Already keeping the last in memory.'
    status = recorder._status()
    assert (status.level, status.message) == (OK, 'keeping the last in memory')
    assert status.values['run'] == ''
    bench.talk(Float64, '/n').publish(Float64(data=1.0))
    bench.spin_until(lambda: recorder.messages_of('/n') == 1, 'a message')
    assert ask('snapshot') == f'{run} holds the last 1 messages.'
    assert ask('stop') == 'What was in memory is dropped.'
    assert recorder._status().message == 'not recording'
    bench.spin_until(lambda: 'Recording the last 5 s in memory.' in said(log), 'the log')


def test_what_is_lost_or_no_block_of_samples_is_told(
    start: Start, bench: Bench, tmp_path: Path
) -> None:
    recorder = start(RecorderNode, output=str(tmp_path / 'run'), topics=['/n', '/lathe/samples'])
    assert (recorder._status().level, recorder._status().message) == (OK, 'recording')
    bench.overflow('/n', lambda: recorder.messages_of('/n') == 1)
    bench.spin_until(lambda: recorder.lost_of('/n'), 'the loss')
    lost = f'messages were lost: {recorder.lost_of("/n")} of /n'
    assert (recorder._status().level, recorder._status().message) == (WARN, f'recording; {lost}')
    samples = bench.talk(Float64MultiArray, '/lathe/samples')
    samples.publish(encode_block(np.full((2, 1), np.nan), ['time']))
    wrong = '/lathe/samples: The times of samples are no numbers.'
    bench.spin_until(lambda: wrong in recorder._status().message, 'the complaint')


def test_what_cannot_be_kept_or_looked_for_is_named(
    start: Start, bench: Bench, tmp_path: Path
) -> None:
    log = bench.listen_first(Log, '/rosout', LATCHED)
    missing = str(tmp_path / 'missing.yaml')
    start(RecorderNode, output=str(tmp_path / 'run'), topics=['/n'], attachments=[missing])
    why = f'{missing} is not attached to the run: No such file or directory.'
    bench.spin_until(lambda: why in said(log), 'the warning')
    (tmp_path / 'file').touch()
    with pytest.raises(LatheChatterError, match=r'^The run .*/file/run cannot be made: '):
        start(RecorderNode, output=str(tmp_path / 'file' / 'run'))
    with pytest.raises(LatheChatterError, match='must be a regular expression, and'):
        start(RecorderNode, output=str(tmp_path / 'other'), topics_like='(')


def test_a_step_of_the_clock_is_noted(start: Start, bench: Bench, tmp_path: Path) -> None:
    log = bench.listen_first(Log, '/rosout', LATCHED)
    recorder = start(RecorderNode, output=str(tmp_path / 'run'), topics=['/n'])
    ahead = [0]
    recorder._clock_watch = ClockWatch(wall=lambda: time.time_ns() + ahead[0])
    ahead[0] = 3_600_000_000_000
    noted = 'Noted: the system clock was set forward by 3600.'
    bench.spin_until(lambda: any(each.startswith(noted) for each in said(log)), 'the step')


def test_a_type_of_another_release_is_named() -> None:
    with pytest.raises(MissingTypeError, match=r'^its type std_msgs/msg/Never is not in the pack'):
        _message_class('std_msgs/msg/Never')
    with pytest.raises(MissingTypeError, match=r'^the package of its type never/msg/Bool is not'):
        _message_class('never/msg/Bool')
