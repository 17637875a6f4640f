"""The linear lathe in jitcdde, run in an environment of its own: problem in, solution out.

    python jitcdde_lathe.py PROBLEM.json SOLUTION.npz

It imports nothing of lathe_chatter.
"""

from __future__ import annotations

import json
import sys
import time
import warnings
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from jitcdde import jitcdde, y
from jitcdde import t as now


def compiled(problem: dict[str, Any]) -> Any:
    """The integrator, its C compiled."""
    delay = problem['delay']
    thickness = y(0) - y(2) - y(0, now - delay) + y(2, now - delay)
    tool, workpiece = problem['tool'], problem['workpiece']
    solver = jitcdde(
        [
            y(1),
            -tool['stiffness'] * y(0) - tool['damping'] * y(1) - tool['cutting'] * thickness,
            y(3),
            -workpiece['stiffness'] * y(2)
            - workpiece['damping'] * y(3)
            + workpiece['cutting'] * thickness,
        ],
        verbose=False,
    )
    solver.compile_C()
    return solver


def begin(solver: Any, problem: dict[str, Any]) -> None:
    """Go to t = 0, with r = 0 before it, and past the turns in which its kink is still felt."""
    solver.purge_past()
    solver.constant_past(problem['start'], time=0.0)
    solver.set_integration_parameters(
        atol=problem['atol'], rtol=problem['rtol'], first_step=1e-5, max_step=1.0, min_step=1e-14
    )
    solver.step_on_discontinuities(propagations=problem['propagations'], min_distance=1e-12)


def main(problem_file: str, solution_file: str) -> None:
    """Solve once for every sample, and several times for the last one alone."""
    warnings.simplefilter('ignore')  # that some samples lie within the step just taken
    problem = json.loads(Path(problem_file).read_text(encoding='utf-8'))
    rate, count = problem['sample_rate'], problem['samples']
    began = time.perf_counter()
    solver = compiled(problem)
    compiling = time.perf_counter() - began
    begin(solver, problem)
    first = int(np.ceil(solver.t * rate))
    states = np.array([solver.integrate(k / rate) for k in range(first, count + 1)])
    durations = []
    for _ in range(problem['repeats']):
        then = time.process_time()
        begin(solver, problem)
        solver.integrate(count / rate)
        durations.append(time.process_time() - then)
    packages = ('jitcdde', 'symengine', 'numpy')
    np.savez(
        solution_file,
        states=states,
        first=first,
        cpu=durations,
        compiling=compiling,
        versions=', '.join(f'{name} {version(name)}' for name in packages),
    )


if __name__ == '__main__':
    main(*sys.argv[1:])
