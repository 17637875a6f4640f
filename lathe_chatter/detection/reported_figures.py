"""What is handed out: the state, and the figures of the window that knows best."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from lathe_chatter.compiled import compiled
from lathe_chatter.detection.baseline import SETTLING
from lathe_chatter.detection.detector_state import (
    CHATTER,
    FORCED,
    HOPS,
    IDLE,
    STABLE,
    UNKNOWN,
    WATCH,
    WINDOWS,
    DetectorState,
)
from lathe_chatter.detection.signal_conditioning import mean_kept
from lathe_chatter.detection.structured_arrays import Records

_WATCH = 0.75
_KNOWN, _LINE_KNOWN = HOPS + 32, 1.75
"""Hops after which a cut may be called stable, and, without a machine, times over which the power
of a line is averaged: chatter that grew before anybody listened is flagged by then."""
ONSET = 8
"""Hops before the alarm in which chatter may have begun: an older window has two cuts in it."""
_CUTS, _PUSHED = 4.0, 32
"""Standard errors from which on a force is one, and hops over which its mean is taken."""
_NO_PUSH, _DOUBT = 0.25, 2.0
"""Of the mean push that there was: less is none; standard errors by which it has to be less."""
_FORGOTTEN = 0.94
"""Of a larger push, per hop: what falls more slowly is the drift of a sensor, no end of a cut."""
_LEFT, _LEFT_OF_CHATTER, _SHOWN = 0.5, 0.1, 4
"""Part that must be left of a vibration that is not the spindle's own; hops that are shown."""
_MEAN_TIME, _PROPORTION, _NO_MEAN = 2.0, 4.0, 0.01
"""s over which means are taken; change over a turn, as an effective value, over the mean from
which on the tool may leave the cut, and mean over change below which the sensor has none. A force
that is never negative moves a mode by no more than 1 / damping ratio times the mean."""
_STAYS = 4.0
"""s for which that stands where the mean passes through 0."""
_HEARD, _SURE, _NEXT_TO_NOTHING = 0.15, 3.0, 0.005
"""Part of the signal that is no noise; standard errors; C w over the stiffness of the tool."""


@compiled(borrows=True, inner=True)
def is_cutting(now: Any, known: Any, products: Records, settings: Any) -> bool:
    """Whether anything may be cut: only where nothing is for sure, the state is idle.

    A tool that once was pushed aside on average and is no more cuts nothing. Who never was has
    sensors without a mean, or there is none: then nothing is cut where nothing but the sensors'
    noise is heard, or C w is surely next to nothing.
    """
    mean = squares = 0.0
    for back in range(_PUSHED):
        place = products[(now.newest - back) % HOPS].tool_mean
        mean += place / _PUSHED
        squares += place**2 / _PUSHED
    # Neighbours vibrate together: the mean of 32 is about as sure as that of 8.
    error = math.sqrt(max(squares - mean**2, 0.0) / (_PUSHED / 4.0))
    if abs(mean) > _CUTS * error:
        now.push = max(_FORGOTTEN * now.push, abs(mean))
        return True
    if settings.has_machine != 0 and known.cutting > _CUTS * known.cutting_error:
        return True
    if now.push > 0.0:
        return bool(abs(mean) + _DOUBT * error > _NO_PUSH * now.push)
    if settings.has_machine == 0:
        return True
    heard = known.clearness > _HEARD
    most = known.cutting + _SURE * known.cutting_error
    return bool(heard and not most < _NEXT_TO_NOTHING * settings.tool_stiffness)


