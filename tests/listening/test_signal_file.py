"""Recordings as others leave them: whole, cut off, or damaged anywhere."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat, wavfile
from support.two_lathes import record_two_lathes

from lathe_chatter.errors import ParameterError, RunReadError, SignalFileError
from lathe_chatter.listening import read_signals
from lathe_chatter.listening.detector_score import read_labels

SIGNAL = np.sin(np.arange(4000) / 7.0)
RATE = 8000


def write_wav(file: Path) -> None:
    wavfile.write(file, RATE, (20_000 * SIGNAL).astype(np.int16))


def write_mat(file: Path) -> None:
    savemat(file, {'time': np.arange(4000) / RATE, 'sound': SIGNAL})


def write_csv(file: Path) -> None:
    rows = (f'{k / RATE},{value}' for k, value in enumerate(SIGNAL))
    file.write_text('\n'.join(('time [s],sound', *rows)))


@pytest.mark.parametrize(('ending', 'write'), [('wav', write_wav), ('mat', write_mat)])
def test_a_recording_is_read(ending: str, write: Callable[[Path], None], tmp_path: Path) -> None:
    write(file := tmp_path / f'a.{ending}')
    found = read_signals(file)
    assert found.columns == ('time', 'sound')
    assert found.rate == pytest.approx(RATE)
    scale = np.ptp(found.samples[:, 1]) / np.ptp(SIGNAL)
    np.testing.assert_allclose(found.samples[:, 1], scale * SIGNAL, atol=1e-4)
    assert not found.remark


def test_a_recorder_that_was_killed_leaves_what_can_be_read(tmp_path: Path) -> None:
    write_wav(file := tmp_path / 'a.wav')
    file.write_bytes(file.read_bytes()[: 44 + 2 * 3000])
    found = read_signals(file)
    assert len(found.samples) == 3000
    assert found.remark == f'{file} ends before its head says that it does.'


@pytest.mark.parametrize(
    ('ending', 'write', 'times'),
    [('wav', write_wav, 400), ('mat', write_mat, 8), ('csv', write_csv, 400)],
)
@pytest.mark.filterwarnings('error')
def test_damage_is_read_or_refused_in_a_sentence(
    ending: str, write: Callable[[Path], None], times: int, tmp_path: Path
) -> None:
    write(whole := tmp_path / f'whole.{ending}')
    data, file = whole.read_bytes(), tmp_path / f'damaged.{ending}'
    generator, said = np.random.default_rng(5), list[str]()
    for _ in range(times):
        damaged = bytearray(data)
        place = int(generator.integers(200))  # heads are what readers stumble over
        match generator.integers(3):
            case 0:
                damaged[place] ^= 1 << int(generator.integers(8))
            case 1:
                del damaged[place : place + int(generator.integers(1, 40))]
            case _:
                del damaged[place:]
        file.write_bytes(damaged)
        try:
            found = read_signals(file)
        except SignalFileError as error:
            said.append(str(error))
        else:
            assert np.isfinite(found.samples[:, 0]).all()
    assert 0 < len(said) < times
    assert not any('\n' in each for each in said)


def test_a_mat_file_is_read_beside_scripts_of_any_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / 'scipy').mkdir()
    (tmp_path / 'scipy/__init__.py').write_text('raise SystemExit("a script of mine")')
    write_mat(tmp_path / 'a.mat')
    monkeypatch.chdir(tmp_path)
    assert read_signals(Path('a.mat')).rate == pytest.approx(RATE)


def test_a_mat_file_that_ends_the_process_of_its_reader_is_a_sentence(tmp_path: Path) -> None:
    write_mat(file := tmp_path / 'damaged.mat')
    data = bytearray(file.read_bytes())
    data[177] ^= 1  # the type of its numbers: SciPy looks it up beyond the end of a table
    file.write_bytes(data)
    with pytest.raises(SignalFileError, match='cannot be read: it is damaged'):
        read_signals(file)


def test_a_wav_of_8_bits_is_about_nothing(tmp_path: Path) -> None:
    wavfile.write(tmp_path / 'a.wav', RATE, (128.0 + 100.0 * SIGNAL).round().astype(np.uint8))
    found = read_signals(tmp_path / 'a.wav').samples[:, 1]
    np.testing.assert_allclose(found, SIGNAL * 100.0 / 127.0, atol=0.005)


@pytest.mark.parametrize('encoding', ['utf-8', 'utf-8-sig'])
@pytest.mark.parametrize(
    'head',
    [
        'time [ms],spindle_angle [deg],tool_displacement [um]',
        ' time (ms), spindle_angle (deg), tool_displacement (µm)',
    ],
)
def test_units_of_a_head_are_converted(head: str, encoding: str, tmp_path: Path) -> None:
    file = tmp_path / 'a.csv'
    file.write_text(f'{head}\n0,0,1\n0.125,90,-2\n0.25,180,3\n', encoding=encoding)
    for columns in (None, ('time', 'spindle_angle', 'tool_displacement')):
        found = read_signals(file, columns=columns)
        assert found.columns == ('time', 'spindle_angle', 'tool_displacement')
        expected = [[0, 0, 1e-6], [125e-6, 0.25, -2e-6], [250e-6, 0.5, 3e-6]]
        np.testing.assert_allclose(found.samples, expected, rtol=1e-12)


def test_a_unit_counts_for_what_its_column_is_said_to_be(tmp_path: Path) -> None:
    (tmp_path / 'a.csv').write_text('t [s],x1 [mm],mic [Pa]\n0,1,2\n1,3,4\n')
    columns = ('time', 'tool_displacement', 'sound')
    found = read_signals(tmp_path / 'a.csv', columns=columns)
    assert found.samples.tolist() == [[0.0, 0.001, 2.0], [1.0, 0.003, 4.0]]


def test_a_parquet_column_tells_its_unit(tmp_path: Path) -> None:
    arrow = pytest.importorskip('pyarrow')
    parquet = pytest.importorskip('pyarrow.parquet')
    fields = [
        arrow.field('time', arrow.float64()),
        arrow.field('tool_displacement', arrow.float64(), metadata={'unit': 'um'}),
    ]
    table = arrow.table([[0.0, 1.0], [1.0, 3.0]], schema=arrow.schema(fields))
    parquet.write_table(table, tmp_path / 'a.parquet')
    found = read_signals(tmp_path / 'a.parquet')
    np.testing.assert_allclose(found.samples[:, 1], [1e-6, 3e-6], rtol=1e-12)


@pytest.mark.parametrize(
    ('content', 'said'),
    [
        ('time,tool_displacement [kg]\n0,1\n1,2\n', 'displacement in kg: it must be in m, '),
        ('time,sound,sound\n0,1,2\n1,2,3\n', 'has 2 columns sound: give each a name of its own'),
        ('', 'has no first line with the names of its columns'),
        ('time,sound\n', 'does not hold columns of one length, of 2 samples or more'),
        ('time,sound\n0,1,2\n1,2,3\n', 'has 2 names in its first line, and 3 columns'),
    ],
)  # fmt: skip
def test_a_table_that_leaves_a_doubt_is_refused(content: str, said: str, tmp_path: Path) -> None:
    (tmp_path / 'a.csv').write_text(content)
    with pytest.raises(SignalFileError, match=re.escape(said)):
        read_signals(tmp_path / 'a.csv')


def test_one_name_is_not_given_to_two_columns(tmp_path: Path) -> None:
    (tmp_path / 'a.csv').write_text('time,a,b\n0,1,2\n1,2,3\n')
    with pytest.raises(SignalFileError, match='has 2 columns sound'):
        read_signals(tmp_path / 'a.csv', columns=('sound', 'sound'))


def test_labels_of_a_spreadsheet_are_read(tmp_path: Path) -> None:
    (tmp_path / 'a.csv').write_text('start,end,state\n0,4,stable\n', encoding='utf-8-sig')
    assert read_labels(tmp_path / 'a.csv') == [(0.0, 4.0, 'stable')]


def test_of_a_run_with_two_lathes_one_is_heard(tmp_path: Path) -> None:
    run = record_two_lathes(tmp_path)
    with pytest.raises(RunReadError, match='name one by its topic'):
        read_signals(run)
    heard = [read_signals(run, topic=f'/{cell}/lathe/samples') for cell in ('left', 'right')]
    assert not np.array_equal(heard[0].samples, heard[1].samples)
    write_wav(file := tmp_path / 'a.wav')
    with pytest.raises(ParameterError, match=r'must be left out where the recording is no run'):
        read_signals(file, topic='/left/lathe/samples')
