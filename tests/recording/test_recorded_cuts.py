"""The lathes of a run, by simulated time, whatever the clock and the processes did."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer as McapWriter

from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.lathe.change_and_knock_sentences import (
    BEGINNING,
    BEGINNING_AGAIN,
    change_sentence,
    knock_sentence,
)
from lathe_chatter.model import Cut
from lathe_chatter.model.lathe_parameter_table import parameters_of
from lathe_chatter.recording import LatheRun, RunWriter, read_run, resimulate, verify
from lathe_chatter.recording.clock_steps import CLOCK, ClockWatch
from lathe_chatter.recording.cut_log import CutLog
from lathe_chatter.recording.provenance import (
    IDENTITY,
    PARAMETERS,
    PUBLISHERS,
    identity,
    parameter_values,
)
from lathe_chatter.recording.recorded_cuts import RecordedCuts, recorded_cuts
from lathe_chatter.recording.resimulate import finding_of
from lathe_chatter.recording.ros_messages import (
    LOG_TYPE,
    PARAMETER_EVENT_TYPE,
    log_bytes,
    message_bytes,
    parameters_bytes,
    topic_of_type,
)
from lathe_chatter.report.run_history import in_words, read_history
from lathe_chatter.samples.codec import SAMPLES_TYPE, encode_block

TICK = 20
PERIOD = 2_000_000
"""ns between two blocks: real time."""
PER_COMMIT = 50
START = 1_700_000_000_000_000_000
FLAG = '/chatter_monitor/chatter'


class Record:
    """A recorder whose clock is in the hands of the test, in ns."""

    def __init__(self, folder: Path, *, of_ours: bool = True) -> None:
        self.writer = RunWriter(folder)
        self.now = START
        self.step = 0
        self.answers: list[tuple[dict[str, object], int]] = []
        for name, kind in (
            ('/lathe/samples', SAMPLES_TYPE), ('/rosout', LOG_TYPE),
            ('/parameter_events', PARAMETER_EVENT_TYPE), (FLAG, 'std_msgs/msg/Bool'),
        ):  # fmt: skip
            self.writer.add_topic(topic_of_type(name, kind))
        if of_ours:
            self.writer.note(IDENTITY, identity())

    @property
    def stamp(self) -> int:
        """What the system's clock shows."""
        return self.now + self.step

    def add(self, topic: str, data: bytes, published: int | None = None) -> None:
        self.writer.write(
            topic,
            data,
            log_time=self.stamp,
            publish_time=self.stamp if published is None else published,
        )

    def log(self, sentence: str, published: int | None = None) -> None:
        self.add('/rosout', log_bytes('lathe', sentence, self.stamp), published)
        self.now += 1000

    def start(self, lathe: VirtualLathe, *, asked: bool = False) -> VirtualLathe:
        """A lathe is started: it declares its parameters and says that it begins."""
        values = parameters_of(lathe)
        self.add('/parameter_events', parameters_bytes('/lathe', values, self.stamp))
        self.now += 1000
        self.log(BEGINNING)
        if asked:
            self.ask(values)
        return lathe

    def ask(self, values: dict[str, object]) -> None:
        """Note the parameters as the lathe answers now."""
        self.answers.append((dict(values), self.stamp))
        self.writer.note(f'{PARAMETERS}/lathe', parameter_values(self.answers))

    def flag(self, up: bool) -> None:
        self.add(FLAG, message_bytes('std_msgs/msg/Bool', data=up))

    def cut(self, lathe: VirtualLathe, ticks: int, *, keep: bool = True) -> None:
        for tick in range(1, ticks + 1):
            samples = lathe.advance(TICK)
            self.now += PERIOD
            if keep:
                self.add('/lathe/samples', encode_block(samples))
            if tick % PER_COMMIT == 0:
                self.writer.commit_soon()

    def change(self, lathe: VirtualLathe, *, logged: bool = True, **values: float) -> None:
        cut = lathe.cut.with_changes(**values)
        if logged:
            self.log(change_sentence(lathe.time, lathe.cut, cut))
        lathe.retune(cut)


def cuts_of(folder: Path) -> RecordedCuts:
    return recorded_cuts(read_run(folder), '/lathe')


def said(folder: Path) -> tuple[str, bool, bool]:
    """What comes of computing a run again: the finding, whether it is a loss, and unproven."""
    (found,) = resimulate(read_run(folder))
    finding = finding_of(found)
    return finding.text, finding.loss, finding.unproven


