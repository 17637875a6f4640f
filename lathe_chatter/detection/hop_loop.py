"""One hop after the other: signals, identification and judgement in one compiled loop."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from lathe_chatter.array_types import Array
from lathe_chatter.compiled import compiled
from lathe_chatter.detection.cut_identification import (
    forget,
    identify,
    noise_sums,
    rightmost_in_band,
)
from lathe_chatter.detection.decision import judge
from lathe_chatter.detection.detector_state import (
    CHATTER,
    HOPS,
    IDLE,
    REJECTED,
    UNCHECKED,
    WINDOWS,
    DetectorState,
)
from lathe_chatter.detection.filter_design import Kernels
from lathe_chatter.detection.machine_check import take_hop
from lathe_chatter.detection.signal_conditioning import Memory, follow
from lathe_chatter.detection.structured_arrays import Records

_REFERENCE = 3
_STANDING = 20
"""Hops without a turn after which an alarm is over."""
_ROOT_EVERY, _NEW_CUT = 8, 12
"""Hops from one search of the rightmost root to the next, and hops after a jump with one each."""
_CLEAR = 0.4
"""Part of the signal that is no noise, from which on an identified cut is followed."""
_DEEPER = 1.3
"""Times the identified C w: the cut whose rightmost root is followed too."""
_NOISE_HOPS = 32
_RENEWED = 20.0
"""Turns after which the means over turns are those of a cut that the tool had left."""
_FIT_AFTER, _FIT_HOPS = 100, 250
"""Hops until the means over turns have settled, and in a block of the fit of the machine."""


@compiled(borrows=True, inner=True)
def _powers(products: Records, newest: int, windows: Records) -> None:
    """Without a model: the tool's power in each window."""
    for number in range(WINDOWS.size):
        power = count = 0.0
        for back in range(WINDOWS[number]):
            hop = products[(newest - back) % HOPS]
            power += hop.tool_power
            count += hop.outputs
        forget(windows[number])
        windows[number].outputs = count
        windows[number].tool_power = power / count if count > 0.0 else np.nan


@compiled(borrows=True, inner=True)
def _noise(
    products: Records, now: Any, settings: Any, kernels: Kernels, speed: float, noise: Any
) -> None:
    """What the noise of the sensors adds, by the third differences of the last hops."""
    tool = workpiece = 0.0
    for back in range(_NOISE_HOPS):
        tool += products[(now.newest - back) % HOPS].tool_noise
        workpiece += products[(now.newest - back) % HOPS].workpiece_noise
    share = 1.0 / (_NOISE_HOPS * settings.thinning)
    thinned = settings.rate / settings.thinning
    noise_sums(kernels.spill, tool * share, workpiece * share, thinned / speed, noise)


@compiled(borrows=True, inner=True)
def _follow_roots(now: Any, windows: Records, mechanics: Any, speed: float) -> None:
    """The rightmost roots of the cut as it is, and of a deeper one."""
    reference = windows[_REFERENCE]
    if not reference.clearness > _CLEAR:
        return
    stiffness = min(max(reference.stiffness, mechanics.softest), mechanics.stiffest)
    cutting = max(reference.cutting, 0.0)
    now.root = rightmost_in_band(mechanics, cutting, stiffness, 1.0 / speed, now.root)
    now.root_cutting, now.root_stiffness = cutting, stiffness
    # A value that is too low by chance leads to the mode that is not in danger.
    longest = windows[WINDOWS.size - 1].cutting
    deeper = _DEEPER * (max(cutting, longest) if longest > 0.0 else cutting)
    now.deeper_root = rightmost_in_band(mechanics, deeper, stiffness, 1.0 / speed, now.deeper_root)


