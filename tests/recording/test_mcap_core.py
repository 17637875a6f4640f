"""Files of killed writers in the reader of Foxglove's viewers, @mcap/core."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from support.recorded import WRITER_CHILD, values_by_mcap

PACKAGES = ('@mcap/core@2.2.2', '@mcap/support@1.1.0')
SCRIPT = Path(__file__).with_name('read_with_mcap_core.mjs')
TESTS = Path(__file__).resolve().parents[1]


@pytest.fixture(scope='module')
def reader(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """A command that takes files and says how many messages each has."""
    node, npm = shutil.which('node'), shutil.which('npm')
    if node is None or npm is None:
        pytest.skip('node is not there')
    place = tmp_path_factory.mktemp('node')
    shutil.copy(SCRIPT, place)
    install = [npm, 'install', '--no-audit', '--no-fund', '--fetch-retries=1', '--prefix']
    try:
        installed = subprocess.run(
            [*install, str(place), *PACKAGES],
            check=False,
            capture_output=True,
            text=True,
            timeout=60,
        )
    except subprocess.TimeoutExpired:
        pytest.skip('npm could not install it: no registry answered within 60 s')
    if installed.returncode != 0:
        pytest.skip(f'npm could not install it: {installed.stderr.strip()[-200:]}')
    return [node, str(place / SCRIPT.name)]


def test_it_reads_what_a_killed_writer_left(reader: list[str], tmp_path: Path) -> None:
    files: list[str] = []
    for k, commits in enumerate((1, 7, 60)):
        run = tmp_path / f'run{k}'
        with subprocess.Popen(
            [sys.executable, '-c', WRITER_CHILD, str(run)],
            stdout=subprocess.PIPE,
            text=True,
            cwd=TESTS,
        ) as child:
            assert child.stdout is not None
            for _ in range(commits):
                assert child.stdout.readline()
            child.send_signal(signal.SIGKILL)
        files.append(str(run / f'run{k}_0.mcap'))
    done = subprocess.run([*reader, *files], check=True, capture_output=True, text=True)
    expected = [len(values_by_mcap(Path(file))) for file in files]
    assert min(expected) >= 50
    assert json.loads(done.stdout) == [{'indexed': n, 'streamed': n} for n in expected]