@pytest.mark.parametrize('step', [-2.0, -0.05, 2.0, 3600.0, -86400.0])
@pytest.mark.parametrize('noted', [True, False])
def test_a_step_of_the_clock_moves_nothing_and_is_told(
    step: float, noted: bool, tmp_path: Path
) -> None:
    record = Record(tmp_path / 'run')
    watch = ClockWatch(lambda: record.stamp, lambda: record.now)
    lathe = record.start(VirtualLathe(), asked=True)
    record.cut(lathe, 500)
    record.change(lathe, depth_of_cut=0.0008)
    record.cut(lathe, 100)
    watch.look()
    record.step = round(step * 1e9)
    seen = watch.look()
    assert seen is not None
    assert seen.seconds == pytest.approx(step)
    record.cut(lathe, 50)
    record.flag(up=True)
    record.cut(lathe, 400)
    record.flag(up=False)
    record.change(lathe, depth_of_cut=0.0005)
    record.cut(lathe, 50)
    if noted:
        record.writer.note(CLOCK, watch.values())
    record.writer.close()
    history = read_history(tmp_path / 'run')
    assert [round(flag.time, 3) for flag in history.flags] == [1.3, 2.1]
    assert [change.time for change in history.changes] == [1.0, 2.1]
    assert history.duration == pytest.approx(2.2)
    # To look at a moment closely, no more than the chunks about it are read, by their stamps.
    spans = [(0.5, 0.52), (1.15, 1.25), (2.19, 2.3)]
    for (begin, end), excerpt in zip(spans, history.samples.between(spans), strict=True):
        wanted = np.arange(round(begin * 1e4) + 1, min(round(end * 1e4), 22_000) + 1)
        assert np.rint(1e4 * excerpt['time']).tolist() == wanted.tolist()
    (steps,) = [cuts_of(tmp_path / 'run').timeline.steps]
    if noted or step < 0.0:
        ((time, seconds),) = steps
        assert time == pytest.approx(1.2, abs=0.01)
        assert seconds == pytest.approx(step, abs=0.003)
        way = 'forward' if step > 0 else 'back'
        assert f'the system clock was set {way} by {abs(step):.3f} s' in history.remarks[0]
    text, loss, unproven = said(tmp_path / 'run')
    assert f'all {1100 * TICK} samples were computed again' in text
    assert not loss
    assert not unproven


def test_a_step_of_the_clock_about_a_restart(tmp_path: Path) -> None:
    """Later by the clock is not later: the second lathe is dated before the first one began."""
    record = Record(tmp_path / 'run')
    lathe = record.start(VirtualLathe(), asked=True)
    record.cut(lathe, 300)
    record.step = -5_000_000_000
    lathe = record.start(VirtualLathe(cut=Cut(3000.0, 0.0006)))
    record.cut(lathe, 200)
    record.change(lathe, depth_of_cut=0.0007)
    record.cut(lathe, 100)
    record.writer.close()
    history = read_history(tmp_path / 'run')
    assert [s.start.depth_of_cut for s in history.sessions] == [0.0005, 0.0006]
    assert history.sessions[1].time == pytest.approx(0.6)
    assert history.cut_at(0.3).depth_of_cut == 0.0005
    assert history.cut_at(0.7).depth_of_cut == 0.0006
    assert history.cut_at(1.1).depth_of_cut == 0.0007
    assert said(tmp_path / 'run')[1:] == (False, False)


def test_a_lathe_that_died_before_its_first_sample_is_not_the_one_that_cut(tmp_path: Path) -> None:
    record = Record(tmp_path / 'run')
    record.start(VirtualLathe())
    record.now += 10**9
    lathe = record.start(VirtualLathe(cut=Cut(depth_of_cut=0.0006)))
    record.cut(lathe, 100)
    record.ask(parameters_of(lathe))
    record.writer.close()
    history = read_history(tmp_path / 'run')
    assert [s.start.depth_of_cut for s in history.sessions] == [0.0006]
    assert history.remarks == ['Once the lathe began, and no sample of it is in the record.']
    text, loss, unproven = said(tmp_path / 'run')
    assert (loss, unproven) == (False, False), text


