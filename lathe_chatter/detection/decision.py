"""What is made of the signals, hop by hop: a score of suspicion, the alarm, the state; compiled.

Two things speak for chatter. The energy of the strongest resonator over its own mean of the
seconds before tells that something grew, however weak the signal is; and the growth rate of the
identified cut over its standard error tells that it grows by regeneration. Neither is enough:
noise and disturbances raise the energy of a stable cut, and the identified rate is uncertain
while the vibration is weak. So they are added; after a disturbance, which shows as a jump that no
growth explains, only the growth rate counts until the energy is down again.
"""

from __future__ import annotations

import math

import numpy as np

from lathe_chatter.arrays import Array
from lathe_chatter.compiled import compiled
from lathe_chatter.detection.baseline import (
    ARMED,
    SETTLING,
    follow_energy,
    follow_misfit,
    follow_phase,
    follow_push,
    follow_speed,
    growth_by_energy,
    restart_baseline,
)
from lathe_chatter.detection.detector_state import (
    ALARMED,
    CALM,
    FORCED_AMPLITUDE,
    HOLDING,
    HOPS,
    ONCE,
    PEAK,
    PEAK_ONCE,
    RAMPING,
    RATIO,
    RISE,
    SATURATED,
    SCORE,
    SEEN,
    SINCE_ALARM,
    SINCE_JUMP,
    SMALLEST,
    STATE,
    STEPPED,
    STRICTNESS,
    SUSPECTED,
    USUAL,
    WINDOWS,
    Ledger,
)
from lathe_chatter.detection.estimate_output import cuts, state_of, tell
from lathe_chatter.detection.identification import (
    ANGULAR_FREQUENCY,
    CLEARNESS,
    GROWTH,
    GROWTH_ERROR,
    WINDOW_TOOL_POWER,
)
from lathe_chatter.detection.kernels import Complex
from lathe_chatter.detection.signals import FORCE_FORCE, OUTPUTS, PHASE_SEEN, TOOL_MEAN

LIMITS = np.array([10.0, 7.2, 6.1, 5.5, 5.1, 4.7])
"""Growth rate over its standard error that is an alarm by itself, in each window."""
_ENERGY_LIMIT = 2.88
"""Logarithm of the energy ratio, and a share of growth over its error, that make an alarm."""
_BLURRED = 0.91
"""Part of that limit where the sensors' noise outweighs the vibration, and is the steadier."""
_ENERGY_ALONE = 3.2
"""The same of the energy ratio alone, without a model of the machine."""
_GROWTH_SHARE = 0.1
_MOST_GROWTH = 6.0
_SMALLEST_GROWTH = 0.2
"""Growth rate below which nothing is called chatter, 1/s."""
_TRUSTED = 3
"""The window by which it is judged whether the signal stands out of the sensors' noise."""
_AFTER_STEP, _AFTER_CLEAR_STEP = 1.2, 1.3
"""By how much more the energy must have risen while it is compared with that of another cut: in
the noise of the sensors, and where the growth rate can tell by itself."""
_SURELY_STABLE = -2.0
"""Growth rate over its error, in one of the shorter windows, that outweighs any rise of energy."""
_VETO = 0.9
_BESIDE_FORCED = 1.3
"""By how much surer growth must be beside a large vibration that is the spindle's own."""
_STRICTER = 1.5
"""By how much surer growth must be without a model."""
_PATIENT = 4
"""The shortest window whose growth is believed without a model."""
_RAISED = 1.5
"""Logarithm of the energy ratio without which the growth rate alone is no alarm."""

_OFF_PHASE, _ON_PHASE = 0.2, 0.9
"""Once-per-turn variance over all: below the spindle's own vibration, above chatter."""
_OUT_OF_CUT = 0.9
_STEADY = 0.05
_SATURATED = 20
_CALM = 20
_QUIET = 0.12
"""Part of its peak at which chatter is over, if it is not back at the baseline before."""


