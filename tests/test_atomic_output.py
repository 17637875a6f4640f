"""What is made is in its place whole or not at all, whatever ends its maker."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from lathe_chatter.atomic_output import atomic_output
from lathe_chatter.recording import read_run
from lathe_chatter.recording.export import to_csv
from lathe_chatter.recording.one_message_per_sample import unroll
from lathe_chatter.recording.sample_series import Selection

RUN = Path(__file__).parent / 'golden' / 'run'
KILLED = """
import os, signal, sys
from pathlib import Path
from lathe_chatter.recording import read_run
from lathe_chatter.recording.export import to_csv
from lathe_chatter.recording.one_message_per_sample import unroll
from lathe_chatter.recording.sample_series import Selection
write = {'to_csv': to_csv, 'unroll': unroll}[sys.argv[1]]
kill = lambda _: os.kill(os.getpid(), signal.SIGKILL)
write(read_run(sys.argv[2]), Path(sys.argv[3]), Selection(), kill)
"""


@pytest.mark.parametrize('write', [to_csv, unroll])
def test_a_killed_export_leaves_nothing_in_its_place_and_the_next_clears_up(
    write: Any, tmp_path: Path
) -> None:
    path = tmp_path / 'new' / 'out.csv'
    path.parent.mkdir()
    call = [sys.executable, '-c', KILLED, write.__name__, str(RUN), str(path)]
    assert subprocess.run(call, check=False).returncode == -9
    assert not path.exists()
    assert [*path.parent.iterdir()] == [path.parent / '.out.csv.partial']
    write(read_run(RUN), path, Selection(), lambda _count: None)
    assert [*path.parent.iterdir()] == [path]


def test_an_error_leaves_nothing_and_names_the_place(tmp_path: Path) -> None:
    with pytest.raises(OSError, match='File name too long') as error:  # noqa: PT012, SIM117
        with atomic_output(tmp_path / 'new') as folder:
            folder.mkdir()
            (folder / ('x' * 300)).write_text('')
    assert error.value.filename == str(tmp_path / 'new')
    assert not [*tmp_path.iterdir()]


def test_a_folder_that_came_meanwhile_is_not_written_into(tmp_path: Path) -> None:
    with pytest.raises(OSError, match='not empty'):  # noqa: PT012, SIM117
        with atomic_output(tmp_path / 'new') as folder:
            folder.mkdir()
            (tmp_path / 'new').mkdir()
            (tmp_path / 'new' / 'theirs').write_text('')
    assert [*(tmp_path / 'new').iterdir()] == [tmp_path / 'new' / 'theirs']
