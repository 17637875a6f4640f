"""The alarm: raised by a score, and ended only when the chatter has."""

from __future__ import annotations

import numpy as np

from lathe_chatter.compiled import compiled
from lathe_chatter.detection.baseline import ARMED, restart_baseline
from lathe_chatter.detection.detector_state import HOPS, WINDOWS, DetectorState

SATURATED = 20
"""Hops for which vibration is as large as it can grow, after which that is an alarm by itself."""
RECENT = 3
"""The window in which chatter that is over must be quiet."""
_QUIET, _CALM, _LASTING = 0.12, 20, 32
"""Part of its peak at which chatter is over, if it is not back at the baseline before; hops for
which it must be so; hops that a peak must last."""


@compiled(borrows=True, inner=True)
def follow_alarm(
    state: DetectorState, strongest_amplitude: float, recent_amplitude: float, by_itself: bool
) -> None:
    """Raise the alarm, or clear it.

    Args:
        state: Changed in place.
        strongest_amplitude: Of the tool, in the newest hops.
        recent_amplitude: Of the tool, in the window `RECENT`.
        by_itself: Whether it is raised without a machine, also by what does not grow.
    """
    now = state.now[0]
    loudest = 0.0
    for j in range(state.motion.shape[1]):
        loudest = max(loudest, abs(state.motion[now.newest, j]))
    state.loudest[now.newest] = loudest
    alarm = now.score >= now.strictness or now.saturated >= SATURATED
    # What is left of a cut that has settled are roundings, and these repeat themselves.
    alarm = alarm and strongest_amplitude > now.smallest_amplitude
    if now.alarmed == 0:
        if alarm:
            now.alarmed, now.since_alarm, now.calm = 1, 0, 0
            now.peak_amplitude, now.peak_motion = strongest_amplitude, loudest
            if by_itself and now.score < now.strictness:
                restart_baseline(state)  # it holds the chatter already
        return
    now.since_alarm += 1
    # A knock is no peak: it has died out within some hops.
    lasting = moving = np.inf
    for back in range(_LASTING):
        lasting = min(lasting, state.amplitudes[(now.newest - back) % HOPS])
        moving = min(moving, state.loudest[(now.newest - back) % HOPS])
    now.peak_amplitude = max(now.peak_amplitude, lasting)
    now.peak_motion = max(now.peak_motion, moving)
    recent_motion = 0.0
    for back in range(WINDOWS[RECENT]):
        recent_motion += state.loudest[(now.newest - back) % HOPS] / WINDOWS[RECENT]
    # Where the alarm came at the level of the noise there is no way down but to the baseline. A
    # tool that alone is quiet, while tool and workpiece still move against each other, has a
    # sensor that has died.
    down = recent_amplitude < _QUIET * now.peak_amplitude
    down = down and recent_motion < _QUIET * now.peak_motion
    down = down or (now.rise < ARMED and now.by_line == 0)
    now.calm = now.calm + 1 if down else 0
    if now.calm >= _CALM:
        now.alarmed = now.saturated = now.by_line = 0
        now.since_break = 0
        restart_baseline(state)
