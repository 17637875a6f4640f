"""Folders whose files were taken away, renamed or added: nothing is joined that is not one run."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from support.recorded import number, topic

from lathe_chatter.errors import NothingSavedError, RunReadError
from lathe_chatter.recording import RunWriter, read_run, recover, verify

START = 1_700_000_000_000_000_000
PIECES = 4


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A run of four files with ten numbers each."""
    with RunWriter(tmp_path / 'run') as writer:
        writer.note('lathe_chatter/made_by', {'lathe_chatter': '0'})
        writer.add_topic(topic('/numbers'))
        for k in range(10 * PIECES):
            time = START + k
            writer.write('/numbers', number(k), log_time=time, publish_time=time, sequence=k + 1)
            if k % 10 == 9 and k < 10 * PIECES - 1:
                writer.split()
    assert verify(tmp_path / 'run').findings == []
    return tmp_path / 'run'


def numbers_of(path: Path) -> list[float]:
    return [recorded.message.data for recorded in read_run(path).messages('/numbers')]


def losses(path: Path) -> list[str]:
    return [finding.text for finding in verify(path).findings if finding.loss]


@pytest.mark.parametrize('piece', range(PIECES))
def test_a_missing_piece_is_named_and_the_rest_is_saved(
    piece: int, folder: Path, tmp_path: Path
) -> None:
    (folder / f'run_{piece}.mcap').unlink()
    assert f'run_{piece}.mcap: the file is missing.' in losses(folder)
    with pytest.raises(RunReadError, match=rf'lacks run_{piece}\.mcap\. .* recover'):
        read_run(folder)
    saved = recover(folder, tmp_path / 'saved')
    assert [str(each) for each in saved.damage] == [f'run_{piece}.mcap: the file is missing.']
    there = [k for k in range(10 * PIECES) if k // 10 != piece]
    assert [each.message.data for each in saved.run.messages('/numbers')] == there
    assert not verify(tmp_path / 'saved').complete


def test_without_metadata_a_hole_in_the_numbers_is_a_missing_piece(folder: Path) -> None:
    (folder / 'metadata.yaml').unlink()
    assert numbers_of(folder) == list(range(10 * PIECES))
    (folder / 'run_1.mcap').unlink()
    with pytest.raises(RunReadError, match=r'lacks run_1\.mcap'):
        read_run(folder)


def swap(folder: Path) -> None:
    (folder / 'run_1.mcap').rename(folder / 'other')
    (folder / 'run_2.mcap').rename(folder / 'run_1.mcap')
    (folder / 'other').rename(folder / 'run_2.mcap')


def copy_as_one_more(folder: Path) -> None:
    shutil.copy(folder / 'run_1.mcap', folder / 'run_4.mcap')


@pytest.mark.parametrize(
    ('change', 'said'),
    [
        (swap, 'run_0.mcap'),
        (copy_as_one_more, 'run_3.mcap is the last, and here run_4.mcap follows'),
    ],
)
def test_pieces_under_other_names_are_found(
    change: Callable[[Path], None], said: str, folder: Path
) -> None:
    change(folder)
    found = [text for text in losses(folder) if 'names were changed' in text]
    assert found
    if change is copy_as_one_more:
        assert said in found[0]


def test_a_piece_that_was_begun_before_metadata_told_of_it_is_of_the_run(folder: Path) -> None:
    described = folder / 'metadata.yaml'
    text = described.read_text()
    described.write_text(text.replace('  - run_3.mcap\n', ''))
    assert 'run_3.mcap' not in [
        line.strip('- ') for line in described.read_text().splitlines() if line[:3] == '  -'
    ]
    assert numbers_of(folder) == list(range(10 * PIECES))


def test_the_files_of_another_run_are_left_out(folder: Path, tmp_path: Path) -> None:
    with RunWriter(tmp_path / 'other') as writer:
        writer.add_topic(topic('/numbers'))
        writer.write('/numbers', number(-1.0), log_time=START, publish_time=START)
    shutil.copy(tmp_path / 'other' / 'other_0.mcap', folder)
    assert numbers_of(folder) == list(range(10 * PIECES))
    (finding,) = verify(folder).findings
    assert not finding.loss
    assert finding.text.startswith('other_0.mcap is in the folder, and of another run')
    (folder / 'metadata.yaml').unlink()
    with pytest.raises(RunReadError, match='holds files of several runs, other, run: name a file'):
        read_run(folder)


@pytest.mark.parametrize('text', ['', ': : [', '- a\n- b\n', 'a: 5', '[' * 900, '\0'])
def test_a_damaged_metadata_file_is_a_finding_and_no_obstacle(text: str, folder: Path) -> None:
    (folder / 'metadata.yaml').write_text(text)
    assert losses(folder) == [f'{folder}/metadata.yaml is missing or damaged.']
    assert numbers_of(folder) == list(range(10 * PIECES))


def test_metadata_that_counts_otherwise_is_a_finding(folder: Path) -> None:
    described = folder / 'metadata.yaml'
    described.write_text(described.read_text().replace('message_count: 40', 'message_count: 41'))
    assert losses(folder) == ['metadata.yaml counts 41 messages of /numbers, and 40 are there.']


@pytest.mark.parametrize('data', [b'', b'\x89MCAP0\r\n', b'something else\n' * 30])
def test_a_file_that_is_none_is_refused_and_verified(data: bytes, tmp_path: Path) -> None:
    file = tmp_path / 'run_0.mcap'
    file.write_bytes(data)
    assert not verify(file).complete
    with pytest.raises(RunReadError, match=f'is damaged at byte {len(data)}: it has no sound'):
        list(read_run(file).topics)
    with pytest.raises(NothingSavedError):
        recover(file, tmp_path / 'saved')
    assert [*tmp_path.iterdir()] == [file]


def test_folders_without_a_run_are_refused(tmp_path: Path) -> None:
    (tmp_path / 'folder_0.mcap').mkdir()
    with pytest.raises(RunReadError, match='holds no recorded run'):
        read_run(tmp_path)
    with pytest.raises(RunReadError, match='does not exist'):
        read_run(tmp_path / 'nowhere')
