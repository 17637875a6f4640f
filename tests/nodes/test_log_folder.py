"""rclpy starts whatever became of the folder for its logs, and without HOME."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from lathe_chatter.nodes.log_folder import ensure_log_folder


@pytest.fixture(autouse=True)
def plain_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ('ROS_LOG_DIR', 'ROS_HOME'):
        monkeypatch.delenv(name, raising=False)


def test_a_folder_that_can_be_written_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv('ROS_LOG_DIR', str(tmp_path / 'logs'))
    assert ensure_log_folder() == ''
    assert os.environ['ROS_LOG_DIR'] == str(tmp_path / 'logs')


@pytest.mark.parametrize('name', ['ROS_LOG_DIR', 'ROS_HOME', 'HOME'])
def test_one_that_cannot_is_replaced_and_named(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    obstacle = tmp_path / 'file'
    obstacle.write_text('')
    monkeypatch.setenv(name, str(obstacle))
    said = ensure_log_folder()
    used = Path(os.environ['ROS_LOG_DIR'])
    assert used.is_dir()
    assert str(obstacle) in said
    assert str(used) in said
    used.rmdir()


@pytest.mark.parametrize('lacking', ['HOME', 'a folder for logs'])
def test_a_node_starts_all_the_same(lacking: str, domain: int, tmp_path: Path) -> None:
    (tmp_path / 'file').write_text('')
    environment = {**os.environ, 'ROS_DOMAIN_ID': str(domain)}
    if lacking == 'HOME':
        del environment['HOME']
    else:
        environment['ROS_LOG_DIR'] = str(tmp_path / 'file')
    done = subprocess.run(
        [
            *(
                sys.executable,
                '-m',
                'lathe_chatter.nodes.entry_points',
                'run_recorder',
                '--ros-args',
            ),
            *('-p', f'output:={tmp_path / "file"}'),  # refused, once it has started
        ],
        env=environment,
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert done.returncode == 2, done.stderr
    assert str(tmp_path / 'file') in done.stderr
    assert 'Traceback' not in done.stderr
    assert 'rcl' not in done.stderr
