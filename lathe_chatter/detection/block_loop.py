"""One hop after the other: signals, identification and judgement in one compiled loop."""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from lathe_chatter.arrays import Array, Integers
from lathe_chatter.compiled import compiled
from lathe_chatter.detection.decision import judge
from lathe_chatter.detection.detector_state import (
    ALARMED,
    HOLDING,
    HOPS,
    IDLE,
    SEEN,
    SINCE_ALARM,
    STATE,
    USUAL,
    WINDOWS,
    Ledger,
)
from lathe_chatter.detection.identification import (
    CLEARNESS,
    CUTTING,
    NOISE_SIZE,
    SOFTEST,
    STIFFEST,
    STIFFNESS,
    WINDOW_OUTPUTS,
    WINDOW_TOOL_POWER,
    identify,
    noise_sums,
    rightmost_in_band,
)
from lathe_chatter.detection.kernels import Complex, Kernels
from lathe_chatter.detection.signals import (
    HAS_ANGLE,
    HAS_MACHINE,
    OUTPUTS,
    THINNING,
    TOOL_NOISE,
    TOOL_POWER,
    WORKPIECE_NOISE,
    Memory,
    follow,
)

_REFERENCE = 3
_GUESS_EVERY = 8
_CLEAR = 0.4
"""Part of the signal that is no noise, from which on an identified cut is followed."""
_DEEPER = 1.3
"""Times the identified C w: the cut whose rightmost root is followed too."""
_NOISE_HOPS = 32


class HopFigures(IntEnum):
    """What a hop has to be told."""

    PERIOD = 0
    TOOL_STIFFNESS = 1
    FORCED_AMPLITUDE = 2
    GAIN = 3
    RATE = 4
    SLOWEST = 5


_PERIOD, _TOOL, _FORCED, _GAIN, _RATE, _SLOWEST = range(6)


@compiled()
def _powers(products: Array, newest: int, windows: Array) -> None:
    """Without a model: the tool's power in each window."""
    for number in range(WINDOWS.size):
        power = count = 0.0
        for back in range(WINDOWS[number]):
            hop = products[(newest - back) % HOPS]
            power += hop[TOOL_POWER]
            count += hop[OUTPUTS]
        windows[number, :] = np.nan
        windows[number, WINDOW_OUTPUTS] = count
        windows[number, WINDOW_TOOL_POWER] = power / count if count > 0.0 else np.nan


@compiled()
def take_hops(
    block: Array, hop: int, reading: Integers, kernels: Kernels, memory: Memory, products: Array,
    windows: Array, mechanics: Array, figures: Array, guess: Complex, place: Integers,
    ledger: Ledger,
) -> int:  # fmt: skip
    """Take in hops until the samples are used up or the alarm is up, then one at a time.

    Args:
        block: Spindle angle, tool and workpiece displacement (n, 3), n a multiple of `hop`.
        hop: Samples in a hop.
        reading: How they are read.
        kernels: From `kernels.design`.
        memory: Of the signals, changed in place.
        products: Of the last hops (HOPS, PRODUCTS_SIZE), a ring, changed in place.
        windows: What they say (windows, WINDOW_SIZE), written.
        mechanics: From `identification.mechanics_of`.
        figures: In the order of `HopFigures`.
        guess: The rightmost root of the last cut that was looked at, its C w and its k, and the
            rightmost root of a deeper one (4,), changed in place.
        place: The newest hop in the rings (1,), changed in place.
        ledger: Of the judgement, changed in place.

    Returns:
        Hops taken.
    """
    done, model = 0, reading[HAS_MACHINE] != 0
    count = block.shape[0] // hop
    noise, known, told = np.zeros(NOISE_SIZE), np.zeros(4), np.zeros(6)
    turns = kernels.poles ** (hop // reading[THINNING])
    centres = np.angle(kernels.poles) * (figures[_RATE] / reading[THINNING])
    lengths = WINDOWS.copy()
    while done < count:
        samples = block[done * hop : (done + 1) * hop]
        done += 1
        newest = (place[0] + 1) % HOPS
        place[0] = newest
        follow(samples, reading, kernels, memory, products[newest])
        ledger.motion[newest] = memory.resonators
        speed = (samples[hop - 1, 0] - samples[0, 0]) / (hop - 1) * figures[_RATE]
        if reading[HAS_ANGLE] != 0 and speed < figures[_SLOWEST]:
            ledger.flags[STATE], ledger.flags[SEEN] = IDLE, 0
            ledger.speeds[:] = 0.0
            ledger.speeds[0] = speed
            continue
        if products[newest, OUTPUTS] < 1.0:
            ledger.speeds[0] = speed
            continue
        if model:
            tool = workpiece = 0.0
            for back in range(_NOISE_HOPS):
                tool += products[(newest - back) % HOPS, TOOL_NOISE]
                workpiece += products[(newest - back) % HOPS, WORKPIECE_NOISE]
            share = 1.0 / (_NOISE_HOPS * reading[THINNING])
            thinned = figures[_RATE] / reading[THINNING]
            noise_sums(kernels.spill, tool * share, workpiece * share, thinned / speed, noise)
            known[0], known[1] = 1.0 / speed, ledger.numbers[USUAL]
            known[2], known[3] = guess[1].real, guess[2].real
            # The hop of a jump has two cuts in it, the one after it only the new one.
            lengths[0] = 1 if ledger.flags[HOLDING] == 1 else WINDOWS[0]
            identify(
                products, newest, lengths, mechanics, noise, known, guess[0], guess[3], windows
            )
            if ledger.flags[SEEN] % _GUESS_EVERY == 0:
                reference = windows[_REFERENCE]
                if reference[CLEARNESS] > _CLEAR:
                    stiffness = min(
                        max(reference[STIFFNESS], mechanics[SOFTEST]), mechanics[STIFFEST]
                    )
                    cutting = max(reference[CUTTING], 0.0)
                    guess[0] = rightmost_in_band(
                        mechanics, cutting, stiffness, 1.0 / speed, guess[0]
                    )
                    guess[1], guess[2] = cutting, stiffness
                    # A value that is too low by chance leads to the mode that is not in danger.
                    longest = windows[WINDOWS.size - 1, CUTTING]
                    deeper = _DEEPER * (max(cutting, longest) if longest > 0.0 else cutting)
                    guess[3] = rightmost_in_band(
                        mechanics, deeper, stiffness, 1.0 / speed, guess[3]
                    )
        else:
            _powers(products, newest, windows)
        told[0], told[1], told[2] = speed, figures[_PERIOD], figures[_TOOL]
        told[3], told[4] = figures[_FORCED], figures[_GAIN]
        judge(ledger, newest, products, windows, memory.phases, turns, centres, told, model)
        if ledger.flags[ALARMED] != 0 and ledger.flags[SINCE_ALARM] <= 64:
            break
    return done
