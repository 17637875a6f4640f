"""A map that was interrupted goes on where it stopped, and ends the same."""

from __future__ import annotations

from pathlib import Path

import pytest

from lathe_chatter.errors import ResultFileError
from lathe_chatter.knocks import KnockGrid, Margin, read_knock_map, run_knock_map
from lathe_chatter.lathe.config import LatheConfig, config_from

GRID = KnockGrid(
    LatheConfig(),
    (3000.0, 3100.0),
    (0.5e-3, 0.66e-3),
    (10e-6,),
    reach=4.0,
    step=1.4,
    tolerance=0.2,
)


class _InterruptedError(Exception):
    pass


def test_what_was_interrupted_is_continued(tmp_path: Path) -> None:
    whole = run_knock_map(GRID, tmp_path / 'whole.jsonl')
    assert whole.complete
    assert {limit.margin for limit in whole.limits.values()} >= {
        Margin.FINITE,
        Margin.NONE_FOUND,
    }
    path = tmp_path / 'parts.jsonl'

    def interrupt(done: int, total: int) -> None:
        assert total == 4
        if done == 1:
            raise _InterruptedError

    with pytest.raises(_InterruptedError):
        run_knock_map(GRID, path, interrupt)
    path.write_bytes(path.read_bytes() + b'{"spindle_speed_rpm": 31')  # a line cut off
    assert len(read_knock_map(path).limits) == 1
    reports: list[int] = []
    continued = run_knock_map(GRID, path, lambda done, _total: reports.append(done))
    assert reports == [1, 2, 3, 4]
    assert repr(sorted(continued.limits.items())) == repr(sorted(whole.limits.items()))
    assert repr(sorted(read_knock_map(path).limits.items())) == repr(sorted(whole.limits.items()))


def test_another_map_is_not_written_into(tmp_path: Path) -> None:
    path = tmp_path / 'map.jsonl'
    other = KnockGrid(config_from({'feed_speed': 0.005}), (3000.0,), (0.1e-3,), (5e-6,))
    run_knock_map(other, path)
    before = path.read_bytes()
    with pytest.raises(ResultFileError, match='not of the same parameters'):
        run_knock_map(GRID, path)
    assert path.read_bytes() == before
    assert read_knock_map(path).grid == other


@pytest.mark.parametrize('content', [b'', b'{}\n', b'time,x\n0,1\n', b'\xff\xfe\n'])
def test_what_is_no_map_is_said_to_be_none(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / 'other.txt'
    path.write_bytes(content)
    with pytest.raises(ResultFileError, match='no map of knocks'):
        read_knock_map(path)