@pytest.mark.parametrize('logged', [True, False])
def test_a_lathe_that_was_killed_and_started_again_has_two_sessions(
    logged: bool, tmp_path: Path
) -> None:
    record = Record(tmp_path / 'run')
    lathe = record.start(VirtualLathe(), asked=True)
    record.cut(lathe, 150)
    record.now += 3 * 10**9
    second = VirtualLathe(cut=Cut(4000.0, 0.0006))
    if logged:
        record.start(second)
    record.cut(second, 50)
    record.ask(parameters_of(second))
    record.flag(up=True)
    record.cut(second, 50)
    record.writer.close()
    history = read_history(tmp_path / 'run')
    assert [s.start.depth_of_cut for s in history.sessions] == [0.0005, 0.0006]
    assert history.sessions[1].why.startswith('the lathe was' if logged else 'simulated time went')
    assert [round(flag.time, 3) for flag in history.flags] == [0.4]
    # Times go on from session to session, and no line joins them.
    assert not history.samples.restarts
    assert not history.samples.gaps
    assert history.samples.count == 250 * TICK
    assert history.duration == pytest.approx(0.5)
    text, loss, unproven = said(tmp_path / 'run')
    assert (loss, unproven) == (False, False) if logged else not loss, text


def test_what_happened_at_one_and_the_same_time_is_told_as_it_happened(tmp_path: Path) -> None:
    """A knock, a reset, another knock, with no sample in between."""
    record = Record(tmp_path / 'run')
    lathe = record.start(VirtualLathe(), asked=True)
    record.cut(lathe, 100)
    record.log(knock_sentence(lathe.time, 0.001))
    lathe.knock(0.001)
    record.log(BEGINNING_AGAIN)
    lathe = VirtualLathe()
    record.log(knock_sentence(0.0, 0.002))
    lathe.knock(0.002)
    record.cut(lathe, 100)
    record.writer.close()
    found = [in_words(event) for event in read_history(tmp_path / 'run').in_order()]
    assert found == ['knock, 1 mN s', 'the lathe was reset', 'knock, 2 mN s']
    assert said(tmp_path / 'run')[1:] == (False, False)


def test_resets_keep_the_cut_that_was_there(tmp_path: Path) -> None:
    record = Record(tmp_path / 'run')
    lathe = record.start(VirtualLathe(cut=Cut(force_noise=1e-3), seed=5), asked=True)
    record.cut(lathe, 100)
    record.change(lathe, depth_of_cut=0.0007)
    record.cut(lathe, 100)
    record.log(BEGINNING_AGAIN)
    lathe = VirtualLathe(cut=lathe.cut, seed=5)
    record.cut(lathe, 100)
    record.change(lathe, depth_of_cut=0.0004)
    record.cut(lathe, 100)
    record.writer.close()
    history = read_history(tmp_path / 'run')
    assert [(round(s.time, 3), s.start.depth_of_cut, s.why) for s in history.sessions] == [
        (0.0, 0.0005, ''),
        (0.4, 0.0007, 'the lathe was reset'),
    ]
    assert [round(change.time, 6) for change in history.changes] == [0.2, 0.6]
    assert said(tmp_path / 'run')[1:] == (False, False)


def test_a_record_from_well_after_a_change_is_not_called_wrong(tmp_path: Path) -> None:
    record = Record(tmp_path / 'run')
    lathe = VirtualLathe()
    record.cut(lathe, 500, keep=False)
    record.change(lathe, logged=False, depth_of_cut=0.0008)
    record.cut(lathe, 500, keep=False)
    record.cut(lathe, 100)
    record.ask(parameters_of(lathe))
    record.change(lathe, depth_of_cut=0.0009)
    record.cut(lathe, 100)
    record.writer.close()
    history = read_history(tmp_path / 'run')
    assert history.cut_at(2.1).depth_of_cut == 0.0008
    assert history.begin == pytest.approx(2.0001)
    text, loss, unproven = said(tmp_path / 'run')
    assert (loss, unproven) == (False, True)
    assert 'That proves nothing, because: The record does not begin with the cut' in text


def test_samples_that_are_missing_are_no_line(tmp_path: Path) -> None:
    record = Record(tmp_path / 'run')
    lathe = record.start(VirtualLathe(), asked=True)
    record.cut(lathe, 100)
    record.cut(lathe, 50, keep=False)
    record.cut(lathe, 100)
    record.writer.close()
    history = read_history(tmp_path / 'run')
    ((before, after),) = history.samples.gaps
    assert (before, after) == (pytest.approx(0.2), pytest.approx(0.3001))
    assert history.samples.count == 200 * TICK
    assert said(tmp_path / 'run')[1:] == (False, False)


