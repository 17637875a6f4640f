"""What a long run keeps."""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from cases import CHATTER
from figures import Figure, Line, progress

from lathe_chatter.lathe.state import LatheState

_FIRST = 1_000_000
_BLOCK = 100_000
_CASES = {'quiet': CHATTER.with_changes(depth_of_cut=0.5e-3), 'chatter': CHATTER}
"""Both with a gap of 5 um and the total force; 0.5 mm is a stable depth."""


@dataclass(frozen=True)
class Kept:
    """What a process holds after so many samples.

    Attributes:
        samples: So many.
        resident: Memory of the whole process, bytes.
        state: The file that the lathe's state is saved to, bytes.
        cpu: Seconds so far.
    """

    samples: int
    resident: int
    state: int
    cpu: float


def memory(samples: int) -> list[Line]:
    """Resident memory and size of the saved state after 10^6 and after `samples` steps."""
    lines: list[Line] = []
    for name in _CASES:
        first, last = _watched(name, samples)
        grown = (last.resident - first.resident) / 1e6
        lines += [
            Figure(f'{name}: resident after 1e6 steps', first.resident / 1e6, 'MB'),
            Figure(
                f'   more after {last.samples:.0e} steps', grown, 'MB', 1.0,
                note=f'{last.cpu:.0f} s of CPU time',
            ),
            Figure('   saved state after 1e6 steps', first.state / 1e3, 'kB'),
            Figure(
                f'   saved state after {last.samples:.0e} steps', last.state / 1e3, 'kB',
                1.1 * first.state / 1e3,
            ),
        ]  # fmt: skip
    return lines


def _watched(name: str, samples: int) -> tuple[Kept, Kept]:
    """The first and the last report of a process that cuts."""
    command = [sys.executable, str(Path(__file__).parent), '--cut', name, str(samples)]
    reports: list[Kept] = []
    with (
        progress() as display,
        subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as child,  # noqa: S603 -- ourselves
    ):
        task = display.add_task(f'{samples:.0e} steps, {name}', total=samples)
        assert child.stdout is not None  # noqa: S101 -- for the types
        for line in child.stdout:
            reports.append(Kept(**json.loads(line)))
            display.update(task, completed=reports[-1].samples)
    if child.returncode:
        raise subprocess.CalledProcessError(child.returncode, command)
    return reports[0], reports[-1]


def cut(name: str, samples: int) -> None:
    """Cut, and report every 10^6 samples: what `memory` starts in a process of its own."""
    lathe = _CASES[name].lathe()
    for done in range(_BLOCK, samples + 1, _BLOCK):
        lathe.advance(_BLOCK)
        if lathe.guard:
            sys.exit(lathe.guard)
        if done % _FIRST == 0:
            kept = Kept(done, _resident(), _saved(lathe.snapshot()), time.process_time())
            print(json.dumps(vars(kept)), flush=True)


def _saved(state: LatheState) -> int:
    """Bytes of the file of a state."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / 'lathe'
        state.save(file)
        return file.stat().st_size


def _resident() -> int:
    """Bytes of this process in memory; at most, where the system tells no more."""
    statm = Path('/proc/self/statm')
    if statm.exists():
        return int(statm.read_text().split()[1]) * resource.getpagesize()
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
