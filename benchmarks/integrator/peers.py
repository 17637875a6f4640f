"""The lathe beside what a user could pick instead: jitcdde, and SciPy's DOP853.

jitcdde is installed by this command, at the versions below, into an environment of its own in
the user's cache folder. It compiles C at run time and locates no events, so it is measured on
the linear cut without clearance; DOP853 (tests/reference/dop853.py) does everything.
"""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
import venv
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from cases import CHATTER, DURATION, LINEAR, RATE, TOUCHING, Case, by_dop853, error, exact, run
from figures import Figure, Line, Missing, progress, tracked
from speed import cost
from support.reference.solution import event_error, relative_error

from lathe_chatter.model import Machine, Mode, paper_initial_state

REQUIREMENTS = (
    'jitcdde==1.8.3', 'jitcxde-common==1.5.6', 'chspy==1.2.3', 'symengine==0.15.0',
    'sympy==1.14.0', 'jinja2==3.1.6', 'numpy', 'setuptools',
)  # fmt: skip
"""With NumPy and setuptools as they suit this Python."""

_TOLERANCE = 1e-8
_REPEATS = 5
_PATIENCE = 600.0  # s, for an index or a compiler


@dataclass(frozen=True)
class Peer:
    """What jitcdde made of a case."""

    error: float
    cpu: float
    compiling: float
    versions: str


class UnavailableError(Exception):
    """A peer cannot be measured here; the message says why."""


def peers() -> list[Line]:
    """Both."""
    return [*beside_jitcdde(), *beside_dop853()]


def beside_jitcdde() -> list[Line]:
    """Errors and CPU time of the linear cut, and how they compare."""
    lines: list[Line] = []
    try:
        python = environment()
        for case in tracked(
            (LINEAR, LINEAR.with_changes(spindle_speed_rpm=10000.0)), 'jitcdde compiles and cuts'
        ):
            lines += _compared(case, python)
    except UnavailableError as problem:
        lines.append(Missing('jitcdde', str(problem)))
    return lines


def _compared(case: Case, python: Path) -> list[Line]:
    peer = cut_with_jitcdde(case, python)
    usual = cut_with_jitcdde(case, python, atol=1e-10)
    ours, mine = error(run(case), exact(case)), statistics.median(cost(case).cpu)
    at = f'{case.cut.spindle_speed_rpm:g} rev/min'
    note = f'{peer.versions}; atol 1e-16; C compiled in {peer.compiling:.1f} s before'
    return [
        Figure(f'jitcdde, rtol {_TOLERANCE:g}, {at}: CPU', peer.cpu, 's per s', note=note),
        Figure('   its error / local amplitude', peer.error),
        Figure(
            '   the same with its usual atol of 1e-10: CPU', usual.cpu, 's per s',
            note=f'error {usual.error:.1e}',
        ),
        Figure(f'this lathe, {at}: CPU', mine / DURATION, 's per s'),
        Figure('   its error / local amplitude', ours),
        Figure(
            '   times cheaper than jitcdde', peer.cpu / (mine / DURATION),
            goal=1300.0, at_least=True, note='medians of CPU time',
        ),
        Figure(
            '   times more accurate than jitcdde', peer.error / ours, goal=5000.0, at_least=True
        ),
    ]  # fmt: skip


def beside_dop853() -> list[Line]:
    """Errors and CPU time with events, and how they compare."""
    lines: list[Line] = []
    for what, case in tracked(
        (('linear, none', LINEAR), ('linear, gap 5 um', TOUCHING), ('total, gap 5 um', CHATTER)),
        'DOP853 cuts',
    ):
        began = time.process_time()
        found = by_dop853(case)
        cpu, mine = time.process_time() - began, statistics.median(cost(case).cpu)
        late = event_error(found.events, exact(case).events)
        own = run(case)
        lines += [
            Figure(f'DOP853 method of steps, {what}: CPU', cpu / DURATION, 's per s'),
            Figure(
                '   its error / local amplitude', error(found, exact(case)),
                note=f'{len(found.events)} events, within {late:.1e} s',
            ),
            Figure('   this lathe: CPU', mine / DURATION, 's per s'),
            Figure(
                '   its error / local amplitude', error(own, exact(case)),
                note=f'{len(own.events)} events',
            ),
            Figure('   times cheaper than DOP853', cpu / mine),
        ]  # fmt: skip
    return lines


