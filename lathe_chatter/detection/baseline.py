"""What is usual, and what stands out of it: the energy of the resonators over its own baseline.

The baseline is a mean of some seconds that stays a little behind, and stands still while there is
an alarm, a ramp or a disturbance: an innovation of a resonator that no growth explains, or a
force that differs from C w h by much more than usual.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from lathe_chatter.array_types import Array
from lathe_chatter.compiled import compiled
from lathe_chatter.detection.detector_state import (
    BLOCK_COUNT,
    HOPS,
    LAG,
    DetectorState,
)
from lathe_chatter.detection.signal_conditioning import (
    PHASE_MEAN,
    PHASE_SEEN,
    PHASE_VARIANCE,
    PHASES,
)
from lathe_chatter.detection.structured_arrays import Records

_BLOCK, _FEWEST = 10, 10
"""Hops in a block of the baseline, and the fewest blocks that make one."""
_EARLIER, _ENOUGH = 6, 10
"""Newest blocks of the baseline that do not tell how much its energy swings, for what grows swings
as well, and the fewest that do."""
_JUMP = 16.0
"""A disturbance: innovation of a resonator over its usual variance."""
_BEYOND_GROWTH = 1.5
"""Innovation over the energy before that no growth explains."""
_LEAP = 2.0
"""A disturbance: rise of the logarithm of the energy ratio in one hop."""
_PUSH = 12.0
"""A disturbance: misfit of the force in a hop over what is usual."""
ARMED = 1.5
"""Logarithm of the energy ratio under which a disturbance is over."""
_SHORTEST_HOLD, _LONGEST_HOLD = 5, 150
_FORGETTING = 0.01
_RAMP = 3e-3
"""Relative change of speed in `SPEEDS` hops that is a ramp."""
_RAMP_HOLD = 20
_DRIFT = 0.01
"""Relative change of speed since the baseline was heard from which on it is that of another cut:
what is no ramp over so few hops may be one over the hundreds of the baseline."""
_NEW, _BETWEEN, _OLD = 8, 4, 16
"""Hops whose means are compared, and hops between them, to find a step of the mean force."""
_STEP, _STEP_PART = 6.0, 0.04
"""Standard errors, and part of the mean, that make a step; the errors come of few hops."""
_STEP_HOLD = 300
"""Hops until the baseline is that of the new cut."""
_STEADY_LIMIT, _STEADY_SWING, _USUAL_HOP, _MOST_LIMIT = 2.8, 0.55, 0.01, 3.2
"""Logarithm of the energy ratio that is an alarm by itself where the energy swings no more than
that of sensors' noise and hops are so long, s; and the most that is asked otherwise."""
_BY_SWING, _BY_PACE = 1.5, 0.15
"""What is added for each unit of more swing, and for e times as many hops a second."""
SETTLING = 20
"""Hops after which something is known."""
_EVEN, SLOWEST_FALL = 0.5, 0.02
"""Part of the changes of energy that is one even fall, and its rate, 1/s, from which on vibration
dies down: of a limit that is reached the energy varies to and fro, or not at all."""
_FALLEN = 0.95
"""Part of the mean power of a longer time, below which it has fallen whatever it swings by."""


