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
from typing import Any

import numpy as np

from lathe_chatter.array_types import Array
from lathe_chatter.compiled import compiled
from lathe_chatter.detection.alarm import RECENT, follow_alarm
from lathe_chatter.detection.baseline import (
    ARMED,
    SETTLING,
    dies_down,
    energy_limit,
    follow_breaks,
    follow_energy,
    follow_lines,
    follow_misfit,
    follow_phase,
    follow_push,
    follow_speed,
    growth_by_energy,
    has_drifted,
    is_another_cut,
)
from lathe_chatter.detection.detector_state import (
    HOPS,
    REJECTED,
    UNCHECKED,
    WINDOWS,
    DetectorState,
)
from lathe_chatter.detection.filter_design import Complex
from lathe_chatter.detection.reported_figures import (
    is_cutting,
    shown_amplitude,
    state_of,
    weigh_vibration,
    write_figures,
)
from lathe_chatter.detection.signal_conditioning import PHASE_SEEN
from lathe_chatter.detection.structured_arrays import Records

LIMITS = np.array([10.0, 7.2, 6.1, 5.5, 5.1, 4.7])
"""Growth rate over its standard error that is an alarm by itself, in each window."""
_ENERGY_LIMIT = 2.88
"""Logarithm of the energy ratio, and a share of growth over its error, that make an alarm."""
_GROWTH_SHARE = 0.1
_MOST_GROWTH = 6.0
SMALLEST_GROWTH = 0.2
"""Growth rate below which nothing is called chatter, 1/s."""
_TRUSTED = 3
"""The window by which it is judged whether the signal stands out of the sensors' noise."""
_AFTER_STEP, _AFTER_CLEAR_STEP = 1.2, 1.3
"""By how much more the energy must have risen while it is compared with another cut's: in the
noise of the sensors, and where the growth rate can tell by itself."""
_SURELY_STABLE = -2.0
"""Growth rate over its error, in one of the shorter windows, that outweighs any rise of energy."""
_VETO = 0.9
_BESIDE_FORCED = 1.3
"""By how much surer growth must be beside a large vibration that is the spindle's own."""
_STRICTER = 1.5
"""By how much surer growth must be without a model."""
_SHORTEST_BY_ENERGY = 2
"""The shortest window in which growth is read from the energy."""
_PATIENT = 4
"""The shortest window whose growth is believed without a model."""
_LOUD = 6.0
"""Logarithm of the energy ratio from which on noise matters so little that shorter windows do."""
_LOUD_LIMITS = (5.0, 3.5)
"""Growth rate over its standard error that is an alarm then, in the two windows before."""
_TRANSIENT, _COHERENT = 2, 0.975
"""Newest hops after a disturbance, and the coherence of force and chip in them which no machine
has that was told wrong by more than some 5 %."""
_RAISED, _DIED_DOWN = 1.5, -3.0
"""Logarithm of the energy ratio without which the growth rate alone is no alarm, and that below
which it is none after a disturbance: what is left there are roundings and noise."""

_OFF_PHASE, _ON_PHASE = 0.2, 0.9
"""Once-per-turn variance over all: below the spindle's own vibration, above chatter."""
_OUT_OF_CUT, _LASTS = 0.9, 0.7
"""Force over its mean, and energy over that of 16 hops before, of chatter that has grown as far as
the tool leaves the cut."""
_STEADY, _SHORT, _STEADIER = 0.12, 32, 0.1
"""Spread of the energy over its mean, over all hops that are remembered and over so many, that is
steady: noise in a mode has several times as much."""
_PERSISTENT = 20


@compiled(borrows=True, inner=True)
def _surely_stable(windows: Records, first: int, end: int) -> bool:
    """Whether one of some windows says that the cut is stable."""
    for number in range(first, end):
        known = windows[number]
        if known.growth < _SURELY_STABLE * known.growth_error:
            return True
    return False


@compiled(borrows=True, inner=True)
def _grows(windows: Records) -> bool:
    """Whether a window says so, more likely than not."""
    for number in range(windows.size):
        if windows[number].growth > windows[number].growth_error:
            return True
    return False


@compiled(borrows=True, inner=True)
def _trust(windows: Records) -> float:
    """How far the signal stands out of the sensors' noise, from 0 to 1, with a model."""
    clear: float = min(max((windows[_TRUSTED].clearness - 0.3) / 0.4, 0.0), 1.0)
    return clear


@compiled(borrows=True, inner=True)
def _other_cut(state: DetectorState, trust: float) -> float:
    """By how much more the energy must have risen, for it may be compared with another cut's."""
    if not is_another_cut(state):
        return 1.0
    return _AFTER_STEP + (_AFTER_CLEAR_STEP - _AFTER_STEP) * trust


