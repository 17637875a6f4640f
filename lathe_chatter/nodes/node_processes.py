"""A cell: the nodes of one machine as processes that are started, watched and ended together."""

from __future__ import annotations

import ctypes
import signal
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from contextlib import AbstractContextManager
from typing import IO, NamedTuple

from lathe_chatter.errors import NodeFailedError
from lathe_chatter.executors import module_command

_END_TIMEOUT = 15.0
"""s that a node has to finish what it does after SIGTERM."""
_ENDED_WELL = (0, -signal.SIGTERM)
"""The latter of a node that was told to end while Python itself was still starting."""
_NODES = 'lathe_chatter.nodes.entry_points'
_SET_DEATH_SIGNAL = 1  # PR_SET_PDEATHSIG of prctl(2)


class _Member(NamedTuple):
    name: str
    process: subprocess.Popen[bytes]
    output: IO[bytes]


def die_with_parent() -> None:
    """Ask Linux to end the child should this process be killed: no lathe is left cutting."""
    if sys.platform == 'linux':
        ctypes.CDLL(None).prctl(_SET_DEATH_SIGNAL, signal.SIGTERM)


class ProcessGroup(AbstractContextManager['ProcessGroup']):
    """Processes of nodes; as a context it ends them all, the last started last.

    They are in sessions of their own, so that Ctrl-C reaches this process alone, which then
    ends them in an order that loses nothing: the lathe first, the recorder last.
    """

    def __init__(self) -> None:
        """Begin empty."""
        self._members: list[_Member] = []

    def start(self, name: str, arguments: Sequence[str] = (), *, module: str = _NODES) -> None:
        """Start a node as `python -m module name` with ROS arguments."""
        command = module_command(module, name)
        if arguments:
            command += ['--ros-args', *arguments]
        output = tempfile.TemporaryFile()  # noqa: SIM115 -- lives as long as the process
        process = subprocess.Popen(  # noqa: S603 -- our own modules
            command,
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT,
            start_new_session=True,
            preexec_fn=die_with_parent,  # noqa: PLW1509 -- no thread is started before
        )
        self._members.append(_Member(name, process, output))

    def check(self) -> None:
        """See that every node still runs.

        Raises:
            NodeFailedError: If one has ended, with the last line that it wrote.
        """
        for name, process, output in self._members:
            if process.poll() is not None:
                raise NodeFailedError(_last_words(name, process.returncode, output))

    def end(self) -> list[str]:
        """End every node with SIGTERM, the newest first, and wait for each.

        SIGINT would not reach those whose parents ignore it, as under `nohup make run &`.

        Returns:
            A sentence for each node that did not end well.
        """
        complaints: list[str] = []
        while self._members:
            name, process, output = self._members.pop()
            if process.poll() is None:
                process.terminate()
            try:
                process.wait(_END_TIMEOUT)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
                complaints.append(
                    f'{name} did not end within {_END_TIMEOUT:.0f} s and was killed.'
                )
            else:
                if process.returncode not in _ENDED_WELL:
                    complaints.append(_last_words(name, process.returncode, output))
            output.close()
        return complaints

    def __exit__(self, *_error: object) -> None:
        """End what still runs."""
        self.end()


def _last_words(name: str, code: int, output: IO[bytes]) -> str:
    """What a node said last, as the reason for its end, unless it was killed."""
    if code < 0:
        return f'{name} was ended by the signal {signal.Signals(-code).name}.'
    output.seek(0)
    lines = output.read().decode(errors='replace').split('\n')
    words = next((line.strip() for line in reversed(lines) if line.strip()), 'it said nothing')
    return f'{name} ended with exit code {code}: {words}'