@compiled(borrows=True, inner=True)
def follow_energy(state: DetectorState, newest: int) -> int:
    """Baselines and innovations of the resonators; the strongest bin of the last two hops."""
    now = state.now[0]
    new, before = state.motion[newest], state.motion[newest - 1]
    free = now.alarmed == 0 and now.holding == 0 and now.ramping == 0
    known = now.blocks >= _FEWEST + LAG
    strongest, most, jump = 0, -np.inf, 0.0
    for j in range(new.size):
        energy = new[j].real ** 2 + new[j].imag ** 2
        cross, square = state.usual[0, j], state.usual[1, j].real
        expected = before[j] * cross / square if square > 0.0 else 0j
        off = new[j] - expected
        innovation = off.real**2 + off.imag**2
        if free:
            share = max(_FORGETTING, 1.0 / (now.hops_seen + 1.0))
            state.usual[0, j] += share * (new[j] * before[j].conjugate() - cross)
            state.usual[1, j] += share * (before[j].real ** 2 + before[j].imag ** 2 - square)
            state.usual[2, j] += share * (innovation - state.usual[2, j])
            state.blocks[0, j] += energy / _BLOCK
        mean = 0.5 * (energy + before[j].real ** 2 + before[j].imag ** 2)
        level = math.log(max(mean, 1e-300) / state.baseline[j]) if known else mean
        if level > most:
            strongest, most, jump = j, level, 0.0
            # Growth is no jump: it stays in proportion to what was there.
            if state.usual[2, j].real > 0.0 and innovation > _BEYOND_GROWTH * abs(before[j]) ** 2:
                jump = innovation / state.usual[2, j].real
    leapt = known and most - now.rise > _LEAP
    now.rise = most if known else np.nan
    now.since_jump += 1
    now.hold_ended = 0
    if now.alarmed != 0:
        now.holding = 0
    if now.holding != 0:
        now.holding += 1
        calm = most < ARMED and now.since_jump > _SHORTEST_HOLD
        if now.holding > _LONGEST_HOLD:
            restart_baseline(state)
            now.hold_ended = 1
        elif calm or not known:
            now.holding = 0
    if (jump > _JUMP or leapt) and now.hops_seen > SETTLING:
        hold(now)
    if free:
        now.block_fill += 1
        if now.block_fill == _BLOCK:
            _close_block(state)
    return strongest


@compiled(borrows=True, inner=True)
def follow_lines(state: DetectorState, newest: int) -> int:
    """Mean power of every resonator, and of its square; the loudest of them."""
    now = state.now[0]
    loudest, most = 0, -1.0
    for j in range(state.line.shape[1]):
        share = max(state.line_shares[j], 1.0 / (now.hops_seen + 1.0))
        sample = state.motion[newest, j]
        power = sample.real**2 + sample.imag**2
        state.line[0, j] += share * (power - state.line[0, j])
        state.line[1, j] += share * (power**2 - state.line[1, j])
        if state.line[0, j] > most:
            loudest, most = j, state.line[0, j]
    return loudest


@compiled(borrows=True, inner=True)
def hold(now: Any) -> None:
    """Take no rise of energy for chatter until the disturbance is over."""
    now.since_jump = 0
    if now.alarmed == 0:
        now.holding = max(now.holding, 1)


@compiled(borrows=True, inner=True)
def _close_block(state: DetectorState) -> None:
    """Put the block that is full behind the others and renew the baseline."""
    blocks, now = state.blocks, state.now[0]
    for row in range(blocks.shape[0] - 1, 0, -1):
        for j in range(blocks.shape[1]):  # a whole row takes 4 s more to compile
            blocks[row, j] = blocks[row - 1, j]
        state.block_speeds[row] = state.block_speeds[row - 1]
    blocks[0] = 0.0
    state.block_speeds[1] = state.speeds[0]
    now.block_fill = 0
    now.blocks = min(now.blocks + 1, BLOCK_COUNT + LAG)
    count = now.blocks - LAG
    if count >= _FEWEST:
        for j in range(state.baseline.size):
            total = 0.0
            for row in range(1 + LAG, 1 + LAG + count):
                total += blocks[row, j]
            state.baseline[j] = max(total / count, state.least[j])
        now.swing = _swing(blocks, 1 + LAG + _EARLIER, 1 + LAG + count)
        now.usual_speed = state.block_speeds[1 + LAG : 1 + LAG + count].mean()


@compiled(borrows=True, inner=True)
def _swing(blocks: Array, first: int, end: int) -> float:
    """Spread of the energy of some blocks over its mean, on average over the resonators.

    White noise has 0.5; that of a mode which it drives has more, the less it is damped.
    """
    count = end - first
    if count < _ENOUGH:
        return np.nan
    swing = 0.0
    for j in range(blocks.shape[1]):
        mean = square = 0.0
        for row in range(first, end):
            mean += blocks[row, j] / count
            square += blocks[row, j] ** 2 / count
        if mean > 0.0:
            swing += math.sqrt(max(square - mean**2, 0.0)) / mean / blocks.shape[1]
    return swing


