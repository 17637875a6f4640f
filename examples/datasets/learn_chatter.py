"""A random forest that tells stable cuts from unstable ones, on machines it has never seen.

    lathe-chatter dataset examples/datasets/chatter.yaml --output data/chatter
    python examples/datasets/learn_chatter.py data/chatter

Needs scikit-learn. The features are what a shop could compute from two displacement sensors and
the speed of the spindle.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np

from lathe_chatter.dataset import read_windows

try:
    from sklearn.ensemble import RandomForestClassifier
except ImportError:
    sys.exit('The forest needs scikit-learn, which is not installed: pip install scikit-learn')

RATE = 1e4


def features(windows: dict[str, Any]) -> Any:
    """Of each window its sizes, its growth, and what of it does not repeat with the spindle."""
    turns = np.rint(RATE * 60.0 / windows['spindle_speed_rpm']).astype(int)
    found = []
    for name in ('tool_displacement', 'workpiece_displacement'):
        signal = windows[name].astype(float)
        signal -= signal.mean(axis=1, keepdims=True)
        size = signal.std(axis=1)
        halves = [half.std(axis=1) for half in np.array_split(signal, 2, axis=1)]
        spectrum = np.abs(np.fft.rfft(signal * np.hanning(signal.shape[1])))
        share = spectrum.max(axis=1) ** 2 / (spectrum**2).sum(axis=1)
        change = np.array(
            [(row[turn:] - row[:-turn]).std() for row, turn in zip(signal, turns, strict=True)]
        )
        peak = spectrum.argmax(axis=1) * RATE / signal.shape[1]
        phase = peak * 60.0 / windows['spindle_speed_rpm'] % 1.0
        found += [np.log(size), np.log(halves[1] / halves[0]), share, np.log(change / size)]
        found += [peak, phase]
    return np.column_stack(found)


def main(folder: Path) -> None:
    """Learn from the one split, and tell how much of the other is right."""
    train, test = (read_windows(folder, split) for split in ('train', 'test'))
    forest = RandomForestClassifier(300, random_state=0, n_jobs=-1)
    forest.fit(features(train), train['stable'])
    right = (forest.predict(features(test)) == test['stable']).mean()
    constant = max(test['stable'].mean(), 1.0 - test['stable'].mean())
    print(
        f'{len(train["stable"])} windows to learn from, {len(test["stable"])} of other machines:'
    )
    print(f'{right:.1%} right, where always the same answer would be {constant:.1%}')


if __name__ == '__main__':
    if len(sys.argv) != 2:
        sys.exit('Give the folder of a data set: python learn_chatter.py data/chatter')
    main(Path(sys.argv[1]))
