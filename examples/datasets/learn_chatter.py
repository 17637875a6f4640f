"""A random forest that tells stable cuts from unstable ones, on machines it has never seen.

    lathe-chatter dataset examples/datasets/chatter.yaml --output data/chatter
    python examples/datasets/learn_chatter.py data/chatter        # [sample rate, Hz: else 10000]

Needs scikit-learn. The features are what a shop could compute from its sensors, whichever the data
set has, and the speed of the spindle.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np

from lathe_chatter.dataset import read_windows
from lathe_chatter.errors import DatasetError

try:
    from sklearn.ensemble import RandomForestClassifier
except ImportError:
    sys.exit('The forest needs scikit-learn, which is not installed: pip install scikit-learn')

TINY = 1e-30
"""Beside a signal that stands still: the force of a tool that is out of the cut."""


def features(windows: dict[str, Any], rate: float) -> Any:
    """Of each window its sizes, its growth, and what of it does not repeat with the spindle."""
    found = []
    for values in (each for each in windows.values() if each.ndim == 2):
        signal = values - values.mean(axis=1, keepdims=True, dtype=float)
        turns = np.rint(rate * 60.0 / windows['spindle_speed_rpm']).astype(int)
        turns = np.minimum(turns, signal.shape[1] // 2)  # a window may be shorter than a turn
        size = signal.std(axis=1) + TINY
        halves = [half.std(axis=1) + TINY for half in np.array_split(signal, 2, axis=1)]
        spectrum = np.abs(np.fft.rfft(signal * np.hanning(signal.shape[1])))
        share = spectrum.max(axis=1) ** 2 / ((spectrum**2).sum(axis=1) + TINY)
        change = TINY + np.array(
            [(row[turn:] - row[:-turn]).std() for row, turn in zip(signal, turns, strict=True)]
        )
        peak = spectrum.argmax(axis=1) * rate / signal.shape[1]
        phase = peak * 60.0 / windows['spindle_speed_rpm'] % 1.0
        found += [np.log(size), np.log(halves[1] / halves[0]), share, np.log(change / size)]
        found += [peak, phase]
    return np.column_stack(found)


def main(folder: Path, rate: float = 1e4) -> None:
    """Learn from the one split, and tell how much of the other is right."""
    try:
        train, test = (read_windows(folder, split) for split in ('train', 'test'))
    except DatasetError as error:
        sys.exit(str(error))
    forest = RandomForestClassifier(300, random_state=0, n_jobs=-1)
    forest.fit(features(train, rate), train['stable'])
    right = (forest.predict(features(test, rate)) == test['stable']).mean()
    constant = max(test['stable'].mean(), 1.0 - test['stable'].mean())
    print(
        f'{len(train["stable"])} windows to learn from, {len(test["stable"])} of other machines:'
    )
    print(f'{right:.1%} right, where always the same answer would be {constant:.1%}')


if __name__ == '__main__':
    if len(sys.argv) not in {2, 3}:
        sys.exit('Give the folder of a data set: python learn_chatter.py data/chatter')
    main(Path(sys.argv[1]), *map(float, sys.argv[2:]))
