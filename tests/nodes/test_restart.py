"""Each of the three nodes killed and started again: the others go on, and it says what it missed.

All are processes, and a kill is that of `kill -9`: nothing of them can say goodbye.
"""

from __future__ import annotations

import json
import re
import signal
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from std_msgs.msg import Bool, String
from support.node_bench import LATCHED, Bench
from support.node_processes import NodeProcesses, Reports, Samples, contiguous

from lathe_chatter.recording import read_run, resimulate, verify
from lathe_chatter.recording.provenance import PARAMETERS, parameter_history
from lathe_chatter.recording.run_summary import SUMMARY

CHATTER = ('depth_of_cut:=0.001', 'bearing_contact:=none')
HEARD = '/chatter_monitor: samples'
RECORDED = '/run_recorder: recording'
LISTENING = re.compile(r'Listening from ([\d.]+) s on\.')


class Cell:
    """A lathe, its monitor and its recorder, all at work, and somebody who listens to them."""

    def __init__(self, bench: Bench, nodes: NodeProcesses) -> None:
        self.nodes = nodes
        self.wait = bench.spin_until
        self.reports = Reports(bench)
        self.samples = Samples(bench)
        self.states: list[Any] = bench.listen_first(String, '/chatter_monitor/state', LATCHED)
        self.flags: list[Any] = bench.listen_first(Bool, '/chatter_monitor/chatter', LATCHED)

    def start(self, *parameters: str) -> None:
        """Start all three; returns when all work."""
        self.nodes.start('lathe', *parameters)
        self.nodes.start('chatter_monitor')
        self.nodes.start('run_recorder')
        self.wait(lambda: len(self.samples) > 100, 'samples')
        self.wait_for_a_state(0)
        self.wait_for_records(0)

    def wait_for_a_state(self, since: int) -> None:
        """Until the monitor has said what it thinks of the cut."""
        self.wait(lambda: any(s.data != 'unknown' for s in self.states[since:]), 'a known state')

    def wait_for_records(self, since: int) -> None:
        """Until the recorder has said that it has more samples than it said before."""

        def grew() -> bool:
            statuses = self.reports.statuses(RECORDED, since)
            counts = {v.value for s in statuses for v in s.values if v.key.endswith(': samples')}
            return len(counts - {'0'}) > 1

        self.wait(grew, 'samples in the record')

    def wait_for_samples(self, blocks: int = 500) -> None:
        """Until so many more blocks have come."""
        target = len(self.samples) + blocks
        self.wait(lambda: len(self.samples) >= target, 'more samples')

    def run(self) -> Path:
        """The newest run; its recorder names it by date and time."""
        return max((self.nodes.folder / 'runs').iterdir())


@pytest.fixture
def cell(bench: Bench, nodes: NodeProcesses) -> Cell:
    return Cell(bench, nodes)


