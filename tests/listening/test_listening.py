"""The monitor over recordings of every form, and its score against labels."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import savemat, wavfile

from lathe_chatter.cli.main import main
from lathe_chatter.detection import Estimate
from lathe_chatter.detection.estimate import Mode
from lathe_chatter.errors import SignalFileError
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.listening import Judged, Signals, read_signals, score
from lathe_chatter.listening.detector_score import Label, labels_beyond, read_labels, score_of
from lathe_chatter.listening.picture import draw_judged
from lathe_chatter.model import Cut


@pytest.fixture(scope='module')
def sound() -> Any:
    """4 s of a stable cut and 3 s of chatter, 10 kHz: an acceleration of each body, mixed."""
    quiet = Cut(depth_of_cut=0.0005, bearing_contact='none', force_noise=5e-4)
    lathe = VirtualLathe(cut=quiet, accelerometers=True, seed=21)
    before = lathe.advance(40_000)
    lathe.retune(quiet.with_changes(depth_of_cut=0.0008))
    samples = np.vstack([before, lathe.advance(30_000)])
    mixed = samples[:, 8] + 0.6 * samples[:, 9]
    return mixed / abs(mixed).max()


def written(folder: Path, form: str, sound: Any) -> list[str]:
    """A file of that form, and what to call `listen` with."""
    time, path = np.arange(len(sound)) / 1e4, folder / f'shop.{form}'
    if form == 'wav':
        wavfile.write(path, 10_000, (32_000 * sound).astype(np.int16))
    elif form == 'csv':
        np.savetxt(
            path,
            np.column_stack([time, sound]),
            delimiter=',',
            header='time [s],sound',
            comments='',
        )
    elif form == 'mat':
        savemat(path, {'sound': sound})
        return [str(path), '--rate', '10 kHz']
    else:
        parquet = pytest.importorskip('pyarrow.parquet')
        table = pytest.importorskip('pyarrow').table({'time': time, 'sound': sound})
        parquet.write_table(table, path)
    return [str(path)]


@pytest.mark.parametrize('form', ['wav', 'csv', 'mat', 'parquet'])
def test_chatter_in_a_file_is_heard_and_scored(
    form: str, sound: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    labels, picture = tmp_path / 'labels.csv', tmp_path / 'heard.png'
    labels.write_text('start,end,state\n0,4,stable\n4.5,7,chatter\n')
    options = ['--labels', str(labels), '--output', str(picture), '--json']
    assert main(['listen', *written(tmp_path, form, sound), *options]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said['score']['found'] == said['score']['events'] == 1
    assert said['score']['false_alarms'] == 0
    assert said['score']['f1'] > 0.9
    flagged = next(state for state in said['states'] if state['chatter'])
    assert flagged['frequency'] == pytest.approx(134.0, abs=1.0)
    assert flagged['growth_rate'] is None
    assert picture.stat().st_size > 10_000


def test_a_score_counts_what_it_says() -> None:
    """By hand: flags 1-2 s (false) and 4.5-6 s of chatter from 4 to 6 s, in blocks of 0.1 s."""
    times = np.arange(1, 81) / 10
    flags = ((times > 1) & (times <= 2)) | ((times > 4.5) & (times <= 6))
    judged = Judged(
        tuple(Estimate(float(t), chatter=bool(f)) for t, f in zip(times, flags, strict=True))
    )
    found = score(judged, [Label(0, 4, 'stable'), Label(4, 6, 'chatter'), Label(6, 8, 'idle')])
    assert found.f1 == pytest.approx(2 * 15 / (25 + 20))
    assert (found.events, found.found, found.false_alarms) == (1, 1, 1)
    assert found.delay == pytest.approx(0.6)
    assert found.quiet_hours == pytest.approx(6 / 3600)


def test_a_flag_that_was_up_before_the_chatter_has_no_delay() -> None:
    times = np.arange(1, 81) / 10
    found = score_of(times, (times > 3.8) & (times <= 6), [Label(4, 6, 'chatter')])
    assert (found.found, found.delay) == (1, 0.0)


def test_a_rate_beside_other_times_is_refused(sound: Any, tmp_path: Path) -> None:
    (path,) = written(tmp_path, 'wav', sound)
    assert read_signals(path, rate=1e4).rate == pytest.approx(1e4)
    with pytest.raises(SignalFileError, match='10000 samples a second: a rate of 44100 Hz'):
        read_signals(path, rate=44_100.0)


def test_a_machine_file_that_lacks_a_body_is_warned_of(
    sound: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    machine = tmp_path / 'mine.yaml'
    machine.write_text('tool: {modes: [{frequency: 200 Hz, damping_ratio: 2 %, mass: 5 kg}]}')
    (path,) = written(tmp_path, 'wav', sound[:20_000])
    assert main(['listen', path, '--machine', str(machine)]) == 0
    assert 'WARNING  The machine file mine lacks a workpiece' in capsys.readouterr().out


@pytest.mark.parametrize(
    ('name', 'text', 'said'),
    [
        ('a.csv', 'time,sound\n0,x\n', 'cannot be read'),
        ('a.csv', 'sound\n1\n2\n3\n', 'no column time'),
        ('a.wav', 'RIFF', 'cannot be read'),
        ('a.txt', '', 'is none of'),
        ('none.mat', None, 'No such file'),
    ],
)
def test_what_cannot_be_listened_to_is_one_sentence(
    name: str, text: str | None, said: str, tmp_path: Path
) -> None:
    path = tmp_path / name
    if text is not None:
        path.write_text(text)
    with pytest.raises(SignalFileError, match=said):
        read_signals(path)


def test_a_picture_has_the_unit_of_its_signal(tmp_path: Path) -> None:
    samples = np.column_stack([np.arange(100) / 1e4, 1.5e-4 * np.sin(np.arange(100.0))])
    for listened, label in (('tool_displacement', 'tool displacement / µm'), ('sound', 'sound')):
        signals = Signals(('time', listened), samples)
        path = tmp_path / f'{listened}.svg'
        draw_judged(signals, listened, Judged((Estimate(0.01),)), [], path)
        assert f'>{label}</text>' in path.read_text(encoding='utf-8')


def test_a_picture_of_a_steady_frequency_has_plain_numbers(tmp_path: Path) -> None:
    signals = Signals(('time', 'sound'), np.column_stack([np.arange(100) / 1e4, np.ones(100)]))
    heard = (Estimate(k / 1e3, 'chatter', chatter=True, frequency=310 + k / 1e3) for k in range(9))
    path = tmp_path / 'steady.svg'
    draw_judged(signals, 'sound', Judged(tuple(heard)), [], path)
    labels = re.findall(r'<text[^>]*>([^<]*)</text>', path.read_text(encoding='utf-8'))
    assert '310.0' in labels
    assert not [label for label in labels if re.search(r'\de\d', label)]


def test_a_spell_has_the_settled_figures_not_the_first() -> None:
    first = Estimate(1.0, 'chatter', chatter=True, frequency=1001.8, growth_rate=20.9)
    later = [Estimate(1.0 + k / 50, 'chatter', frequency=207.0) for k in range(1, 9)]
    spells = Judged((Estimate(0.5, 'stable'), first, *later, Estimate(2.0, 'stable'))).spells()
    assert [(each.time, each.state) for each in spells] == [
        (0.5, 'stable'), (1.0, 'chatter'), (2.0, 'stable'),
    ]  # fmt: skip
    assert spells[1].frequency == 207.0
    assert np.isnan(spells[0].frequency)


def test_a_stable_cut_has_a_frequency_only_where_a_machine_tells_it() -> None:
    heard = Estimate(1.0, 'stable', frequency=311.0, growth_rate=-20.0)
    for mode, known in ((Mode.NO_MACHINE, False), (Mode.MIXTURE, False), (Mode.FULL, True)):
        (spell,) = Judged((replace(heard, mode=mode),)).spells()
        assert np.isfinite([spell.frequency, spell.growth_rate]).all() == known
        (flagged,) = Judged((replace(heard, mode=mode, state='chatter'),)).spells()
        assert flagged.frequency == 311.0


def test_a_tone_is_told_with_its_frequency_and_is_no_chatter_of_a_spindle_that_has_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """300 Hz amid noise, which is twice a turn at 9000 rev/min."""
    time = np.arange(60_000) / 1e4
    noise = np.random.default_rng(8).normal(0.0, 0.03, time.size)
    path, labels = tmp_path / 'tone.wav', tmp_path / 'labels.csv'
    signal = 0.5 * np.sin(2.0 * np.pi * 300.0 * time) + noise
    wavfile.write(path, 10_000, (32_000 * signal).astype(np.int16))
    labels.write_text('start,end,state\n0,4,stable\n')
    assert main(['listen', str(path), '--labels', str(labels)]) == 0
    said = ' '.join(capsys.readouterr().out.split())
    assert re.search(r'it stands at (299|300)\.\d Hz', said)
    assert 'A mode that the noise of cutting drives is such a line too' in said
    assert re.search('1 false alarm in (4|3.9.?) s without chatter', said)
    assert main(['listen', str(path), '--spindle-speed-rpm', '9000']) == 0
    said = capsys.readouterr().out
    assert 'it stands at' not in said
    assert '0.0% of the time' in said


@pytest.mark.parametrize(
    ('text', 'said'),
    [
        ('begin,end,state\n0,1,stable\n', 'row 1 is begin,end,state: .* the head start,end,state'),
        ('start,end,state\n', 'has no rows'),
        ('', 'has no rows'),
        (
            '0,5,stable\n6.5,9.5,chater\n',
            "row 2: the state 'chater' must be one of idle, stable, watch, chatter",
        ),
        (
            'start,end,state\n\n0,8,stable\n6.5,9.5,chatter\n',
            r'row 3 \(0,8,stable\) and row 4 \(6.5,9.5,chatter\) overlap',
        ),
    ],
)
def test_labels_that_would_score_what_is_not_meant_are_refused(
    text: str, said: str, tmp_path: Path
) -> None:
    path = tmp_path / 'labels.csv'
    path.write_text(text)
    with pytest.raises(SignalFileError, match=said):
        read_labels(path)


def test_labels_may_touch_repeat_and_begin_with_a_capital(tmp_path: Path) -> None:
    path = tmp_path / 'labels.csv'
    path.write_text('0,5,Stable\n4,6,stable\n6,9,Chatter\n')
    assert [label.state for label in read_labels(path)] == ['stable', 'stable', 'chatter']


def test_a_label_of_another_recording_is_refused_and_a_longer_one_is_said(
    sound: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of 7 s."""
    labels, call = tmp_path / 'labels.csv', ['listen', *written(tmp_path, 'wav', sound)]
    labels.write_text('0,4,stable\n40,50,chatter\n')
    assert main([*call, '--labels', str(labels)]) == 2
    said = 'The label 40,50,chatter must lie in the recording, which lasts from 0 to 7 s.'
    assert said in capsys.readouterr().err
    labels.write_text('0,4,stable\n4.5,30,chatter\n')
    assert main([*call, '--labels', str(labels)]) == 0
    said = capsys.readouterr().out
    assert 'WARNING  The label 4.5,30,chatter reaches beyond the recording, which lasts' in said
    signals = read_signals(written(tmp_path, 'wav', sound)[0])
    assert labels_beyond([Label(4.5, 7.0001, 'chatter')], signals) == []


def test_what_is_labelled_unknown_does_not_count() -> None:
    times = np.arange(1, 81) / 10
    found = score_of(times, times > 3, [Label(4, 8, 'chatter'), Label(0, 4, 'unknown')])
    assert (found.f1, found.false_alarms, found.quiet_hours) == (1.0, 0, 0.0)


def test_labels_that_are_none_name_their_row(tmp_path: Path) -> None:
    path = tmp_path / 'labels.csv'
    path.write_text('start,end,state\n0,1,stable\n\n2,1,chatter\n')
    with pytest.raises(SignalFileError, match='row 4'):
        read_labels(path)