@compiled(borrows=True, inner=True)
def _score(
    state: DetectorState, windows: Records, model: bool, forced: bool, enough: float
) -> float:
    """1 is an alarm."""
    now = state.now[0]
    score, rise = 0.0, now.rise
    if now.hold_ended != 0:  # the rise is that over the cut before
        if model:
            dies_down = not _grows(windows)
        else:
            dies_down = _surely_stable(windows, _SHORTEST_BY_ENERGY, windows.size)
        if dies_down:
            rise = np.nan
    short = windows[1] if model else windows[2]
    trust = _trust(windows) if model else 1.0
    sureness = short.growth / short.growth_error
    if rise == rise and now.holding == 0:
        score = rise
        if model and sureness == sureness:
            score += _GROWTH_SHARE * trust * min(sureness, _MOST_GROWTH)
        score /= enough * _other_cut(state, trust)
        first = 0 if model else _SHORTEST_BY_ENERGY
        stable = _surely_stable(windows, first, _TRUSTED + 1)
        if model and has_drifted(state):  # a stable cut is louder at some speeds than at others
            grows = windows[2].growth > 0.0 and windows[_TRUSTED].growth > 0.0
            stable = stable or not grows
        if trust >= 0.5 and stable:
            score = min(score, _VETO)
    loud = not model and rise > _LOUD and now.holding != 0
    free = model or loud or now.since_jump > 12
    # Growth that is read from the energy says nothing new, and noise looks like it now and then.
    first = 0 if model else _PATIENT - 2 * loud
    if free and not rise <= (_RAISED if now.holding == 0 else _DIED_DOWN):
        for number in range(first, windows.shape[0]):
            known = windows[number]
            if not trust >= 0.5:
                break
            cut_off = model and known.length < WINDOWS[number]
            if cut_off and number > 0 and known.length <= WINDOWS[number - 1]:
                break  # after a jump: it knows no more than the one before
            if known.growth > SMALLEST_GROWTH:
                limit = LIMITS[number] if model else _STRICTER * LIMITS[number]
                if loud and number < _PATIENT:
                    limit = _LOUD_LIMITS[number - first]
                if cut_off:
                    limit = LIMITS[max(number - 1, 0)]
                limit *= _BESIDE_FORCED if forced else 1.0
                score = max(score, known.growth / known.growth_error / limit)
    return score


@compiled(borrows=True, inner=True)
def _unchecked_score(now: Any, products: Records, full: float, plain: float) -> float:
    """The same while nobody knows whether the machine was told right: more must speak for it.

    Told too low it makes every cut unstable, told too high none. So the energy counts as without
    a machine; the identified growth counts after a disturbance that stands so clearly out of the
    noise that F = C w h would not hold with another machine.

    Args:
        now: Of the state, before the alarm.
        products: Sums of the last hops (HOPS,), as a ring.
        full: The score by the machine.
        plain: The score without.
    """
    if now.holding == 0:
        return plain
    both = force = chip = 0.0
    for back in range(min(max(1, now.holding - 1), _TRANSIENT)):
        hop = products[(now.newest - back) % HOPS]
        both += hop.force_chip
        force += hop.force_force
        chip += hop.chip_chip
    coherent = both > 0.0 and both * both > _COHERENT * force * chip
    return max(full, plain) if coherent else plain


@compiled(borrows=True, inner=True)
def _saturated(
    state: DetectorState, products: Records, newest: int, strongest: int, stiff: float, length: int
) -> bool:
    """Whether the chatter has grown as far as it can: it is steady, and not the spindle's own.

    Over `length` hops, which are all that are remembered, or where the cut grows `_SHORT`.
    """
    now = state.now[0]
    if not now.once_per_turn > _ON_PHASE:
        return False
    if stiff > 0.0 and now.hops_seen >= HOPS:
        mean = power = count = lately = before = 0.0
        for back in range(16):
            hop = products[(newest - back) % HOPS]
            mean -= stiff * hop.tool_mean / 16.0
            power += hop.force_force
            count += hop.outputs
            lately += abs(state.motion[(newest - back) % HOPS, strongest]) ** 2
            before += abs(state.motion[(newest - back - 16) % HOPS, strongest]) ** 2
        pulsation = 2.0 * math.sqrt(power / max(count, 1.0))
        usual = now.usual_misfit if now.usual_misfit == now.usual_misfit else 0.0
        # After a knock the tool leaves the cut as well, and less and less.
        lasts = lately > _LASTS * before
        if lasts and pulsation > _OUT_OF_CUT * mean and mean > 10.0 * math.sqrt(usual):
            return True
    limit = _STEADIER if length == _SHORT else _STEADY
    total = squares = 0.0
    for back in range(length):
        energy = abs(state.motion[(newest - back) % HOPS, strongest]) ** 2
        total += energy / length
        squares += energy**2 / length
    spread = math.sqrt(max(squares - total**2, 0.0))
    return spread < limit * total


