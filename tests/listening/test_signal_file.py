"""Recordings as others leave them: whole, cut off, or damaged anywhere."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat, wavfile

from lathe_chatter.errors import SignalFileError
from lathe_chatter.listening import read_signals

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


def test_a_mat_file_that_ends_the_process_of_its_reader_is_a_sentence(tmp_path: Path) -> None:
    write_mat(file := tmp_path / 'damaged.mat')
    data = bytearray(file.read_bytes())
    data[177] ^= 1  # the type of its numbers: SciPy looks it up beyond the end of a table
    file.write_bytes(data)
    with pytest.raises(SignalFileError, match='cannot be read: it is damaged'):
        read_signals(file)