Forge = Callable[[dict[str, object]], dict[str, object]]


@pytest.mark.parametrize('forged', ['note', 'event'])
def test_what_was_noted_and_what_was_announced_bear_witness_against_each_other(
    forged: str, tmp_path: Path
) -> None:
    record = Record(tmp_path / 'run')
    lathe = VirtualLathe()
    values = parameters_of(lathe)
    wrong = {**values, 'depth_of_cut': 0.0007}
    event = parameters_bytes('/lathe', wrong if forged == 'event' else values, START)
    record.add('/parameter_events', event)
    record.now += 1000
    record.log(BEGINNING)
    record.ask(wrong if forged == 'note' else values)
    record.cut(lathe, 100)
    record.writer.close()
    text, loss, unproven = said(tmp_path / 'run')
    assert loss
    assert not unproven
    assert 'The parameters that were noted have depth_of_cut 0.000' in text
    assert '0.0005' in text
    assert '0.0007' in text
    truth = 'announced' if forged == 'note' else 'noted'
    assert f'The samples follow from what was {truth}; the other is not true.' in text


def test_a_value_that_no_log_says_is_no_contradiction(tmp_path: Path) -> None:
    """The pace of a lathe may be set at any time, and nothing logs it."""
    record = Record(tmp_path / 'run')
    lathe = VirtualLathe()
    values = {**parameters_of(lathe), 'real_time_factor': 1.0}
    record.add('/parameter_events', parameters_bytes('/lathe', values, START))
    record.now += 1000
    record.log(BEGINNING)
    record.ask({**values, 'real_time_factor': 2.0})
    record.cut(lathe, 50)
    record.writer.close()
    assert said(tmp_path / 'run')[1:] == (False, False)


def test_two_lathes_of_one_name_at_once_accuse_nobody(tmp_path: Path) -> None:
    record = Record(tmp_path / 'run')
    lathes = [record.start(VirtualLathe(cut=Cut(depth_of_cut=d))) for d in (0.0005, 0.0006)]
    for _ in range(20):
        for lathe in lathes:
            record.cut(lathe, 1)
    record.writer.note(PUBLISHERS, {'/lathe/samples': '2'})
    record.writer.close()
    text, loss, unproven = said(tmp_path / 'run')
    assert (loss, unproven) == (False, True), text
    assert 'altered' not in text


def test_a_late_reader_gets_the_log_from_before_a_step_of_the_clock(tmp_path: Path) -> None:
    """What a publisher keeps for late readers is older than the samples about it."""
    record = Record(tmp_path / 'run')
    lathe = VirtualLathe()
    values = parameters_of(lathe)
    began = record.stamp
    record.add('/parameter_events', parameters_bytes('/lathe', values, began), began)
    record.cut(lathe, 100)
    record.step = -1_000_000_000
    record.cut(lathe, 50)
    record.log(BEGINNING, published=began + 1000)
    record.cut(lathe, 50)
    record.ask(values)
    record.writer.close()
    assert len(cuts_of(tmp_path / 'run').log.sessions) == 1
    assert said(tmp_path / 'run')[1:] == (False, False)


def test_a_run_that_was_stopped_says_so(tmp_path: Path) -> None:
    def stopped_by(error: BaseException, folder: Path) -> None:
        with LatheRun(folder, parameters_of(lathe), simulated=True) as run:
            run.log(BEGINNING)
            run.write(lathe.advance(100))
            raise error

    lathe = VirtualLathe()
    with pytest.raises(ValueError, match='what'):
        stopped_by(ValueError('what'), tmp_path / 'failed')
    with pytest.raises(KeyboardInterrupt):
        stopped_by(KeyboardInterrupt(), tmp_path / 'interrupted')
    said = {name: verify(tmp_path / name) for name in ('failed', 'interrupted')}
    assert not any(found.complete for found in said.values())
    assert [found.findings[-1].text for found in said.values()] == [
        'The run ended early. It failed: what',
        'The run ended early. It was interrupted.',
    ]


def test_the_last_samples_before_a_step_are_found_where_a_file_ends_there(tmp_path: Path) -> None:
    record = Record(tmp_path / 'run')
    lathe = record.start(VirtualLathe(), asked=True)
    record.cut(lathe, 200)
    record.writer.split()
    record.step = -2_000_000_000
    record.cut(lathe, 200)
    record.writer.close()
    (excerpt,) = read_history(tmp_path / 'run').samples.between([(0.3985, 0.4)])
    assert np.rint(1e4 * excerpt['time']).tolist() == [*range(3986, 4001)]


