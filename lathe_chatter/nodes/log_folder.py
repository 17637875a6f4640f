"""A folder that ROS 2 can write its logs to: without one, rclpy does not start at all."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path


def ensure_log_folder() -> str:
    """Let ROS 2 write its logs elsewhere if it cannot where it would, here and in child processes.

    Returns:
        A sentence that says so, empty if all is as usual.
    """
    folder = _usual()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        other = tempfile.mkdtemp(prefix='lathe_chatter-log-')
        os.environ['ROS_LOG_DIR'] = other
        return f'The logs of ROS 2 go to {other}: {folder} cannot be written ({error.strerror}).'
    if not os.environ.get('HOME'):
        os.environ['ROS_LOG_DIR'] = str(folder)
    return ''


def _usual() -> Path:
    """Where ROS 2 writes its logs."""
    if os.environ.get('ROS_LOG_DIR'):
        return Path(os.environ['ROS_LOG_DIR'])
    if os.environ.get('ROS_HOME'):
        return Path(os.environ['ROS_HOME'], 'log')
    return Path(os.path.expanduser('~'), '.ros', 'log')  # noqa: PTH111 -- raises for no user
