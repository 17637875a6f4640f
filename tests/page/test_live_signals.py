"""What a page is shown of samples, against the same taken from all samples at once."""

from __future__ import annotations

import json
import math
import struct

import numpy as np
import pytest

from lathe_chatter.page.live_signals import COUNT, SIGNALS, Envelope, LiveSignals
from lathe_chatter.page.versioned_values import Board, encode_frame
from lathe_chatter.samples import SAMPLE_COLUMNS

RATE = 1e4


def samples(first: int, count: int, *, hertz: float = 137.0, rpm: float = 3000.0) -> np.ndarray:
    """A vibration of 2 um about -3 um with its velocity, as of a lathe of 10 kHz."""
    time = np.arange(first, first + count) / RATE
    block = np.zeros((count, len(SAMPLE_COLUMNS)))
    omega = 2.0 * math.pi * hertz
    for name, values in (
        ('time', time),
        ('spindle_angle', time * rpm / 60.0),
        ('tool_displacement', -3e-6 + 2e-6 * np.sin(omega * time)),
        ('tool_velocity', 2e-6 * omega * np.cos(omega * time)),
        ('workpiece_displacement', 1e-6 * np.cos(omega * time)),
    ):
        block[:, SAMPLE_COLUMNS.index(name)] = values
    return block


@pytest.mark.parametrize('batch', [1, 7, 20, 500, 9999])
def test_an_envelope_is_the_smallest_and_largest_of_each_stretch_however_samples_come(
    batch: int,
) -> None:
    rng = np.random.default_rng(1)
    values = rng.normal(size=(9999, 2))
    envelope = Envelope(20, 2)
    for k in range(0, len(values), batch):
        part = values[k : k + batch]
        envelope.add(np.arange(k, k + len(part)), part)
    first, found = envelope.since(0)
    whole = values[: 20 * (len(values) // 20)].reshape(-1, 20, 2)
    assert first == 0
    np.testing.assert_array_equal(found[0], whole.min(axis=1))
    np.testing.assert_array_equal(found[1], whole.max(axis=1))


def test_an_envelope_keeps_the_newest_and_leaves_open_what_did_not_come() -> None:
    envelope = Envelope(10, 1)
    envelope.add(np.arange(20 * COUNT), np.ones((20 * COUNT, 1)))
    first, found = envelope.since(0)
    assert first == COUNT
    assert found.shape[1] == COUNT - 1  # the newest may yet grow
    later = 20 * COUNT + 30
    envelope.add(np.arange(later, later + 20), np.full((20, 1), 2.0))
    first, found = envelope.since(2 * COUNT - 1)
    np.testing.assert_array_equal(found[0, :, 0], [1.0, np.nan, np.nan, np.nan, 2.0])


def test_signals_count_what_is_lost_and_begin_anew_when_time_does() -> None:
    signals = LiveSignals()
    assert signals.add(samples(0, 500), SAMPLE_COLUMNS)
    assert not signals.add(samples(500, 500), SAMPLE_COLUMNS)
    assert not signals.add(samples(1100, 500), SAMPLE_COLUMNS)
    assert signals.lost == 100
    assert signals.time == pytest.approx(0.1599)
    epoch = signals.epoch
    assert signals.add(samples(0, 500), SAMPLE_COLUMNS)
    assert signals.epoch == epoch + 1
    assert signals.lost == 0


def test_a_closeup_has_the_frequency_the_speed_and_the_turns() -> None:
    signals = LiveSignals()
    for k in range(0, 30_000, 500):
        signals.add(samples(k, 500), SAMPLE_COLUMNS)
    figures, arrays = signals.closeup()
    assert figures['speed'] == pytest.approx(3000.0)
    hertz = figures['hertz']
    assert hertz is not None
    assert np.argmax(arrays['spectrum']) * hertz == pytest.approx(137.0, abs=hertz)
    assert arrays['spectrum'].max() == pytest.approx(2e-6, rel=0.01)
    place, velocity = arrays['tool_turns']
    # On the ellipse of the vibration, at every angle of the spindle that is whole.
    radius = np.hypot((place + 3e-6) / 2e-6, velocity / (2e-6 * 2.0 * math.pi * 137.0))
    np.testing.assert_allclose(radius, 1.0, rtol=1e-3)
    assert 99 <= len(place) <= 103  # 2 s, in whole blocks


def test_a_sensor_that_is_not_there_is_nan_and_stops_nothing() -> None:
    signals = LiveSignals()
    columns = ('time', 'tool_displacement')
    signals.add(samples(0, 5000)[:, [SAMPLE_COLUMNS.index(n) for n in columns]], columns)
    _, found = signals.envelopes[0].since(0)
    assert np.isfinite(found[..., SIGNALS.index('tool_displacement')]).all()
    assert np.isnan(found[..., SIGNALS.index('workpiece_velocity')]).all()
    assert 'tool_turns' not in signals.closeup()[1]


def test_a_board_tells_each_viewer_what_it_has_not_seen() -> None:
    board, one, other = Board(), {}, {}
    board.put('state', 'stable')
    assert board.news(one) == {'state': 'stable'}
    board.put('state', 'stable')
    assert board.news(one) == {}
    board.put('figures', {'margin': 0.2})
    assert board.news(one) == {'figures': {'margin': 0.2}}
    assert board.news(other) == {'state': 'stable', 'figures': {'margin': 0.2}}


def test_a_frame_is_json_and_float32() -> None:
    frame = encode_frame({'a': 'µ'}, {'x': np.arange(3.0), 'y': np.ones((2, 2))})
    (length,) = struct.unpack_from('<I', frame)
    assert length % 4 == 0
    header = json.loads(frame[4 : 4 + length])
    assert header == {'a': 'µ', 'arrays': [['x', 3], ['y', 4]]}
    assert np.frombuffer(frame, '<f4', offset=4 + length).tolist() == [0, 1, 2, 1, 1, 1, 1]
