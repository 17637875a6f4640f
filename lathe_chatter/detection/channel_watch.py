"""Which channels can be believed: those that give numbers, move, and meet no limit of their range.

A signal that moved by many of its own smallest steps from sample to sample and then repeats one
value for 20 ms stands still: no vibration dies out like that, however coarse the sensor is. One
that meets the same largest or smallest value again and again, at full speed, is cut off there.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from lathe_chatter.array_types import Array
from lathe_chatter.compiled import compiled
from lathe_chatter.detection.structured_arrays import Records, record_type

_CHANNEL = record_type(
    'value pace slow_pace smallest_step entry_step run_since high low bad_at limit_at '
    'angle direction furthest offset',
    'run high_hits low_hits stood_still',
)
_AFTERWARDS = 0.5
"""s that a channel must have been well before it is believed again."""
_STILL, _STILL_SAMPLES = 0.02, 64
"""s and samples of one and the same value that are no vibration."""
_STEPS = 8.0
"""Smallest steps that a signal must have moved in a sample, on average, for that."""
_ROUNDING = 1e-10
"""Steps this small against the value itself are none: a cut without noise comes to rest."""
_PACES = 32.0
"""Samples over which the pace of a signal is followed; the slow one over 32 times as many."""
_LIMIT, _LIMIT_RUN, _LIMIT_HITS, _LIMIT_STEPS = 1.0, 3, 4, 4.0
"""s between meetings of a limit, samples spent at it, meetings, smallest steps it is met with."""
_BACK, _LEAP = 0.5, 0.25
"""Turns back after which a spindle turns the other way, and turns in a sample that none makes."""
_NO_NUMBER, _STANDS_STILL, _AT_LIMIT = 1, 2, 3
CAUSES = {
    _NO_NUMBER: 'is not a number',
    _STANDS_STILL: 'stands still',
    _AT_LIMIT: 'is cut off at a limit of its range',
}
"""What can be wrong with a channel, in words, by number; 0 is nothing."""
_BITS = max(CAUSES).bit_length()
"""Of such a number."""
_NEVER = -1e300


def new_channels() -> Records:
    """Nothing seen of spindle angle, tool and workpiece displacement (3,)."""
    channels = np.zeros(3, _CHANNEL)
    channels['value'] = np.nan
    channels['angle'] = np.nan
    channels['direction'] = 1.0
    channels['smallest_step'] = np.inf
    channels['high'], channels['low'] = -np.inf, np.inf
    channels['bad_at'] = channels['limit_at'] = _NEVER
    return channels


def faults_of(causes: int, names: tuple[str, ...]) -> tuple[str, ...]:
    """What is wrong with channels that should be there, in words.

    Args:
        causes: From `watch_channels`.
        names: Of the channels; empty where there is none.
    """
    if not causes:
        return ()
    numbers = (causes >> _BITS * place & (1 << _BITS) - 1 for place in range(len(names)))
    found = zip(names, numbers, strict=True)
    return tuple(f'{name} {CAUSES[cause]}' for name, cause in found if name and cause)


@compiled(borrows=True, inner=True)
def _is_clipped(channel: Any, value: float) -> bool:
    """Whether a value that has come some times in a row is a limit of the range met once more."""
    smallest = max(channel.smallest_step, _ROUNDING * abs(value))
    fast = channel.entry_step >= _LIMIT_STEPS * smallest
    if value >= channel.high:
        channel.high_hits = channel.high_hits + 1 if value == channel.high and fast else int(fast)
        channel.high = value
        return bool(channel.high_hits >= _LIMIT_HITS)
    if value <= channel.low:
        channel.low_hits = channel.low_hits + 1 if value == channel.low and fast else int(fast)
        channel.low = value
        return bool(channel.low_hits >= _LIMIT_HITS)
    return False


@compiled(borrows=True, inner=True)
def _turned(channel: Any, angle: float) -> float:
    """The spindle angle as it rises, whichever way the spindle turns or its sensor counts."""
    if not abs(angle - channel.angle) < _LEAP:
        channel.furthest = angle
    ahead = channel.direction * (angle - channel.furthest)
    if ahead < -_BACK:
        channel.offset += 2.0 * channel.direction * angle
        channel.direction = -channel.direction
    if ahead > 0.0 or ahead < -_BACK:
        channel.furthest = angle
    channel.angle = angle
    turned: float = channel.direction * angle + channel.offset
    return turned


@compiled(borrows=True, inner=True)
def _causes(channels: Records, time: float) -> int:
    """What is wrong now, as `watch_channels` returns it."""
    causes = 0
    for number in range(3):
        channel = channels[number]
        if time - channel.bad_at < _AFTERWARDS:
            cause = _STANDS_STILL if channel.stood_still != 0 else _NO_NUMBER
            causes += cause << _BITS * number
        elif time - channel.limit_at < _LIMIT:
            causes += _AT_LIMIT << _BITS * number
    return causes


@compiled()
def watch_channels(rows: Array, channels: Records) -> int:
    """Follow the channels; what stands still is made no number, and the angle made to rise.

    Args:
        rows: Time, spindle angle, tool and workpiece displacement, and, written: the sum of
            1, 2 and 4 for each of them that has been well for a while (n, 5).
        channels: From `new_channels`, changed in place.

    Returns:
        What is wrong after the last row: `_BITS` bits for each channel, the lowest for the first:
        0 for nothing, else a number of `CAUSES`.
    """
    for i in range(rows.shape[0]):
        time, well = rows[i, 0], 0.0
        rows[i, 1] = _turned(channels[0], rows[i, 1])
        for number in range(3):
            channel = channels[number]
            value = rows[i, number + 1]
            if not np.isfinite(value):
                channel.bad_at, channel.stood_still = time, 0
                channel.value = np.nan
                continue
            step = abs(value - channel.value)
            if step == 0.0:
                channel.run += 1
                if channel.run == _LIMIT_RUN and number > 0 and _is_clipped(channel, value):
                    channel.limit_at = time
                long = time - channel.run_since > _STILL and channel.run > _STILL_SAMPLES
                if number > 0:
                    least = max(channel.smallest_step, _ROUNDING * abs(value))
                    moved = channel.pace > _STEPS * least
                else:  # a spindle needs time to stop
                    moved = channel.pace > 0.5 * channel.slow_pace
                if long and moved:
                    channel.bad_at, channel.stood_still = time, 1
                    rows[i, number + 1] = np.nan
            elif np.isfinite(step):
                channel.run, channel.run_since = 1, time
                channel.entry_step = step
                channel.smallest_step = min(channel.smallest_step, step)
                channel.pace += (step - channel.pace) / _PACES
                channel.slow_pace += (step - channel.slow_pace) / (32.0 * _PACES)
            else:
                channel.run, channel.run_since = 1, time
            channel.value = value
            # A time that jumps back is another run.
            if not 0.0 <= time - channel.bad_at < _AFTERWARDS:
                well += 2.0**number
        rows[i, 4] = well
    return _causes(channels, rows[-1, 0])