@compiled()
def _surely_stable(windows: Array) -> bool:
    """Whether one of the windows that know of a new cut at once says that it is stable."""
    for number in range(_TRUSTED + 1):
        known = windows[number]
        if known[GROWTH] < _SURELY_STABLE * known[GROWTH_ERROR]:
            return True
    return False


@compiled()
def _score(ledger: Ledger, windows: Array, model: bool, forced: bool) -> float:
    """1 is an alarm."""
    numbers, flags = ledger.numbers, ledger.flags
    score, rise = 0.0, numbers[RISE]
    short = windows[1] if model else windows[2]
    trust = min(max((windows[_TRUSTED, CLEARNESS] - 0.3) / 0.4, 0.0), 1.0) if model else 1.0
    sureness = short[GROWTH] / short[GROWTH_ERROR]
    if rise == rise and flags[HOLDING] == 0:
        score = rise
        if model and sureness == sureness:
            score += _GROWTH_SHARE * trust * min(sureness, _MOST_GROWTH)
        if model:
            score /= _ENERGY_LIMIT * (_BLURRED + (1.0 - _BLURRED) * trust)
        else:
            score /= _ENERGY_ALONE
        if flags[STEPPED] != 0:
            score /= _AFTER_STEP + (_AFTER_CLEAR_STEP - _AFTER_STEP) * trust
        if model and trust >= 0.5 and _surely_stable(windows):
            score = min(score, _VETO)
    free = model or flags[SINCE_JUMP] > 12
    # Growth that is read from the energy says nothing new, and noise looks like it now and then.
    first = 0 if model else _PATIENT
    if free and not (rise <= _RAISED and flags[HOLDING] == 0):
        for number in range(first, windows.shape[0]):
            known = windows[number]
            if not trust >= 0.5:
                break
            if known[GROWTH] > _SMALLEST_GROWTH:
                limit = LIMITS[number] if model else _STRICTER * LIMITS[number]
                limit *= _BESIDE_FORCED if forced else 1.0
                score = max(score, known[GROWTH] / known[GROWTH_ERROR] / limit)
    return score


@compiled()
def _saturated(ledger: Ledger, products: Array, newest: int, strongest: int, stiff: float) -> bool:
    """Whether the chatter has grown as far as it can: it is steady, and not the spindle's own."""
    numbers, flags = ledger.numbers, ledger.flags
    if not numbers[RATIO] > _ON_PHASE or flags[SEEN] < HOPS:
        return False
    if stiff > 0.0:
        mean = power = count = 0.0
        for back in range(16):
            hop = products[(newest - back) % HOPS]
            mean -= stiff * hop[TOOL_MEAN] / 16.0
            power += hop[FORCE_FORCE]
            count += hop[OUTPUTS]
        pulsation = 2.0 * math.sqrt(power / max(count, 1.0))
        usual = numbers[USUAL] if numbers[USUAL] == numbers[USUAL] else 0.0
        if pulsation > _OUT_OF_CUT * mean and mean > 10.0 * math.sqrt(usual):
            return True
    total = squares = 0.0
    for back in range(HOPS):
        energy = abs(ledger.motion[(newest - back) % HOPS, strongest]) ** 2
        total += energy / HOPS
        squares += energy**2 / HOPS
    spread = math.sqrt(max(squares - total**2, 0.0))
    return spread < _STEADY * total


@compiled()
def _decide(ledger: Ledger, strongest_amplitude: float) -> None:
    """Raise the alarm, or clear it."""
    numbers, flags = ledger.numbers, ledger.flags
    alarm = numbers[SCORE] >= numbers[STRICTNESS] or flags[SATURATED] >= _SATURATED
    # What is left of a cut that has settled are roundings, and these repeat themselves.
    alarm = alarm and strongest_amplitude > numbers[SMALLEST]
    flags[SUSPECTED] = flags[SUSPECTED] + 1 if alarm else 0
    if flags[ALARMED] == 0:
        if flags[SUSPECTED] >= 1:
            flags[ALARMED], flags[SINCE_ALARM], flags[CALM] = 1, 0, 0
            numbers[PEAK], numbers[PEAK_ONCE] = strongest_amplitude, numbers[ONCE]
        return
    flags[SINCE_ALARM] += 1
    numbers[PEAK] = max(numbers[PEAK], strongest_amplitude)
    numbers[PEAK_ONCE] = max(numbers[PEAK_ONCE], numbers[ONCE])
    # Both the band and the spread once a turn must have died down; where the alarm came at the
    # level of the noise there is no way down but to the baseline.
    down = strongest_amplitude < _QUIET * numbers[PEAK]
    down = down and not numbers[ONCE] > 2.0 * _QUIET * numbers[PEAK_ONCE]
    down = down or numbers[RISE] < ARMED
    flags[CALM] = flags[CALM] + 1 if down else 0
    if flags[CALM] >= _CALM:
        flags[ALARMED] = flags[SATURATED] = 0
        restart_baseline(ledger)