def test_a_killed_lathe_is_missed_and_the_next_one_followed(cell: Cell) -> None:
    cell.start()
    reports = cell.reports

    def lives() -> list[Any]:
        """The lathes of whose parameters the run knows."""
        return [*parameter_history(noted(cell.run(), f'{PARAMETERS}/lathe'))]

    cell.wait(lives, 'the parameters')
    cell.wait_for_samples(1000)  # a monitor that has just loaded its loops stood still for that
    since, known = reports.count(), len(cell.states)
    cell.nodes.kill('/lathe')
    cell.wait(lambda: cell.states[-1].data == 'unknown', 'silence noticed')
    cell.wait(
        lambda: 'no samples come' in [s.message for s in reports.statuses(HEARD, since)],
        'the diagnostic of the silence',
    )
    cell.wait(lambda: len(reports.statuses(RECORDED, since)) > 2, 'the recorder')
    end = cell.samples.ends[-1]
    silence = f'At {end:.6f} s: no samples come any more.'
    cell.wait(lambda: silence in reports.sentences('chatter_monitor'), 'the sentence')

    cell.nodes.start('lathe', 'spindle_speed_rpm:=6000')
    known = len(cell.states)
    cell.wait_for_a_state(known)
    cell.wait(lambda: reports.value(HEARD, 'restarts of the lathe') == '1', 'the count')
    cell.wait(
        lambda: reports.value(RECORDED, '/lathe/samples: restarts of the lathe') == '1',
        'the count of the recorder',
    )
    cell.wait(lambda: starts(reports), 'the sentence')
    (told,) = starts(reports)
    again = re.fullmatch(
        r'At ([\d.]+) s: the lathe started again, and I with it from ([\d.]+) s on\.', told
    )
    assert again, told
    assert float(again[1]) == pytest.approx(end, abs=1e-6)
    assert float(again[2]) < end

    cell.wait(lambda: len(lives()) == 2, 'the parameters of the next one')
    restarted = 'after the lathe started again'  # said up to 10 s later
    cell.wait(lambda: any(restarted in s for s in reports.sentences('run_recorder')), 'that')
    cell.nodes.interrupt('/run_recorder')
    run = read_run(cell.run())
    first, second = np.split(times := recorded(run), np.flatnonzero(np.diff(times) < 0.0) + 1)
    assert contiguous(first)
    assert first[-1] >= end - 1e-9
    assert contiguous(second)
    counted = json.loads(noted(cell.run(), SUMMARY)['samples'])
    assert counted['/lathe/samples']['restarts'] == 1
    found = [finding.text for finding in verify(cell.run()).findings]
    assert any('simulated time goes back' in text for text in found), found
    (computed,) = resimulate(run)
    assert computed.proven, computed.obstacle
    assert computed.compared == times.size
    told = json.loads(noted(cell.run(), SUMMARY)['linear_model'])['/lathe/samples']
    assert [cut['spindle_speed_rpm'] for cut in told] == [3000.0, 6000.0]
    since = f'from {second[0]:.6f} s on, after the lathe started again at {first[-1]:.6f} s'
    assert any(f'/lathe/samples is recorded {since}' in sentence for sentence in logged(run))


def test_a_killed_monitor_comes_back_and_says_from_when_it_listens(cell: Cell) -> None:
    cell.start(*CHATTER)
    reports = cell.reports
    cell.wait(lambda: cell.flags and cell.flags[-1].data, 'the flag')
    cell.nodes.kill('/chatter_monitor')
    since, end = reports.count(), cell.samples.ends[-1]
    states, flags = len(cell.states), len(cell.flags)
    cell.wait_for_samples()
    cell.wait_for_records(since)
    (samples,) = cell.samples.runs()
    assert contiguous(samples)

    cell.nodes.start('chatter_monitor')
    cell.wait_for_a_state(states)
    cell.wait(lambda: any(flag.data for flag in cell.flags[flags:]), 'the flag again')
    cell.wait(lambda: len(listening(reports)) == 2, 'from when it listens')
    told = float(listening(reports)[1])
    assert told > end
    key = 'listening from, s'
    cell.wait(lambda: reports.value(HEARD, key, since) == f'{told:.6f}', 'the diagnostic')


def test_a_killed_recorder_leaves_a_run_and_the_next_says_what_it_missed(cell: Cell) -> None:
    cell.start()
    cell.nodes.kill('/run_recorder')
    killed = cell.run()
    before = recorded(read_run(killed))
    assert contiguous(before)
    losses = [finding.text for finding in verify(killed).findings if finding.loss]
    assert losses[-1].startswith('The recorder did not finish')
    # More than the 4 s that the lathe keeps for late readers.
    cell.wait(lambda: cell.samples.ends[-1] > before[-1] + 5.0, 'later samples')
    (samples,) = cell.samples.runs()
    assert contiguous(samples)

    cell.nodes.start('run_recorder')
    since = cell.reports.count()
    cell.wait_for_records(since)
    assert cell.reports.value(RECORDED, '/lathe/samples: samples before the first', since) != '0'
    cell.nodes.interrupt('/run_recorder')
    assert cell.run() != killed
    run = read_run(cell.run())
    after = recorded(run)
    assert after[0] > before[-1]
    missed = round(after[0] * 1e4) - 1
    counted = json.loads(noted(cell.run(), SUMMARY)['samples'])
    heard = counted['/lathe/samples']
    assert (heard['head'], heard['samples']) == (missed, after.size)
    # Of what the lathe keeps some may be gone before it is sent: that is counted too.
    assert after.size + heard['lost'] == round((after[-1] - after[0]) * 1e4) + 1
    assert heard['lost'] < 20 * 2000
    since = f'from {after[0]:.6f} s on, without the {missed} samples before'
    sentence = f'/lathe/samples is recorded {since}.'
    cell.wait(lambda: sentence in cell.reports.sentences('run_recorder'), sentence)
    assert sentence in logged(run)
    found = [finding.text for finding in verify(cell.run()).findings]
    assert any(f'{missed} samples late' in text for text in found), found