@compiled(borrows=True, inner=True)
def weigh_vibration(now: Any, newest: Any, settings: Any) -> None:
    """Whether the tool vibrates by so much more than it is pushed aside that it may leave the cut.

    Then the cut may chatter since before anybody listened, at full size and never the same, so
    that nothing rises and nothing is steady.

    Args:
        now: Of the state, changed in place.
        newest: Sums of the newest hop.
        settings: A record of `signal_conditioning.SETTINGS`.
    """
    share = max(settings.period / _MEAN_TIME, 1.0 / now.hops_seen)
    if now.hops_seen == 1:
        now.mean_place = now.mean_power = 0.0
    now.mean_place += share * (newest.tool_mean - now.mean_place)
    now.mean_power += share * (newest.change_power - now.mean_power)
    change, place = math.sqrt(now.mean_power), abs(now.mean_place)
    now.out_of_proportion = max(now.out_of_proportion - 1, 0)
    if change <= _PROPORTION * place or settings.has_angle == 0:  # then the mean is filtered away
        now.out_of_proportion = 0
    elif change < place / _NO_MEAN and now.hops_seen >= _KNOWN:
        now.out_of_proportion = int(_STAYS / settings.period)


@compiled(borrows=True, inner=True)
def state_of(state: DetectorState, settings: Any, cutting: bool, forced: bool) -> int:
    """Which of `estimate.STATES`, by its number."""
    now = state.now[0]
    if now.alarmed != 0:
        return CHATTER
    if now.ramping != 0 or now.hops_seen < SETTLING:
        return UNKNOWN
    if not cutting:
        return IDLE
    if now.score > _WATCH * now.strictness:
        return WATCH
    if forced:
        return FORCED
    known = now.hops_seen >= _KNOWN
    if settings.has_machine == 0:
        known = known and now.hops_seen * state.line_shares[0] > _LINE_KNOWN
    return STABLE if known else UNKNOWN


@compiled(borrows=True, inner=True)
def shown_amplitude(
    now: Any, products: Records, settings: Any, omega: float, speed: float
) -> float:
    """Of the tool's vibration, m; nan where too much of it may be the spindle's own.

    With a machine the tool's motion is freed of its mean over turns, and just after that has begun
    anew of the motion of a turn before, as it is without one: of a vibration that almost repeats
    itself turn after turn little is left then.
    """
    if settings.has_machine == 0 or settings.has_angle == 0:
        keep = 0.0
    else:
        keep = mean_kept(now.since_break * settings.period * speed)
    left = 1.0
    if settings.has_angle != 0:
        cosine = math.cos(omega / speed)
        left = math.sqrt(2.0 * (1.0 - cosine) / (1.0 - 2.0 * keep * cosine + keep**2))
    if now.alarmed != 0:  # chatter is one line, of which that tells how much is left
        left = max(left, _LEFT_OF_CHATTER) if left == left else 1.0
    elif not left > _LEFT:
        return np.nan
    power = count = 0.0
    for back in range(_SHOWN):
        hop = products[(now.newest - back) % HOPS]
        power += hop.tool_power if settings.has_machine == 0 else hop.free_power
        count += hop.outputs
    amplitude: float = 2.0 / left / settings.gain * math.sqrt(power / max(count, 1.0))
    return amplitude


@compiled(borrows=True, inner=True)
def write_figures(
    state: DetectorState, windows: Records, wave: tuple[float, float, float], model: bool,
    amplitude: float,
) -> None:  # fmt: skip
    """Hand out the figures of the window that knows the growth rate best."""
    now = state.now[0]
    now.amplitude = amplitude
    if not (amplitude > now.smallest_amplitude or now.alarmed != 0):
        # What is left of a cut that has settled are roundings, from which nothing is known.
        now.growth = now.growth_error = now.omega = np.nan
        now.cutting = now.stiffness = np.nan
        return
    best = -1
    alarmed, since = now.alarmed != 0, now.since_alarm
    for number in range(windows.shape[0]):
        if alarmed and best >= 0 and WINDOWS[number] > since + ONSET:
            break
        error = windows[number].growth_error
        if error == error and (best < 0 or error < windows[best].growth_error):
            best = number
    if best < 0:
        now.growth, now.growth_error, now.omega = wave
        now.cutting = now.stiffness = np.nan
        return
    known = windows[best]
    now.growth, now.growth_error = known.growth, known.growth_error
    now.omega = known.angular_frequency
    if model:
        now.cutting, now.cutting_error = known.cutting, known.cutting_error
        now.stiffness, now.stiffness_error = known.stiffness, known.stiffness_error