@compiled(borrows=True, inner=True)
def judge(
    state: DetectorState, settings: Any, products: Records, identified: Records, plain: Records,
    phases: Array, poles: Complex, centres: Array, speed: float,
) -> None:  # fmt: skip
    """Judge the newest hop.

    Args:
        state: Changed in place; `now.newest` is its place in the rings.
        settings: A record of `signal_conditioning.SETTINGS`.
        products: Sums of the last hops (HOPS,), as a ring.
        identified: From `cut_identification.identify`, where there is a model.
        plain: With the powers; growth is written here.
        phases: Once-per-turn statistics.
        poles: Of the resonators, per hop (bins,).
        centres: Their angular frequencies, 1/s (bins,).
        speed: Of the spindle, rev/s.
    """
    now = state.now[0]
    newest, period = now.newest, settings.period
    model = settings.has_machine != 0 and settings.believed != REJECTED
    follow_speed(state, speed, 1.0 / max(speed * period, 1e-9))
    strongest = steadiest = follow_energy(state, newest)
    by_itself = settings.has_machine == 0 and now.strictness < np.inf
    # Without a baseline the growth rate would be alone, and what dies down into noise has any.
    unchecked = model and (settings.believed == UNCHECKED or now.rise != now.rise)
    # Nor is every force one of the cut where the tool may leave it.
    unchecked = unchecked or (model and now.since_break == 0)
    if settings.has_machine == 0:
        loudest = follow_lines(state, newest)
        if by_itself:  # chatter that the baseline holds has risen no more than anything else
            steadiest = loudest
        if now.by_line != 0 or now.rise != now.rise:
            strongest = loudest
        now.strongest = strongest
    seen = phases[PHASE_SEEN, 0]
    for j in range(1, phases.shape[1]):
        seen = min(seen, phases[PHASE_SEEN, j])
    if seen >= 1.0:
        follow_phase(state, phases)
    wave = (np.nan, np.nan, np.nan)
    if not model or unchecked or now.rise > ARMED:
        fresh = now.since_jump - 2.0 - 1.0 / max(speed * period, 1e-9)
        for number in range(_SHORTEST_BY_ENERGY, WINDOWS.size):
            length = min(WINDOWS[number], HOPS - 1)
            mixed = now.holding != 0 and length > fresh
            if mixed or now.hops_seen < length + SETTLING:
                continue
            wave = growth_by_energy(state, newest, strongest, length, period, poles[strongest])
            plain[number].growth, plain[number].growth_error = wave[0], wave[1]
            plain[number].angular_frequency = wave[2] + centres[strongest]
    windows = identified if model else plain
    now.hops_seen += 1
    omega = windows[2].angular_frequency
    comb = 1.0
    if omega == omega and speed > 0.0:
        comb = max(2.0 * abs(math.sin(0.5 * omega / speed)), 0.1)
    by_power = 2.0 / comb / settings.gain
    amplitude = by_power * math.sqrt(max(windows[1].tool_power, 0.0))
    recent = by_power * math.sqrt(max(windows[RECENT].tool_power, 0.0))
    state.amplitudes[newest] = amplitude
    follow_push(state, products, newest)
    if model:
        follow_breaks(now, products[newest], settings)
        follow_misfit(state, products[newest], windows[_TRUSTED].clearness > 0.5)
    known = now.ramping == 0 and now.hops_seen > SETTLING
    forced = (
        now.once_per_turn < _OFF_PHASE and now.synchronous_amplitude > settings.forced_amplitude
    )
    alone = energy_limit(state, settings)
    limit = _ENERGY_LIMIT if model else alone
    now.score = _score(state, windows, model, forced, limit) if known else 0.0
    state.plain_scores[newest] = 0.0
    if model and known and (unchecked or now.rise > ARMED):
        state.plain_scores[newest] = _score(state, plain, not model, forced, alone)
    if unchecked and known:
        now.score = _unchecked_score(now, products, now.score, state.plain_scores[newest])
    elif model and known and now.rise > ARMED:
        # The machine may be another than was told: what lasts is believed without it.
        lasting = np.inf
        for back in range(_PERSISTENT):
            lasting = min(lasting, state.plain_scores[(newest - back) % HOPS])
        now.score = max(now.score, lasting)
    # A force that would make C w negative is none.
    sound = model and identified[WINDOWS.size - 1].cutting > 0.0
    stiff = settings.tool_stiffness if sound else 0.0
    # Where the cut grows, by the machine, a shorter time says enough.
    length = _SHORT if model and _grows(identified) else HOPS
    if now.alarmed == 0 and now.ramping == 0 and speed > 0.0 and now.hops_seen >= length:
        steady = _saturated(state, products, newest, steadiest, stiff, length)
        # Roundings are steady too.
        steady = steady and amplitude > now.smallest_amplitude
        # Free vibration that is hardly damped is as steady for a while. Where it beats as well,
        # the machine knows that it dies down, if the tool has not left the cut.
        sure = model and now.since_break > HOPS
        sure = sure and _surely_stable(identified, _TRUSTED, WINDOWS.size)
        steady = steady and not dies_down(state, newest, length, settings, sure)
        now.saturated = now.saturated + 1 if steady else 0
    follow_alarm(state, amplitude, recent, by_itself)
    write_figures(state, windows, wave, model, amplitude)
    weigh_vibration(now, products[newest], settings)
    now.shown_amplitude = shown_amplitude(now, products, settings, omega, speed)
    cutting = is_cutting(now, windows[WINDOWS.size - 1], products, settings)
    now.state = state_of(state, settings, cutting, forced)
