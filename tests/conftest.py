from __future__ import annotations

import os
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

# Under `nohup make test &`, and in many CI systems, SIGINT is ignored, and the programs that the
# tests start would inherit that. With a handler in this process they start with the usual one.
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# NumPy's library computes on every core, and its threads spin while they wait for each other:
# beside other tests a modal fit takes three times the processor time, for nothing.
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')

SINGLY = {
    'tests/cli/test_run.py',
    'tests/docs/test_pages.py',
    'tests/nodes/test_pages.py',
    'tests/nodes/test_supervisor.py',
}
"""Files of a few long tests that share nothing: each of them goes to whatever worker is free, so
that none is left with a whole file when the others have ended."""


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """`--dist loadfile`, but for some files, and where a worker crashes."""
    from xdist.scheduler import LoadFileScheduling

    class Scheduling(LoadFileScheduling):  # type: ignore[misc]
        def _split_scope(self, nodeid: str) -> str:
            file: str = super()._split_scope(nodeid)
            return nodeid if file in SINGLY else file

        def remove_node(self, node: Any) -> Any:
            """What a worker had done stays done when it crashes.

            Put back beside the rest, as files without a test to run, it would keep whoever gets
            it waiting for ever.
            """
            files = self.assigned_work[node]
            for file in [name for name, tests in files.items() if all(tests.values())]:
                del files[file]
            return super().remove_node(node)

    return Scheduling(config, log) if config.getvalue('dist') == 'loadfile' else None


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A disk of 1 MB."""
    place = tmp_path / 'disk'
    place.mkdir()
    command = ['mount', '-t', 'tmpfs', '-o', 'size=1m', 'tmpfs', str(place)]
    if os.geteuid() != 0 or subprocess.run(command, capture_output=True, check=False).returncode:
        pytest.skip('only root can mount a small disk')
    yield place
    subprocess.run(['umount', '-l', str(place)], check=True)