def starts(reports: Reports) -> list[str]:
    """The sentences of the monitor about a lathe that started again."""
    said = reports.sentences('chatter_monitor')
    return [sentence for sentence in said if 'the lathe started again' in sentence]


def listening(reports: Reports) -> list[str]:
    """From when the monitor said that it listens, s."""
    found = map(LISTENING.fullmatch, reports.sentences('chatter_monitor'))
    return [match[1] for match in found if match]


def noted(run: Path, name: str) -> dict[str, str]:
    """The latest note of a name in a run, which opens also while it is being recorded."""
    return {note.name: note.values for note in read_run(run).notes()}.get(name, {})


def recorded(run: Any) -> Any:
    """The times of all samples in a run, s."""
    return run.samples(columns=['time']).columns['time']


def logged(run: Any) -> list[str]:
    """What the recorder said, as it is in the run."""
    heard = run.messages('/rosout')
    return [each.message.msg for each in heard if each.message.name == 'run_recorder']


def test_samples_lost_soon_after_a_kill_are_no_other_run(cell: Cell) -> None:
    """The graph keeps the publisher of a killed lathe for 20 s: it is no second one."""
    cell.start(*CHATTER)
    reports = cell.reports
    cell.wait(lambda: cell.flags and cell.flags[-1].data, 'the flag')
    cell.nodes.kill('/lathe')
    cell.nodes.start('lathe', *CHATTER)
    cell.wait(lambda: reports.value(HEARD, 'restarts of the lathe') == '1', 'the next lathe')
    cell.wait(lambda: cell.flags[-1].data, 'its flag')
    flags = len(cell.flags)
    cell.nodes.signal('/chatter_monitor', signal.SIGSTOP)
    cell.wait_for_samples(blocks=4000)  # twice of what a lathe keeps for its readers
    cell.nodes.signal('/chatter_monitor', signal.SIGCONT)
    cell.wait(lambda: reports.value(HEARD, 'gaps') == '1', 'the gap')
    assert reports.value(HEARD, 'restarts of the lathe') == '1'
    assert all(flag.data for flag in cell.flags[flags:])


def test_a_monitor_that_stood_still_does_not_call_the_lathe_silent(cell: Cell) -> None:
    """DDS may need seconds to deliver to it again; nothing came, and that is for itself."""
    cell.start(*CHATTER)
    cell.wait(lambda: cell.states and cell.states[-1].data == 'chatter', 'chatter')
    cell.nodes.signal('/chatter_monitor', signal.SIGSTOP)
    cell.wait_for_samples(blocks=1000)
    cell.nodes.kill('/lathe')
    cell.nodes.signal('/chatter_monitor', signal.SIGCONT)
    here = 'this node stood still, and does not hear the samples yet'
    said = partial(cell.reports.sentences, 'chatter_monitor')
    cell.wait(lambda: any(here in sentence for sentence in said()), 'the sentence')
    cell.wait(lambda: cell.states[-1].data == 'unknown', 'the state')
    assert not any('no samples come' in sentence for sentence in said())
    heard = partial(cell.reports.statuses, HEARD, 0)
    cell.wait(lambda: heard()[-1].message == here, 'the diagnostics')