@compiled()
def take_hops(
    block: Array, settings_: Records, mechanics_: Records, noise_: Records, total_: Records,
    kernels: Kernels, memory: Memory, products: Records, windows: Records, plain: Records,
    state: DetectorState,
) -> int:  # fmt: skip
    """Take in hops until the samples are used up, or the caller has to look.

    That is while the alarm is young, and where a block of the machine's fit is full.

    Args:
        block: Spindle angle, tool and workpiece displacement (n, 3), n a multiple of the hop.
        settings_: One record of `signal_conditioning.SETTINGS`.
        mechanics_: From `cut_identification.mechanics_of`.
        noise_: One record of `cut_identification.NOISE_SUMS`, to work in.
        total_: One record of `signal_conditioning.HOP_SUMS`, to work in.
        kernels: From `filter_design.design`.
        memory: Of the signals, changed in place.
        products: Sums of the last hops (HOPS,), a ring, changed in place.
        windows: What they say by the machine (windows,), written.
        plain: What they say without, written.
        state: Of the judgement, changed in place.

    Returns:
        Hops taken.
    """
    settings, mechanics, now = settings_[0], mechanics_[0], state.now[0]
    noise, total = noise_[0], total_[0]
    done, hop = 0, settings.hop
    model = settings.has_machine != 0 and settings.believed != REJECTED
    count = block.shape[0] // hop
    turns, centres = memory.turns, memory.centres
    if centres[0] == 0.0:  # once: it takes as long as a hop
        for j in range(centres.size):
            pole = kernels.poles[j]
            turns[j] = pole ** (hop // settings.thinning)
            centres[j] = math.atan2(pole.imag, pole.real) * (settings.rate / settings.thinning)
    lengths = WINDOWS.copy()
    while done < count:
        samples = block[done * hop : (done + 1) * hop]
        done += 1
        between = 1 <= now.holding <= 2 or now.ramping != 0
        between = between or (now.alarmed != 0 and settings.believed != UNCHECKED)
        between = between or now.since_break * settings.period * state.speeds[0] < _RENEWED
        if now.since_break == 0:
            memory.counts[0].first_angle = samples[0, 0]
        seen = now.amplitude > now.smallest_amplitude  # roundings fit no machine
        take_hop(memory.fit, seen and not between and now.hops_seen > _FIT_AFTER)
        newest = (now.newest + 1) % HOPS
        now.newest = newest
        follow(samples, settings, kernels, memory, products[newest])
        for j in range(memory.resonators.size):  # a whole row takes 4 s more to compile
            state.motion[newest, j] = memory.resonators[j]
        speed = (samples[hop - 1, 0] - samples[0, 0]) / (hop - 1) * settings.rate
        if settings.has_angle != 0 and speed < settings.slowest_turns:
            # A spindle that stands cuts nothing; one hop of it may be a sensor that died.
            now.calm += 1
            if now.calm > _STANDING:
                now.alarmed = 0
            now.state, now.hops_seen = CHATTER if now.alarmed != 0 else IDLE, 0
            state.speeds[:] = 0.0
            state.speeds[0] = speed
            continue
        if products[newest].outputs < 1.0:
            state.speeds[0] = speed
            continue
        if model:
            _noise(products, now, settings, kernels, speed, noise)
            # After a jump there may be another cut: only what came since tells of it.
            since = max(1, now.holding - 1) if now.holding > 0 else HOPS
            for number in range(WINDOWS.size):
                lengths[number] = min(WINDOWS[number], since)
            identify(products, newest, lengths, mechanics, noise, 1.0 / speed, now, total, windows)
            if now.hops_seen % _ROOT_EVERY == 0 or 0 < now.holding <= _NEW_CUT:
                _follow_roots(now, windows, mechanics, speed)
        was_alarmed = now.alarmed != 0
        if settings.has_machine == 0:
            alone = abs(memory.resonators[now.strongest])
            alone *= 1.0 - abs(kernels.poles[now.strongest])
            products[newest].tool_power = products[newest].outputs * alone**2
        _powers(products, newest, plain)
        judge(state, settings, products, windows, plain, memory.phases, turns, centres, speed)
        now.fit_hops += 1
        another = now.holding == 1 or (was_alarmed and now.alarmed == 0)
        if settings.has_machine != 0 and (now.fit_hops >= _FIT_HOPS or another):
            now.fit_hops, now.fit_is_due = 0, 1
            break
        if now.alarmed != 0 and now.since_alarm <= 64:
            break
    return done
