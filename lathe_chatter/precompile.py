"""Compiles the inner loops once, so that nothing waits for it later.

    python -m lathe_chatter.precompile [lathe] [detector] [chart] [moves]

The machine code is kept (compiled.py says where) and reused by every later process until the
source changes.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable

import numpy as np

from lathe_chatter.compiled import before_compiling
from lathe_chatter.detection import ChatterDetector
from lathe_chatter.detection.cut_identification import cutting_limit, mechanics_of
from lathe_chatter.executors import module_command
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.model import BearingContact, Cut, Machine
from lathe_chatter.samples import SAMPLE_COLUMNS
from lathe_chatter.stability import floquet, rightmost_root, safe_limit

LATHE_LOOP, DETECTOR_LOOP, CHART_LOOPS, MOVE_LOOPS = 'lathe', 'detector', 'chart', 'moves'
_CUT = Cut(depth_of_cut=1e-3, bearing_contact=BearingContact.SEATED)
_SAMPLE_RATE = 1e4
_SENTENCE = 'Compiling the inner loops, once for each installation: a minute or two ...'


def precompile(*parts: str, say: Callable[[str], object] = lambda _sentence: None) -> None:
    """Compile or load all that later calls need.

    Where several parts are not there yet, each is compiled by a process of its own.

    Args:
        parts: `LATHE_LOOP`; `DETECTOR_LOOP`, with what a chart takes; `CHART_LOOPS`, that alone;
            `MOVE_LOOPS`, that and a varied speed. None means the first two.
        say: Is told in a sentence, at once, if something has to be compiled.
    """
    wanted = list(parts or (LATHE_LOOP, DETECTOR_LOOP))
    helpers: list[subprocess.Popen[bytes]] = []

    def begin() -> None:
        """Is called when the first part turns out not to be there."""
        say(_SENTENCE)
        helpers.extend(
            subprocess.Popen(  # noqa: S603 -- this very module
                module_command('lathe_chatter.precompile', part),
                stdin=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )
            for part in wanted[1:]
        )

    try:
        with before_compiling(begin):
            for number, part in enumerate(wanted):
                if number == 1:
                    for helper in helpers:
                        helper.wait()
                _PARTS[part]()
    finally:
        for helper in helpers:
            helper.terminate()
            helper.wait()


def _cut() -> None:
    VirtualLathe(cut=_CUT).advance(1000)


def _detect() -> None:
    """Watch a machine at rest, and load what advice about a speed and a picture take."""
    samples = np.zeros((2000, len(SAMPLE_COLUMNS)))
    samples[:, 0] = np.arange(2000) / _SAMPLE_RATE
    samples[:, 1] = samples[:, 0] * _CUT.spindle_speed_rpm / 60.0
    samples[0, 2:] = np.nan  # a sensor that is slow to begin takes a function more
    ChatterDetector().update(samples, SAMPLE_COLUMNS)
    cutting_limit(mechanics_of(Machine(), 1.0, 2.0), 1.0, 1.0, 1.0, 1j)
    _chart()


def _chart() -> None:
    rightmost_root(Machine(), _CUT.spindle_speed_rpm, _CUT.depth_of_cut, seated=True)
    safe_limit(Machine(), _CUT, _CUT.spindle_speed_rpm)


def _move() -> None:
    _chart()
    varied = _CUT.with_changes(speed_variation_amplitude=0.1, speed_variation_frequency=1.0)
    floquet(Machine(), varied, seated=True)


_PARTS = {LATHE_LOOP: _cut, DETECTOR_LOOP: _detect, CHART_LOOPS: _chart, MOVE_LOOPS: _move}

if __name__ == '__main__':
    precompile(*sys.argv[1:], say=lambda sentence: sys.stderr.write(f'{sentence}\n'))
