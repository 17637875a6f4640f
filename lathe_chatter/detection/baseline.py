"""What is usual, and what stands out of it: the energy of the resonators over its own baseline.

The baseline is a mean of some seconds that stays a little behind, and stands still while there is
an alarm, a ramp or a disturbance: an innovation of a resonator that no growth explains, or a
force that differs from C w h by much more than usual.
"""

from __future__ import annotations

import math

import numpy as np

from lathe_chatter.arrays import Array, Integers
from lathe_chatter.compiled import compiled
from lathe_chatter.detection.detector_state import (
    ALARMED,
    BLOCK_COUNT,
    BLOCK_FILL,
    BLOCKS,
    FIGURE_CUTTING,
    FORCED_AMPLITUDE,
    HOLDING,
    HOPS,
    LAG,
    ONCE,
    RAMPING,
    RATIO,
    RISE,
    SEEN,
    SINCE_ALARM,
    SINCE_JUMP,
    STEPPED,
    USUAL,
    USUAL_SEEN,
    Ledger,
)
from lathe_chatter.detection.signals import (
    CHIP_CHIP,
    FORCE_CHIP,
    FORCE_FORCE,
    OUTPUTS,
    PHASE_MEAN,
    PHASE_SEEN,
    PHASE_VARIANCE,
    PHASES,
    TOOL_MEAN,
)

_BLOCK, _FEWEST = 10, 10
"""Hops in a block of the baseline, and the fewest blocks that make one."""
_JUMP = 16.0
"""A disturbance: innovation of a resonator over its usual variance."""
_BEYOND_GROWTH = 1.5
"""Innovation over the energy before that no growth explains."""
_PUSH = 12.0
"""A disturbance: misfit of the force in a hop over what is usual."""
ARMED = 1.5
"""Logarithm of the energy ratio under which a disturbance is over."""
_SHORTEST_HOLD, _LONGEST_HOLD = 5, 150
_FORGETTING = 0.01
_RAMP = 3e-3
"""Relative change of speed in `SPEEDS` hops that is a ramp."""
_RAMP_HOLD = 20
_NEW, _BETWEEN, _OLD = 8, 4, 16
"""Hops whose means are compared, and hops between them, to find a step of the mean force."""
_STEP, _STEP_PART = 6.0, 0.04
"""Standard errors, and part of the mean, that make a step; the errors come of few hops."""
_STEP_HOLD = 300
"""Hops until the baseline is that of the new cut."""
SETTLING = 20
"""Hops after which something is known."""


@compiled()
def follow_energy(ledger: Ledger, newest: int) -> int:
    """Baselines and innovations of the resonators; the strongest bin of the last two hops."""
    flags, numbers = ledger.flags, ledger.numbers
    now, before = ledger.motion[newest], ledger.motion[newest - 1]
    free = flags[ALARMED] == 0 and flags[HOLDING] == 0 and flags[RAMPING] == 0
    known = flags[BLOCKS] >= _FEWEST + LAG
    strongest, most, jump = 0, -np.inf, 0.0
    for j in range(now.size):
        energy = now[j].real ** 2 + now[j].imag ** 2
        cross, square = ledger.usual[0, j], ledger.usual[1, j].real
        expected = before[j] * cross / square if square > 0.0 else 0j
        off = now[j] - expected
        innovation = off.real**2 + off.imag**2
        if free:
            share = max(_FORGETTING, 1.0 / (flags[SEEN] + 1.0))
            ledger.usual[0, j] += share * (now[j] * before[j].conjugate() - cross)
            ledger.usual[1, j] += share * (before[j].real ** 2 + before[j].imag ** 2 - square)
            ledger.usual[2, j] += share * (innovation - ledger.usual[2, j])
            ledger.blocks[0, j] += energy / _BLOCK
        mean = 0.5 * (energy + before[j].real ** 2 + before[j].imag ** 2)
        level = math.log(max(mean, 1e-300) / ledger.baseline[j]) if known else mean
        if level > most:
            strongest, most, jump = j, level, 0.0
            # Growth is no jump: it stays in proportion to what was there.
            if ledger.usual[2, j].real > 0.0 and innovation > _BEYOND_GROWTH * abs(before[j]) ** 2:
                jump = innovation / ledger.usual[2, j].real
    numbers[RISE] = most if known else np.nan
    flags[SINCE_JUMP] += 1
    if flags[HOLDING] != 0:
        flags[HOLDING] += 1
        calm = most < ARMED and flags[SINCE_JUMP] > _SHORTEST_HOLD
        if flags[HOLDING] > _LONGEST_HOLD:
            restart_baseline(ledger)
        elif calm or not known:
            flags[HOLDING] = 0
    if jump > _JUMP and flags[SEEN] > SETTLING:
        hold(flags)
    if free:
        flags[BLOCK_FILL] += 1
        if flags[BLOCK_FILL] == _BLOCK:
            _close_block(ledger)
    return strongest


@compiled()
def hold(flags: Integers) -> None:
    """Take no rise of energy for chatter until the disturbance is over."""
    flags[SINCE_JUMP] = 0
    flags[HOLDING] = max(flags[HOLDING], 1)