@compiled()
def judge(
    ledger: Ledger, newest: int, products: Array, windows: Array, phases: Array, poles: Complex,
    centres: Array, figures: Array, model: bool,
) -> None:  # fmt: skip
    """Judge the newest hop.

    Args:
        ledger: Changed in place.
        newest: Its place in the rings.
        products: Of the last hops (HOPS, PRODUCTS_SIZE), as a ring.
        windows: From `identification.identify`; written here where there is no model.
        phases: Once-per-turn statistics.
        poles: Of the resonators, per hop (bins,).
        centres: Their angular frequencies, 1/s (bins,).
        figures: Speed, rev/s; hop, s; stiffness of the tool, N/m; amplitude from which on the
            spindle's own vibration is told, m; gain of the band pass; 1 / (2 sine of half the
            angle of vibration a turn) is limited to 1 / this (6,).
        model: Whether `windows` come from a model of the machine.
    """
    numbers, flags = ledger.numbers, ledger.flags
    speed, period = figures[0], figures[1]
    follow_speed(ledger, speed, 1.0 / max(speed * period, 1e-9))
    strongest = follow_energy(ledger, newest)
    if phases[PHASE_SEEN].min() >= 1.0:
        follow_phase(ledger, phases)
    wave = (np.nan, np.nan, np.nan)
    if not model:
        for number in range(WINDOWS.size):
            length = min(WINDOWS[number], HOPS - 1)
            if number < 2 or flags[SEEN] < length + SETTLING:
                windows[number, GROWTH] = windows[number, GROWTH_ERROR] = np.nan
                continue
            wave = growth_by_energy(ledger, newest, strongest, length, period, poles[strongest])
            windows[number, GROWTH], windows[number, GROWTH_ERROR] = wave[0], wave[1]
            windows[number, ANGULAR_FREQUENCY] = wave[2] + centres[strongest]
    flags[SEEN] += 1
    omega = windows[2, ANGULAR_FREQUENCY]
    comb = 1.0
    if omega == omega and speed > 0.0:
        comb = max(2.0 * abs(math.sin(0.5 * omega / speed)), 0.1)
    amplitude = 2.0 * math.sqrt(max(windows[1, WINDOW_TOOL_POWER], 0.0)) / comb / figures[4]
    follow_push(ledger, products, newest)
    if model:
        follow_misfit(ledger, products[newest], windows[_TRUSTED, CLEARNESS] > 0.5)
    known = flags[RAMPING] == 0 and flags[SEEN] > SETTLING
    forced = numbers[RATIO] < _OFF_PHASE and numbers[FORCED_AMPLITUDE] > figures[3]
    numbers[SCORE] = _score(ledger, windows, model, forced) if known else 0.0
    stiff = figures[2] if model else 0.0
    if flags[ALARMED] == 0 and flags[RAMPING] == 0 and speed > 0.0:
        steady = _saturated(ledger, products, newest, strongest, stiff)
        flags[SATURATED] = flags[SATURATED] + 1 if steady else 0
    _decide(ledger, amplitude)
    tell(ledger, windows, wave, model, amplitude)
    cutting = not model or cuts(windows[WINDOWS.size - 1], products, newest)
    flags[STATE] = state_of(ledger, cutting, forced)