def test_a_lathe_that_is_started_anew_soon_after_the_record_began_is_another(
    tmp_path: Path,
) -> None:
    record = Record(tmp_path / 'run')
    record.cut(VirtualLathe(cut=Cut(depth_of_cut=0.0004)), 100)
    record.cut(record.start(VirtualLathe(cut=Cut(depth_of_cut=0.0006))), 100)
    record.writer.close()
    first, second = cuts_of(tmp_path / 'run').sampled
    assert (first.beginning, second.beginning) == ('', BEGINNING)
    assert not first.parameters
    assert second.parameters['depth_of_cut'] == 0.0006


def test_a_file_without_those_before_it_may_have_another_cut_than_that_of_the_start(
    tmp_path: Path,
) -> None:
    record = Record(tmp_path / 'run')
    lathe = record.start(VirtualLathe(), asked=True)
    record.change(lathe, depth_of_cut=0.0007)
    record.cut(lathe, 1000)
    record.writer.split()
    record.cut(lathe, 100)
    record.writer.close()
    assert not read_history(tmp_path / 'run').remarks
    (said,) = read_history(tmp_path / 'run' / 'run_1.mcap').remarks
    assert 'are of 2.002 s before the first sample: whether the cut was changed' in said


def test_what_was_said_goes_with_the_samples_where_a_writer_mixed_up_chunks(
    tmp_path: Path,
) -> None:
    record = Record(tmp_path / 'run')
    lathe = record.start(VirtualLathe(), asked=True)
    record.cut(lathe, 300)
    record.change(lathe, depth_of_cut=0.0007)
    record.cut(lathe, 300)
    record.flag(up=True)
    record.cut(lathe, 100)
    record.writer.close()
    with (tmp_path / 'run' / 'run_0.mcap').open('rb') as source:
        reader = make_reader(source)
        messages = [*reader.iter_messages(log_time_order=False)]
        notes = [note for note in reader.iter_metadata() if note.name.startswith('lathe_chatter')]
    file = tmp_path / 'mixed.mcap'
    with file.open('wb') as stream:
        writer = McapWriter(stream, chunk_size=50_000)
        writer.start('ros2', 'another')
        numbers: dict[int, int] = {}
        for schema, channel, message in reversed(messages):
            if channel.id not in numbers:
                number = writer.register_schema(schema.name, schema.encoding, schema.data)
                numbers[channel.id] = writer.register_channel(channel.topic, 'cdr', number)
            stamps = message.log_time, message.data, message.publish_time
            writer.add_message(numbers[channel.id], *stamps)
        for note in notes:
            writer.add_metadata(note.name, note.metadata)
        writer.finish()
    history = read_history(file)
    assert [(change.time, change.new) for change in history.changes] == [
        (0.6, {'depth_of_cut': 0.0007})
    ]
    assert [round(flag.time, 3) for flag in history.flags] == [1.2]
    text, loss, unproven = said(file)
    assert f'all {700 * TICK} samples were computed again' in text
    assert (loss, unproven) == (False, False)


@pytest.mark.parametrize('noted', [True, False])
def test_verify_tells_of_a_clock_that_was_set_back_once(noted: bool, tmp_path: Path) -> None:
    record = Record(tmp_path / 'run')
    watch = ClockWatch(lambda: record.stamp, lambda: record.now)
    lathe = record.start(VirtualLathe(), asked=True)
    record.cut(lathe, 100)
    watch.look()
    record.step = -2_000_000_000
    watch.look()
    record.cut(lathe, 100)
    if noted:
        record.writer.note(CLOCK, watch.values())
    record.writer.close()
    told = [each.text for each in verify(tmp_path / 'run').findings if 'clock' in each.text]
    assert len(told) == 1
    assert 'the system clock was set back by 2.000 s' in told[0]


def test_a_parameter_that_is_no_number_and_was_noted_by_nobody_is_no_contradiction() -> None:
    """Anybody may announce one in the name of a lathe."""
    log = CutLog()
    log.assign_parameters([({'depth_of_cut': 1e-3}, 2)], [({'feed_speed': float('nan')}, 1)])
    assert log.contradictions == []
