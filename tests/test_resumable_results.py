"""Results in a file: kept as they are found, continued, and never mixed."""

from __future__ import annotations

import resource
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import pytest

from lathe_chatter import resumable_results
from lathe_chatter.errors import ResultFileError
from lathe_chatter.resumable_results import spread_into

HEADER = {'kind': 'squares', 'speeds': [1.0, 2.0]}


def square(number: int) -> int:
    return number * number


def test_what_was_interrupted_is_not_computed_again(tmp_path: Path) -> None:
    path, seen = tmp_path / 'a.jsonl', list[int]()

    def interrupted(number: int, end: int) -> int:
        seen.append(number)
        if len(seen) == end:
            raise KeyboardInterrupt
        return square(number)

    with ThreadPoolExecutor(1) as pool:
        with pytest.raises(KeyboardInterrupt):
            spread_into(path, HEADER, partial(interrupted, end=37), range(40), executor=pool)
        with path.open('ab') as file:
            file.write(b'{"place": 39, "res')  # as a power cut leaves it
        kept = path.read_bytes().count(b'\n') - 1
        assert 0 < kept < 37
        seen.clear()
        told: list[int] = []
        found = spread_into(
            path, HEADER, partial(interrupted, end=99), range(40), executor=pool,
            progress=told.append,
        )  # fmt: skip
    assert found == [square(number) for number in range(40)]
    assert len(seen) == 40 - kept
    assert (told[0], sum(told)) == (kept, 40)


def test_other_results_are_left_as_they_are(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / 'a.jsonl'
    spread_into(path, HEADER, square, range(3))
    before = path.read_bytes()
    with pytest.raises(ResultFileError, match='holds other results, not of the same speeds: '):
        spread_into(path, {**HEADER, 'speeds': [1.0]}, square, range(3))
    monkeypatch.setattr(resumable_results, 'code_identity', lambda: 'lathe_chatter 9.9.9')
    with pytest.raises(ResultFileError, match=r'was begun with .* and this is lathe_chatter 9'):
        spread_into(path, HEADER, square, range(3))
    assert path.read_bytes() == before


@pytest.mark.parametrize(
    'content',
    [
        b'time,x\n0,1\n',
        b'[]\n',
        b'\xff\xfe\n',
        b'one line of notes',
        b'0,1\n0,2',
        b'{"kind": "cub',
    ],
)
def test_a_file_that_does_not_begin_as_its_own_is_left_as_it_is(
    content: bytes, tmp_path: Path
) -> None:
    path = tmp_path / 'notes.txt'
    path.write_bytes(content)
    with pytest.raises(ResultFileError, match='not of the same kind'):
        spread_into(path, HEADER, square, range(3))
    assert path.read_bytes() == content


@pytest.mark.parametrize('path', ['/dev/null', '/dev/full'])
def test_a_device_is_said_to_be_no_file(path: str) -> None:
    with refused_memory(), pytest.raises(ResultFileError) as refused:
        spread_into(path, HEADER, square, range(3))
    assert str(refused.value) == f'{path} is no file: name another.'


@contextmanager
def refused_memory() -> Iterator[None]:
    """For where it would be read without end."""
    before = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (8 * 2**30, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)


def test_a_first_line_that_was_cut_off_is_written_anew(tmp_path: Path) -> None:
    path = tmp_path / 'a.jsonl'
    spread_into(path, HEADER, square, range(3))
    whole = path.read_bytes()
    for size in (0, 20, whole.index(b'\n')):
        path.write_bytes(whole[:size])
        assert spread_into(path, HEADER, square, range(3)) == [0, 1, 4]
        assert sorted(path.read_bytes().splitlines()) == sorted(whole.splitlines())


@pytest.mark.parametrize(
    'line', ['{"result": 3}', '{"place": 7, "result": 3}', '{"place": [0]}', '[]', 'x']
)
def test_a_line_that_is_no_result_is_named_and_kept(line: str, tmp_path: Path) -> None:
    path = tmp_path / 'a.jsonl'
    spread_into(path, HEADER, square, range(3))
    with path.open('a') as file:
        file.write(line + '\n')
    before = path.read_bytes()
    with pytest.raises(ResultFileError, match=r'^line 5 of .*a\.jsonl is no result as the others'):
        spread_into(path, HEADER, square, range(3))
    assert path.read_bytes() == before


@contextmanager
def room_for(size: int) -> Iterator[None]:
    """No file may grow beyond some bytes: the system then refuses, as on a disk that is full."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_a_disk_that_takes_no_more_is_a_sentence_and_loses_nothing(tmp_path: Path) -> None:
    path = tmp_path / 'a.jsonl'
    with room_for(1000), pytest.raises(ResultFileError, match=r'a\.jsonl cannot be written: '):
        spread_into(path, HEADER, square, range(100))
    kept = path.read_bytes()
    assert 500 < len(kept) <= 1000
    assert spread_into(path, HEADER, square, range(100)) == [square(k) for k in range(100)]
    assert path.read_bytes().startswith(kept[: kept.rfind(b'\n') + 1])
