"""The check that a metadata record carries: one flipped bit anywhere in it is found."""

from __future__ import annotations

from pathlib import Path

from mcap.reader import make_reader

from lathe_chatter.errors import RunReadError
from lathe_chatter.recording import RunWriter, read_run
from lathe_chatter.recording.provenance import CHECK, checked, sealed

NAME = 'lathe_chatter/parameters/lathe'
VALUES = {'parameters': '{"depth_of_cut": 0.0005}', 'log_time': '17'}


def test_a_record_is_sealed_by_its_name_and_all_its_values() -> None:
    values = sealed(NAME, VALUES)
    assert checked(NAME, values) is True
    assert checked(NAME, dict(reversed(values.items()))) is True
    assert checked(f'{NAME}2', values) is False
    assert checked(NAME, {**values, 'log_time': '16'}) is False
    assert checked(NAME, {**values, 'more': ''}) is False
    assert checked(NAME, {k: v for k, v in values.items() if k != 'log_time'}) is False
    assert checked(NAME, sealed(NAME, values)) is True  # a copy of a record may be sealed again


def test_what_has_no_check_is_said_to_have_none() -> None:
    assert checked(NAME, VALUES) is None


def test_no_flipped_bit_of_a_note_is_handed_out(tmp_path: Path) -> None:
    with RunWriter(tmp_path / 'run') as writer:
        writer.note(NAME, VALUES)
    file = tmp_path / 'run' / 'run_0.mcap'
    data = file.read_bytes()
    with file.open('rb') as stream:
        written = {each.name: each.metadata for each in make_reader(stream).iter_metadata()}
    assert {k: v for k, v in written[NAME].items() if k != CHECK} == VALUES
    assert [note.values for note in read_run(file).notes() if note.name == NAME] == [VALUES]
    start = data.index(NAME.encode())
    end = data.index(b'17', start) + 2
    found = 0
    for place in range(start, end):
        damaged = bytearray(data)
        damaged[place] ^= 1 << place % 8
        file.write_bytes(damaged)
        try:
            handed_out = read_run(file).notes()
        except RunReadError:
            found += 1
            left = read_run(file, damaged=True)
            assert NAME not in [note.name for note in left.notes()]
            assert left.damage
            continue
        # A length that reaches beyond the record does not alter what it says.
        assert [note.values for note in handed_out if note.name == NAME] == [VALUES]
    assert found > 0.9 * (end - start)
