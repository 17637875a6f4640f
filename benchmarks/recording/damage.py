"""What damage to a file costs: flipped bits, and ends cut off at every record."""

from __future__ import annotations

import shutil
import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from runs import START, TICK, block, samples_topic, scratch

from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.recording import RunReadError, RunWriter, read_run, recover, verify
from lathe_chatter.recording.provenance import IDENTITY, identity

_BLOCKS, _PER_COMMIT = 1000, 125
_CHUNK = 6


def _whole(place: Path) -> tuple[bytes, set[bytes]]:
    """A file of 2 s in 8 chunks, and every sample in it."""
    lathe = VirtualLathe()
    rows: set[bytes] = set()
    with RunWriter(place / 'whole') as writer:
        writer.note(IDENTITY, identity())
        writer.add_topic(samples_topic())
        for k in range(_BLOCKS):
            samples = lathe.advance(20)
            rows |= {row.tobytes() for row in samples}
            told = START + k * TICK
            data = block(samples)
            writer.write('/lathe/samples', data, log_time=told, publish_time=told, sequence=k + 1)
            if k % _PER_COMMIT == _PER_COMMIT - 1:
                writer.commit()
    return (place / 'whole' / 'whole_0.mcap').read_bytes(), rows


def _records(data: bytes) -> Iterator[tuple[int, int]]:
    """Opcode and end of each record."""
    at = 8
    while at < len(data) - 8:
        opcode, length = struct.unpack_from('<BQ', data, at)
        at += 9 + length
        yield opcode, at


def _wrong(path: Path, rows: set[bytes]) -> tuple[int, int]:
    """Samples that are handed out without an error, and wrong ones among them."""
    try:
        columns = read_run(path).samples().columns
    except RunReadError:
        return 0, 0
    found = [row.tobytes() for row in np.column_stack(list(columns.values()))]
    return len(found), sum(row not in rows for row in found)


def _recovered(file: Path, place: Path) -> int:
    """Messages that recover saves."""
    shutil.rmtree(place, ignore_errors=True)
    return recover(file, place).messages['/lathe/samples']


def flips(count: int) -> None:
    """Flip one bit, many times."""
    generator = np.random.default_rng()
    noticed = wrong = 0
    fewest = _BLOCKS
    with scratch() as place:
        whole, rows = _whole(place)
        file = place / 'file_0.mcap'
        for at in generator.integers(len(whole), size=count).tolist():
            data = bytearray(whole)
            data[at] ^= 1 << int(generator.integers(8))
            file.write_bytes(data)
            noticed += not verify(file).complete
            wrong += _wrong(file, rows)[1]
            fewest = min(fewest, _recovered(file, place / 'saved'))
            wrong += _wrong(place / 'saved', rows)[1]
    print(
        f'flips: verify notices {noticed} of {count}; {wrong} wrong samples handed out; recovered '
        f'at least {fewest} of {_BLOCKS} messages, of which a chunk has {_PER_COMMIT}'
    )


def truncation() -> None:
    """Cut a file at the end of every record."""
    noticed = complete = count = wrong = 0
    with scratch() as place:
        whole, rows = _whole(place)
        file = place / 'file_0.mcap'
        chunks = 0
        for opcode, end in _records(whole):
            chunks += opcode == _CHUNK
            if end >= len(whole) - 8:
                break
            file.write_bytes(whole[:end])
            count += 1
            noticed += not verify(file).complete
            complete += _recovered(file, place / 'saved') == chunks * _PER_COMMIT
            wrong += _wrong(file, rows)[1] + _wrong(place / 'saved', rows)[1]
    print(
        f'truncation: verify notices {noticed} of {count}; every chunk before the cut is '
        f'recovered in {complete} of {count}; {wrong} wrong samples handed out'
    )