@compiled(borrows=True, inner=True)
def has_drifted(state: DetectorState) -> bool:
    """Whether the baseline is that of another speed."""
    speed, usual = state.speeds[0], state.now[0].usual_speed
    return bool(abs(speed - usual) > _DRIFT * usual)


@compiled(borrows=True, inner=True)
def is_another_cut(state: DetectorState) -> bool:
    """Whether the baseline may be that of another cut."""
    return bool(state.now[0].stepped != 0 or has_drifted(state))


@compiled(borrows=True, inner=True)
def energy_limit(state: DetectorState, settings: Any) -> float:
    """Logarithm of the energy ratio that is an alarm by itself.

    Where no machine is told, quick bands hear the swelling of a slow mode, too, which their
    baselines are too short to know.
    """
    swing = state.now[0].swing
    if settings.has_machine == 0 or swing != swing or is_another_cut(state):
        return _MOST_LIMIT
    limit: float = _STEADY_LIMIT + _BY_SWING * max(swing - _STEADY_SWING, 0.0)
    limit += _BY_PACE * max(math.log(_USUAL_HOP / settings.period), 0.0)
    return min(limit, _MOST_LIMIT)


@compiled(borrows=True, inner=True)
def restart_baseline(state: DetectorState) -> None:
    """What was usual is so no more."""
    now = state.now[0]
    now.blocks = now.block_fill = now.holding = 0
    state.blocks[0] = 0.0
    state.baseline[:] = np.nan


@compiled(borrows=True, inner=True)
def growth_by_energy(
    state: DetectorState, newest: int, bin_: int, length: int, period: float, pole: complex
) -> tuple[float, float, float]:
    """Growth rate, its error and angular frequency of a resonator over some hops."""
    cross, square, power = 0j, 0.0, 0.0
    for back in range(length):
        now = state.motion[(newest - back) % HOPS, bin_]
        before = state.motion[(newest - back - 1) % HOPS, bin_]
        cross += now * before.conjugate()
        square += before.real**2 + before.imag**2
        power += now.real**2 + now.imag**2
    if square <= 0.0 or cross == 0j:
        return np.nan, np.nan, np.nan
    ratio = cross / square
    size = abs(ratio)
    misfit = max(power - size**2 * square, 1e-9 * power) / max(length - 2.0, 1.0)
    error = math.sqrt(0.5 * misfit / square) / size / period
    turn = ratio / pole
    return math.log(size) / period, error, math.atan2(turn.imag, turn.real) / period


@compiled(borrows=True, inner=True)
def dies_down(state: DetectorState, newest: int, length: int, settings: Any, stable: bool) -> bool:
    """Whether the loudest resonator falls evenly, as vibration that is left to itself does.

    Or falls at all, where the cut is known to be stable.
    """
    loudest, most = 0, -1.0
    for j in range(state.motion.shape[1]):
        sample = state.motion[newest, j]
        energy = sample.real**2 + sample.imag**2
        if energy > most:
            loudest, most = j, energy
    mean = square = trend = 0.0
    for back in range(length):
        sample = state.motion[(newest - back) % HOPS, loudest]
        energy = sample.real**2 + sample.imag**2
        mean += energy / length
        square += energy**2 / length
        trend += energy * (0.5 * (length - 1) - back) / length
    if settings.has_machine == 0 and mean < _FALLEN * state.line[0, loudest]:
        return True
    fall = -trend / ((length**2 - 1.0) / 12.0)
    even = stable or -trend * fall > _EVEN * (square - mean**2)
    return even and fall > 2.0 * SLOWEST_FALL * settings.period * mean


