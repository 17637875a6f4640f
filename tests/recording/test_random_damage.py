"""Whatever bit is flipped and wherever a file is cut off: nothing wrong is handed out.

`python benchmarks/recording flips truncation` does the same with 2000 and 500 of them.
"""

from __future__ import annotations

import os
import shutil
import struct
from pathlib import Path

import numpy as np
import pytest
from support.damage import Held, faults, flipped, held_by, record, truncated

from lathe_chatter.recording import read_run, verify
from lathe_chatter.recording.run_timeline import read_timeline

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


def test_a_record_that_becomes_one_of_another_kind_is_missed(
    folder: Path, whole: Held, tmp_path: Path
) -> None:
    """One bit makes of a chunk a channel or a private record, of an index a message."""
    data = (folder / 'run_0.mcap').read_bytes()
    places = {0x06: 0, 0x07: 0, 0x0C: 0}  # the first chunk, message index and note
    place = 8
    while place < len(data) - 8:
        opcode, length = struct.unpack_from('<BQ', data, place)
        places[opcode] = places.get(opcode) or place
        place += 9 + length
    shutil.copytree(folder, tmp_path / 'run')
    for opcode in (0x06, 0x07, 0x0C):
        for bit in range(8):
            damaged = bytearray(data)
            damaged[places[opcode]] ^= 1 << bit
            (tmp_path / 'run' / 'run_0.mcap').write_bytes(damaged)
            where = f'bit {bit} of opcode {opcode}'
            assert [*faults(tmp_path / 'run', whole, tmp_path)] == [], where


def test_two_looks_at_a_damaged_run_may_find_another_rest(tmp_path: Path) -> None:
    """A flipped bit can have a chunk unpacked from stale memory: it is sound at one look only."""
    record(tmp_path / 'whole')
    run = read_run(tmp_path / 'whole', damaged=True)
    file = run.files[0]
    chunk = run.opened[0].known.chunks[1]  # the first with samples
    hit = bytearray(file.read_bytes())
    hit[chunk.offset + chunk.length // 2] ^= 1

    asked: list[str] = []

    def damage(topic: str) -> bool:  # when some chunks were read
        asked.append(topic)
        if len(asked) == 20:
            file.write_bytes(hit)
        return False

    whole, _ = read_timeline(read_run(tmp_path / 'whole'), '/lathe/samples')
    timeline, _ = read_timeline(run, '/lathe/samples', damage)
    assert len(timeline.places) == len(timeline.rows) < len(whole.rows)
    assert set(timeline.last.tolist()) < set(whole.last.tolist())
