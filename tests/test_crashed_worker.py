"""How tests are given to workers (`conftest.py`)."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

TESTS = Path(__file__).parent
QUICK = """
import pytest
@pytest.mark.parametrize('n', range(4))
def test_quick(n):
    pass
"""
CRASHING = """
import os
def test_that_crashes_once():
    try:
        os.mkdir('crashed')
    except FileExistsError:
        return
    os._exit(1)
def test_behind_it():
    pass
"""
LONG = """
import os, time
def test_that_outlasts_the_crash():
    while not os.path.exists('crashed'):
        time.sleep(0.05)
"""


def test_after_a_worker_crashed_every_other_test_is_run(tmp_path: Path) -> None:
    """And the run ends: what the worker had done before is given to nobody."""
    for name, text in (
        *((f'quick_{k}', QUICK) for k in range(12)),
        ('crash', CRASHING),
        *((f'long_{k}', LONG) for k in range(2)),
    ):
        (tmp_path / f'test_{name}.py').write_text(text)
    command = [sys.executable, '-m', 'pytest', '-q', '-p', 'conftest', '-p', 'no:cacheprovider']
    done = subprocess.run(
        [*command, '-n', '2', '--dist', 'loadfile'],
        cwd=tmp_path,
        env={**os.environ, 'PYTHONPATH': str(TESTS)},
        capture_output=True,
        text=True,
        timeout=120.0,
        check=False,
    )
    assert '1 failed, 52 passed' in done.stdout, done.stdout
