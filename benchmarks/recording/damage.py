"""What damage to a run does: flipped bits, and ends cut off."""

from __future__ import annotations

import sys
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np
from runs import scratch

sys.path.append(str(Path(__file__).parents[2] / 'tests'))

from support.damage import faults, flipped, held_by, noticed, record, truncated

from lathe_chatter.recording import read_run

Damage = Callable[[Path, Path, np.random.Generator], str]


def flips(count: int) -> None:
    """Flip one bit of an MCAP file or of metadata.yaml, many times."""
    _judge('flips', flipped, count)


def truncation(count: int) -> None:
    """Cut off the end of a file, many times."""
    _judge('truncation', truncated, count)


def _judge(name: str, damage: Damage, count: int) -> None:
    """Damage a run in many ways, and see whether anything wrong is handed out."""
    seed = int(np.random.default_rng().integers(2**32))
    generator = np.random.default_rng(seed)
    wrong: Counter[str] = Counter()
    count_noticed, began = 0, time.perf_counter()
    with scratch() as place:
        record(place / 'whole')
        whole = held_by(read_run(place / 'whole'))
        (place / 'damaged').mkdir()
        copy = place / 'damaged' / 'whole'
        for _ in range(count):
            where = damage(place / 'whole', copy, generator)
            for fault in faults(copy, whole, place):
                wrong[fault] += 1
                print(f'{name}: {where}: {fault}')
            count_noticed += noticed(copy)
    print(
        f'{name}: of {count}, verify notices {count_noticed}; the others change nothing that is '
        f'read. Wrong samples, parameters, notes or messages handed out, tracebacks: '
        f'{sum(wrong.values())} (seed {seed}, {time.perf_counter() - began:.0f} s)'
    )
