"""A recorder that was kept from its messages: how often, and for how long, is in the run."""

from __future__ import annotations

from pathlib import Path

import pytest
from support.recorded import number, topic

from lathe_chatter.recording import RunWriter, verify
from lathe_chatter.recording.provenance import RECEPTION
from lathe_chatter.recording.recorder_stalls import ReceiveStalls


@pytest.mark.parametrize(
    ('times', 'expected'),
    [
        ([0.0, 0.04, 0.08], []),
        ([0.0, 0.04, 0.29], ['once, for 0.25 s at most']),
        ([0.0, 0.2, 0.24, 1.574], ['2 times, for 1.33 s at most']),
    ],
)
def test_verify_tells_how_often_and_how_long(
    times: list[float], expected: list[str], tmp_path: Path
) -> None:
    stalls = ReceiveStalls()
    for time in times:
        stalls.note(time)
    with RunWriter(tmp_path / 'run') as writer:
        writer.add_topic(topic('/numbers'))
        writer.write('/numbers', number(1), log_time=1, publish_time=1, sequence=1)
        writer.note(RECEPTION, stalls.values())
    found = verify(tmp_path / 'run')
    said = [each.text for each in found.findings if 'took no messages' in each.text]
    assert len(said) == len(expected)
    for text, part in zip(said, expected, strict=True):
        assert f'The recorder took no messages for more than 0.1 s {part};' in text
    assert found.complete