def environment() -> Path:
    """The Python of the environment that has jitcdde, made on first use.

    Raises:
        UnavailableError: If it cannot be made.
    """
    cache = Path(os.environ.get('XDG_CACHE_HOME') or '~/.cache').expanduser()
    name = f'peers-{sys.version_info[0]}.{sys.version_info[1]}'
    place = cache / 'lathe_chatter' / name
    python, stamp = place / 'bin' / 'python', place / 'ready'
    wanted = '\n'.join(REQUIREMENTS)
    if stamp.exists() and stamp.read_text() == wanted:
        return python
    with progress() as display:
        display.add_task(f'installing {REQUIREMENTS[0]} into {place}', total=None)
        try:
            venv.create(place, clear=True, with_pip=True)
        except (OSError, subprocess.CalledProcessError) as problem:
            raise UnavailableError(f'no virtual environment can be made: {problem}') from problem
        _output([
            str(python), '-m', 'pip', 'install', '--quiet', '--disable-pip-version-check',
            *REQUIREMENTS,
        ])  # fmt: skip
    stamp.write_text(wanted)
    return python


def cut_with_jitcdde(case: Case, python: Path, atol: float = 1e-16) -> Peer:
    """Solve a case with jitcdde.

    Its samples begin where `step_on_discontinuities` ends, after a turn.

    Raises:
        UnavailableError: If it fails, for want of a compiler say.
    """
    machine, cut = Machine(), case.cut

    def per_mass(mode: Mode) -> dict[str, float]:
        return {
            'stiffness': mode.stiffness / mode.mass,
            'damping': mode.damping / mode.mass,
            'cutting': machine.cutting_stiffness(cut.depth_of_cut) / mode.mass,
        }

    with tempfile.TemporaryDirectory() as folder:
        problem, solution = Path(folder) / 'problem.json', Path(folder) / 'solution.npz'
        problem.write_text(
            json.dumps(
                {
                    'tool': per_mass(machine.tool),
                    'workpiece': per_mass(machine.workpiece),
                    'delay': cut.delay,
                    'start': paper_initial_state(cut).tolist(),
                    'sample_rate': RATE,
                    'samples': round(DURATION * RATE),
                    'rtol': _TOLERANCE,
                    'atol': atol,
                    'propagations': 1,
                    'repeats': _REPEATS,
                }
            )
        )
        script = Path(__file__).with_name('jitcdde_lathe.py')
        _output([str(python), str(script), str(problem), str(solution)])
        with np.load(solution) as found:
            states = exact(case).states.copy()
            states[int(found['first']) - 1 :] = found['states']
            return Peer(
                relative_error(states, exact(case).states, RATE),
                float(np.median(found['cpu'])) / DURATION,
                float(found['compiling']),
                str(found['versions']),
            )


def _output(command: list[str]) -> str:
    """What a command prints, run without this environment's Python path.

    Raises:
        UnavailableError: If it fails, with the last line that it said.
    """
    clean = {key: value for key, value in os.environ.items() if key != 'PYTHONPATH'}
    try:
        done = subprocess.run(  # noqa: S603 -- our own commands
            command, env=clean, capture_output=True, text=True, timeout=_PATIENCE, check=False
        )
    except subprocess.TimeoutExpired as problem:
        raise UnavailableError(f'nothing came of it in {_PATIENCE:g} s') from problem
    if done.returncode:
        said = done.stderr.strip().splitlines() or [f'it ended with {done.returncode}']
        raise UnavailableError(said[-1])
    return done.stdout
