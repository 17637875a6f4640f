"""Whatever bit is flipped and wherever a file is cut off: nothing wrong is handed out.

`python benchmarks/recording flips truncation` does the same with 2000 and 500 of them.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from support.damage import Held, faults, flipped, held_by, record, truncated

from lathe_chatter.recording import read_run, verify

SEED = int.from_bytes(os.urandom(4), 'little')


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp('whole') / 'run'
    record(folder)
    return folder


@pytest.fixture(scope='module')
def whole(folder: Path) -> Held:
    assert verify(folder).findings == []
    return held_by(read_run(folder))


@pytest.mark.parametrize(('damage', 'count'), [(flipped, 40), (truncated, 15)])
def test_damage_is_found_and_nothing_wrong_handed_out(
    damage: object, count: int, folder: Path, whole: Held, tmp_path: Path
) -> None:
    generator = np.random.default_rng(SEED)
    for _ in range(count):
        where = damage(folder, tmp_path / 'run', generator)  # type: ignore[operator]
        assert [*faults(tmp_path / 'run', whole, tmp_path)] == [], f'{where}, seed {SEED}'