@compiled(borrows=True, inner=True)
def follow_phase(state: DetectorState, phases: Array) -> None:
    """Once-per-turn spread and what part of all vibration it is."""
    within = mean = total = 0.0
    least = np.inf
    for place in range(PHASES):
        within += phases[PHASE_VARIANCE, place] / PHASES
        mean += phases[PHASE_MEAN, place] / PHASES
        least = min(least, phases[PHASE_SEEN, place])
    for place in range(PHASES):
        total += (phases[PHASE_MEAN, place] - mean) ** 2 / PHASES
    now = state.now[0]
    now.spread = math.sqrt(within)
    now.synchronous_amplitude = math.sqrt(2.0 * total)
    known = least >= 4.0 and within + total > 0.0
    now.once_per_turn = within / (within + total) if known else np.nan


@compiled(borrows=True, inner=True)
def follow_speed(state: DetectorState, speed: float, hops_a_turn: float) -> None:
    """Notice ramps; they are over when a turn has passed, and what was usual is so no more."""
    speeds, now = state.speeds, state.now[0]
    oldest = speeds[-1]
    for place in range(speeds.size - 1, 0, -1):
        speeds[place] = speeds[place - 1]
    speeds[0] = speed
    if now.ramping != 0:
        now.ramping -= 1
        if now.ramping == 0 and now.alarmed == 0:
            restart_baseline(state)
        elif now.ramping == 0:
            now.since_alarm = -1  # another cut: what is known of it begins with the next hop
    if oldest > 0.0 and abs(speed / oldest - 1.0) > _RAMP:
        now.ramping = int(_RAMP_HOLD + hops_a_turn)


@compiled(borrows=True, inner=True)
def follow_push(state: DetectorState, products: Records, newest: int) -> None:
    """Notice a step of the mean force: another cut, whose vibration may stay larger than before.

    Args:
        state: Changed in place.
        products: Of the last hops (HOPS, PRODUCTS_SIZE), as a ring.
        newest: Its newest place.
    """
    now = state.now[0]
    now.stepped = max(now.stepped - 1, 0)
    if now.hops_seen < SETTLING + _NEW + _BETWEEN + _OLD:
        return
    new = old = new_square = old_square = 0.0
    for back in range(_NEW + _BETWEEN + _OLD):
        mean = products[(newest - back) % HOPS].tool_mean
        if back < _NEW:
            new += mean / _NEW
            new_square += mean**2 / _NEW
        elif back >= _NEW + _BETWEEN:
            old += mean / _OLD
            old_square += mean**2 / _OLD
    variance = max(new_square - new**2, 0.0) / _NEW + max(old_square - old**2, 0.0) / _OLD
    if abs(new - old) > max(_STEP * math.sqrt(variance), _STEP_PART * abs(old)):
        now.stepped = _STEP_HOLD


@compiled(borrows=True, inner=True)
def follow_breaks(now: Any, products: Any, settings: Any) -> None:
    """Notice that the tool may leave the cut, where no C w tells its force, until that is over."""
    if products.outputs >= 2.0 and now.alarmed == 0:
        pulsation = 2.0 / settings.gain * math.sqrt(products.force_force / products.outputs)
        if now.push > 0.0 and pulsation > settings.tool_stiffness * now.push:
            now.since_break = 0
            return
    if now.since_break > 0 or now.holding == 0:
        now.since_break += 1


@compiled(borrows=True, inner=True)
def follow_misfit(state: DetectorState, products: Any, clear: bool) -> None:
    """What the force usually differs by from C w h, while nothing happens."""
    now = state.now[0]
    if products.outputs < 2.0 or products.chip_chip <= 0.0:
        return
    if now.alarmed != 0 or not now.cutting > 0.0:
        return
    slope = now.cutting
    misfit = products.force_force - 2.0 * slope * products.force_chip
    misfit = max(misfit + slope**2 * products.chip_chip, 0.0) / products.outputs
    if now.misfits_seen >= 20.0 and misfit > _PUSH * now.usual_misfit and clear:
        hold(now)
    if now.misfits_seen < 20.0:
        now.misfits_seen += 1.0
        old = now.usual_misfit if now.misfits_seen > 1.0 else 0.0
        now.usual_misfit = old + (misfit - old) / now.misfits_seen
    else:
        # A jump is no quiet cutting; what stays, becomes usual.
        now.usual_misfit += _FORGETTING * (min(misfit, 8.0 * now.usual_misfit) - now.usual_misfit)
