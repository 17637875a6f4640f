"""The summary at the end of a run, against what was put in."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.lathe.change_and_knock_sentences import BEGINNING, change_sentence
from lathe_chatter.model import Cut
from lathe_chatter.model.lathe_parameter_table import parameters_of
from lathe_chatter.recording import LatheRun, read_run
from lathe_chatter.recording.recording_statistics import FLAG_TYPE, RunLog
from lathe_chatter.recording.ros_messages import LOG_TYPE, log_bytes, message_bytes
from lathe_chatter.recording.run_summary import SUMMARY, closing_summary
from lathe_chatter.samples.codec import SAMPLES_TYPE, encode_block

TICK = 2_000_000


def summary_of(folder: Path) -> dict[str, Any]:
    (values,) = [note.values for note in read_run(folder).notes() if note.name == SUMMARY]
    return {name: json.loads(value) for name, value in values.items()}


def test_counts_samples_flags_and_the_linear_models_verdict_are_in_the_run(tmp_path: Path) -> None:
    lathe = VirtualLathe()
    with LatheRun(tmp_path / 'run', parameters_of(lathe)) as run:
        run.log(BEGINNING)
        for k in range(50):
            if k == 20:
                run.publish('/chatter_monitor/chatter', 'std_msgs/msg/Bool', data=True)
                deeper = lathe.cut.with_changes(depth_of_cut=0.001)
                run.log(change_sentence(lathe.time, lathe.cut, deeper))
                lathe.retune(deeper)
            run.write(lathe.advance(20))
    told = summary_of(tmp_path / 'run')
    assert told['messages'] == {
        '/chatter_monitor/chatter': 1, '/lathe/samples': 50, '/parameter_events': 1, '/rosout': 2,
    }  # fmt: skip
    samples = told['samples']['/lathe/samples']
    assert (samples['samples'], samples['first'], samples['last']) == (1000, 1e-4, 0.1)
    assert (samples['head'], samples['lost'], samples['complaint']) == (0, 0, '')
    assert told['chatter'] == [{'time': 0.04, 'topic': '/chatter_monitor/chatter', 'flag': True}]
    before, after = told['linear_model']['/lathe/samples']
    assert (before['time'], after['time']) == (0.0, 0.04)
    # The growth rates of the paper's runs, as its reproduction has them.
    assert before['open']['growth_rate'] == pytest.approx(-8.999066, abs=1e-6)
    assert before['seated']['growth_rate'] == pytest.approx(1.708234, abs=1e-6)
    assert after['open']['growth_rate'] == pytest.approx(13.652715, abs=1e-6)
    assert (before['open']['stable'], after['open']['stable']) == (True, False)


def test_a_lathe_is_silent_once_it_takes_much_longer_than_usual() -> None:
    lathe, log = VirtualLathe(), RunLog()
    silences: list[bool] = []
    # A block every three seconds, and a look every second; then no more.
    for second in range(20):
        if second % 3 == 0 and second < 12:
            block = encode_block(lathe.advance(20))
            log.receive('/lathe/samples', SAMPLES_TYPE, block, 0, (second + 1) * 10**9)
        received = log.samples['/lathe/samples']
        received.look(awaited=True)
        silences.append(received.silent)
    # How often they come is not known before the second; the last came at 9 s.
    assert silences == [False, True, True, *[False] * 13, *[True] * 4]
    received.look(awaited=False)
    assert not received.silent


def test_a_lathe_that_was_started_again_is_judged_by_its_own_parameters() -> None:
    run_log = RunLog()
    told = [(parameters_of(VirtualLathe()), 2), (parameters_of(VirtualLathe(cut=Cut(7000.0))), 12)]
    deeper = Cut(7000.0, 0.001)
    for at, sentence in (
        (1, BEGINNING),
        (11, BEGINNING),
        (13, change_sentence(0.5, Cut(7000.0), deeper)),
    ):
        data = log_bytes('lathe', sentence, at)
        run_log.receive('/rosout', LOG_TYPE, data, at, at)
    receive(run_log, VirtualLathe(), at=14)
    values = closing_summary(run_log, {'/lathe': told})
    verdicts = json.loads(values['linear_model'])['/lathe/samples']
    cuts = [(v['time'], v['spindle_speed_rpm'], v['depth_of_cut']) for v in verdicts]
    assert cuts == [(0.0, 3000.0, 0.0005), (0.0, 7000.0, 0.0005), (0.5, 7000.0, 0.001)]


def receive(run_log: RunLog, lathe: VirtualLathe, *, at: int) -> None:
    data = encode_block(lathe.advance(20))
    run_log.receive('/lathe/samples', SAMPLES_TYPE, data, at, at)


def test_what_is_missing_is_counted_by_the_times_of_the_samples() -> None:
    run_log, lathe = RunLog(), VirtualLathe()
    lathe.advance(140)
    for k in range(60):
        if k == 30:
            lathe.advance(60)
        receive(run_log, lathe, at=k * TICK)
    samples = run_log.samples['/lathe/samples']
    assert samples.head == 140
    assert (samples.continuity.lost, samples.continuity.gaps) == (60, 1)
    assert samples.silences == 0


def test_silence_is_noticed_where_blocks_come_often_and_not_where_they_never_did() -> None:
    run_log, lathe = RunLog(), VirtualLathe()
    for k in range(60):
        receive(run_log, lathe, at=k * TICK + (k >= 40) * 500_000_000)
    samples = run_log.samples['/lathe/samples']
    assert (samples.silences, samples.longest) == (1, pytest.approx(0.502))
    slow = RunLog()
    for k in range(60):
        receive(slow, lathe, at=k * 200_000_000)
    assert slow.samples['/lathe/samples'].silences == 0


def test_a_message_that_is_no_block_is_told_and_harms_nothing() -> None:
    run_log, lathe = RunLog(), VirtualLathe()
    receive(run_log, lathe, at=0)
    run_log.receive('/lathe/samples', SAMPLES_TYPE, b'\x00\x01\x00\x00nonsense', 1, 1)
    run_log.receive('/lathe/samples', SAMPLES_TYPE, encode_block(lathe.advance(20))[:-1], 2, 2)
    assert 'cut off' in run_log.samples['/lathe/samples'].complaint
    receive(run_log, lathe, at=3)
    assert run_log.samples['/lathe/samples'].continuity.samples == 40
    assert run_log.messages['/lathe/samples'] == 4


@pytest.mark.parametrize(('cell', 'expected'), [('left', 0.08), ('right', 0.02)])
def test_a_flag_has_the_time_of_the_lathe_beside_its_monitor(cell: str, expected: float) -> None:
    run_log, lathe = RunLog(), VirtualLathe()
    blocks = [encode_block(lathe.advance(20)) for _ in range(40)]
    for k in range(10):  # the other has cut for long
        run_log.receive('/left/lathe/samples', SAMPLES_TYPE, blocks[30 + k], k * TICK, k * TICK)
        run_log.receive('/right/lathe/samples', SAMPLES_TYPE, blocks[k], k * TICK, k * TICK)
    topic = f'/{cell}/chatter_monitor/chatter'
    raised = message_bytes(FLAG_TYPE, data=True)
    run_log.receive(topic, FLAG_TYPE, raised, 9 * TICK, 9 * TICK)
    ((time, _, _),) = run_log.flags
    assert time == pytest.approx(expected)