@compiled()
def _close_block(ledger: Ledger) -> None:
    """Put the block that is full behind the others and renew the baseline."""
    blocks, flags = ledger.blocks, ledger.flags
    for row in range(blocks.shape[0] - 1, 0, -1):
        blocks[row] = blocks[row - 1]
    blocks[0] = 0.0
    flags[BLOCK_FILL] = 0
    flags[BLOCKS] = min(flags[BLOCKS] + 1, BLOCK_COUNT + LAG)
    count = flags[BLOCKS] - LAG
    if count >= _FEWEST:
        for j in range(ledger.baseline.size):
            ledger.baseline[j] = max(blocks[1 + LAG : 1 + LAG + count, j].mean(), 1e-300)


@compiled()
def restart_baseline(ledger: Ledger) -> None:
    """What was usual is so no more."""
    flags = ledger.flags
    flags[BLOCKS] = flags[BLOCK_FILL] = flags[HOLDING] = 0
    ledger.blocks[0] = 0.0
    ledger.baseline[:] = np.nan


@compiled()
def growth_by_energy(
    ledger: Ledger, newest: int, bin_: int, length: int, period: float, pole: complex
) -> tuple[float, float, float]:
    """Growth rate, its error and angular frequency of a resonator over some hops."""
    cross, square, power = 0j, 0.0, 0.0
    for back in range(length):
        now = ledger.motion[(newest - back) % HOPS, bin_]
        before = ledger.motion[(newest - back - 1) % HOPS, bin_]
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


@compiled()
def follow_phase(ledger: Ledger, phases: Array) -> None:
    """Once-per-turn spread and what part of all vibration it is."""
    within = mean = total = 0.0
    least = np.inf
    for place in range(PHASES):
        within += phases[PHASE_VARIANCE, place] / PHASES
        mean += phases[PHASE_MEAN, place] / PHASES
        least = min(least, phases[PHASE_SEEN, place])
    for place in range(PHASES):
        total += (phases[PHASE_MEAN, place] - mean) ** 2 / PHASES
    numbers = ledger.numbers
    numbers[ONCE] = math.sqrt(within)
    numbers[FORCED_AMPLITUDE] = math.sqrt(2.0 * total)
    known = least >= 4.0 and within + total > 0.0
    numbers[RATIO] = within / (within + total) if known else np.nan


@compiled()
def follow_speed(ledger: Ledger, speed: float, hops_a_turn: float) -> None:
    """Notice ramps; they are over when a turn has passed, and what was usual is so no more."""
    speeds, flags = ledger.speeds, ledger.flags
    oldest = speeds[-1]
    for place in range(speeds.size - 1, 0, -1):
        speeds[place] = speeds[place - 1]
    speeds[0] = speed
    if flags[RAMPING] != 0:
        flags[RAMPING] -= 1
        if flags[RAMPING] == 0 and flags[ALARMED] == 0:
            restart_baseline(ledger)
        elif flags[RAMPING] == 0:
            flags[SINCE_ALARM] = -1  # another cut: what is known of it begins with the next hop
    if oldest > 0.0 and abs(speed / oldest - 1.0) > _RAMP:
        flags[RAMPING] = int(_RAMP_HOLD + hops_a_turn)


@compiled()
def follow_push(ledger: Ledger, products: Array, newest: int) -> None:
    """Notice a step of the mean force: another cut, whose vibration may stay larger than before.

    Args:
        ledger: Changed in place.
        products: Of the last hops (HOPS, PRODUCTS_SIZE), as a ring.
        newest: Its newest place.
    """
    flags = ledger.flags
    flags[STEPPED] = max(flags[STEPPED] - 1, 0)
    if flags[SEEN] < SETTLING + _NEW + _BETWEEN + _OLD:
        return
    new = old = new_square = old_square = 0.0
    for back in range(_NEW + _BETWEEN + _OLD):
        mean = products[(newest - back) % HOPS, TOOL_MEAN]
        if back < _NEW:
            new += mean / _NEW
            new_square += mean**2 / _NEW
        elif back >= _NEW + _BETWEEN:
            old += mean / _OLD
            old_square += mean**2 / _OLD
    variance = max(new_square - new**2, 0.0) / _NEW + max(old_square - old**2, 0.0) / _OLD
    if abs(new - old) > max(_STEP * math.sqrt(variance), _STEP_PART * abs(old)):
        flags[STEPPED] = _STEP_HOLD


@compiled()
def follow_misfit(ledger: Ledger, products: Array, clear: bool) -> None:
    """What the force usually differs by from C w h, while nothing happens."""
    numbers, flags = ledger.numbers, ledger.flags
    if products[OUTPUTS] < 2.0 or products[CHIP_CHIP] <= 0.0:
        return
    if flags[ALARMED] != 0 or not numbers[FIGURE_CUTTING] > 0.0:
        return
    slope = numbers[FIGURE_CUTTING]
    misfit = products[FORCE_FORCE] - 2.0 * slope * products[FORCE_CHIP]
    misfit = max(misfit + slope**2 * products[CHIP_CHIP], 0.0) / products[OUTPUTS]
    if numbers[USUAL_SEEN] >= 20.0 and misfit > _PUSH * numbers[USUAL] and clear:
        hold(flags)
    if numbers[USUAL_SEEN] < 20.0:
        numbers[USUAL_SEEN] += 1.0
        old = numbers[USUAL] if numbers[USUAL_SEEN] > 1.0 else 0.0
        numbers[USUAL] = old + (misfit - old) / numbers[USUAL_SEEN]
    else:
        # A jump is no quiet cutting; what stays, becomes usual.
        numbers[USUAL] += _FORGETTING * (min(misfit, 8.0 * numbers[USUAL]) - numbers[USUAL])
