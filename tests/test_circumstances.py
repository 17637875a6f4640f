"""Without ROS 2 and without a working directory, a user is told in a sentence and at once."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest


def run(program: str, **options: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, '-c', program], capture_output=True, text=True, check=False, **options
    )


@pytest.mark.parametrize(
    'start',
    [
        'from lathe_chatter.cli.main import main; sys.exit(main(["run", "--output", "x"]))',
        'from lathe_chatter.nodes.entry_points import lathe; lathe()',
        'from lathe_chatter.nodes.entry_points import chatter_monitor; chatter_monitor()',
        'from lathe_chatter.nodes.entry_points import run_recorder; run_recorder()',
        'from lathe_chatter.nodes.entry_points import chatter_supervisor; chatter_supervisor()',
    ],
)
def test_a_missing_ros_is_said_before_anything_is_compiled(start: str, tmp_path: Path) -> None:
    done = run(
        f'import sys; sys.modules["rclpy"] = None; {start}',
        cwd=tmp_path,
        env={**os.environ, 'NUMBA_CACHE_DIR': str(tmp_path / 'cache')},
    )
    assert done.returncode == 2, done.stderr
    assert 'ROS 2 is not there' in done.stderr
    assert '`make run`' in done.stderr
    assert 'Traceback' not in done.stderr
    assert 'Compiling' not in done.stdout + done.stderr
    assert not (tmp_path / 'cache').exists()


def test_a_working_directory_that_was_removed_is_said_in_a_sentence(tmp_path: Path) -> None:
    gone = tmp_path / 'gone'
    gone.mkdir()
    start = 'from lathe_chatter.cli.main import main; sys.exit(main(["lobes"]))'
    done = run(f'import os, sys; os.rmdir({str(gone)!r}); {start}', cwd=gone)
    assert done.returncode == 2, done.stderr
    assert 'The working directory is not there any more' in done.stderr
    assert 'Traceback' not in done.stderr
