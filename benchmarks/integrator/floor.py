"""What a quiet step costs in C: the floor of a loop that takes one step after the other."""

from __future__ import annotations

import ctypes
import math
import shutil
import statistics
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np

from lathe_chatter.array_types import Array
from lathe_chatter.lathe.integrator import state_layout as layout
from lathe_chatter.lathe.integrator.coefficients import constants_of
from lathe_chatter.model import Cut, Machine
from lathe_chatter.model.machine_and_sampling import LatheSetup

_STEPS = 10_000
_TURN = 200


class NoCompilerError(Exception):
    """There is no C compiler."""


class Floor:
    """The C loop, compiled for this processor.

    Raises:
        NoCompilerError: If it cannot be.
    """

    def __init__(self) -> None:
        """See the class."""
        compiler = shutil.which('cc') or shutil.which('gcc')
        if compiler is None:
            raise NoCompilerError('there is no C compiler')
        source = Path(__file__).with_name('floor.c')
        with tempfile.TemporaryDirectory() as folder:
            library = Path(folder) / 'floor.so'
            command = [compiler, '-O3', '-march=native', '-shared', '-fPIC']
            done = subprocess.run(  # noqa: S603 -- our own
                [*command, str(source), '-o', str(library)], capture_output=True, check=False
            )
            if done.returncode:
                raise NoCompilerError(f'{compiler} failed on {source.name}')
            self._take_steps = ctypes.CDLL(str(library)).take_steps
        self._take_steps.restype = ctypes.c_int64
        constants = constants_of(LatheSetup(Machine()), Cut(3000.0, 4e-4, 5e-5), 1)
        rules = constants.rules[layout.IN_CUT]
        self._turn = np.ascontiguousarray(rules[[layout.STEP_OWN, layout.STEP_PARTNER]].T)
        self._answer = rules[layout.STEP_SURFACE : layout.STEP_SURFACE + 6].copy()
        self._outputs = constants.outputs[layout.IN_CUT].copy()
        self._out = np.empty((_STEPS, 8))

    def nanoseconds(self, repeats: int = 50) -> float:
        """CPU time of a step, median of so many runs."""
        costs = []
        for _ in range(repeats):
            z, nodes = np.zeros(4), np.zeros((_TURN, 4))
            nodes[:, 0] = 1e-6 * np.sin(np.arange(_TURN) * (2.0 * math.pi / _TURN))
            given = (z, self._turn, self._answer, self._outputs, nodes)
            begin = time.thread_time()
            taken = self._take_steps(
                *map(_pointer, given), ctypes.c_int64(_TURN), _pointer(self._out),
                ctypes.c_int64(_STEPS),
            )  # fmt: skip
            costs.append(1e9 * (time.thread_time() - begin) / _STEPS)
            if taken != _STEPS:
                raise ArithmeticError(f'the C loop stopped after {taken} steps')
        return statistics.median(costs)


def _pointer(values: Array) -> ctypes.c_void_p:
    return ctypes.c_void_p(values.ctypes.data)
