"""`Supervisor`: what is seen goes in, one sentence and some changes come out."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import chain

from lathe_chatter.model import Cut, Machine
from lathe_chatter.supervisor.likely_machines import as_heard, chance_of, fits, may_be
from lathe_chatter.supervisor.move_search import (
    MOST_ODD,
    ODD,
    Limits,
    change_words,
    expectation,
    moves_for,
)
from lathe_chatter.supervisor.seen_and_done import ASKS, NO_MACHINE, Action, Mode, Seen
from lathe_chatter.supervisor.vibration import SETTLING, VibrationHistory

_LONGEST = 2.0
"""s from a move to the judgement whether the vibration falls, at most."""
_AGAIN = 2.0
"""s after which it looks for a move again, where it could not make one: that takes up to one."""
_EFOLDS = 1.5
"""Of the predicted decay, before that judgement."""
_GROWN, _GROWING, _UNEXPECTED = 4.0, 2.2, 8.0
"""Times the vibration of the quiet cut before, that it has whatever is known of its growth; where
it is known to grow; and where most machines that it may be are stable. Else the flag is waited
on, for noise raises it at times."""
_EARLY = 0.1
"""s after a flag in which it is heard whether it fits the machine."""
_NEAR = 0.25
"""Part of the amplitude limit beyond which growing vibration is not waited on."""
_STEP, _LONGEST_STEP = 0.04, 0.08
"""s that a speed of a ramp lasts at least, and that count at most."""
_LASTING = 1.0
"""s that a margin must lie below its limit."""
_SAME = 0.01
"""Part by which cuts must differ of which one was tried."""
_SURER = 0.3
"""Part of the error of the machine that is left where what is heard is what it predicts."""
_DOUBT, _MOST_DOUBT = 1.25, 2.0
"""Times the reserve that a move has to have after every one that was no cure, and at most."""
_LASTING_FLAG, _EXPECTED_FLAG, _EXPECTED = 1.0, 2.0, 0.2
"""s that a flag must last to be believed of a steady vibration whatever it was before; and of any
where so small a part of the machines is stable: a clearance keeps some chatter small."""


class Supervisor:
    """Decides about one machine.

    Args:
        limits: That nothing overrides.
        mode: See `Mode`.
        machine_error: Relative standard error of the figures of the machine.
        margin_limit: Margin below which it warns.
        move_early: Whether it also moves then, in the mode `act`.
        hands_off: s without any action after a person has changed something, or it has begun.
        begun: When it begins, s.

    Attributes:
        machine: As told; None where none is known or it does not fit: then nothing is done.
        moves: Made by itself against the present chatter.
    """

    def __init__(  # noqa: PLR0913 -- its parameters
        self,
        limits: Limits,
        mode: Mode = Mode.SHADOW,
        *,
        machine_error: float = 0.03,
        margin_limit: float = 0.1,
        move_early: bool = False,
        hands_off: float = 2.0,
        begun: float = -math.inf,
    ) -> None:
        """See nothing yet."""
        self.machine: Machine | None = None
        self.limits, self.mode, self._machine_error = limits, mode, machine_error
        self._margin_limit, self._move_early, self._hands_off = margin_limit, move_early, hands_off
        self._hand_at, self._hand = begun, 'I have only just begun to watch'
        self._has_seen_quiet = False
        self._is_of_before = False  # the flag, of the run before this one
        self._vibration = VibrationHistory()
        self._safe_since = math.nan
        self._warned, self._doubt = False, 1.0
        self._ended = ''  # what is to be said once the end of the chatter is sure
        self._forget()

    def _forget(self) -> None:
        """There is no chatter."""
        self.moves = self._doubted = 0
        self._fits = False
        self._chance: tuple[Cut, float] | None = None  # that a cut is stable
        self._alarm_at = math.nan
        self._tried: list[Cut] = []
        self._offer: tuple[Cut, Action] | None = None
        self._target = math.nan  # of a ramp under way
        self._judge_at = -math.inf
        self._at_move, self._settling = math.nan, SETTLING
        self._refusal = self._said = ''

    def hand_moved(self, time: float) -> Action | None:
        """Somebody else has changed something: hands off, and what was planned is forgotten."""
        on_the_way = math.isfinite(self._target)
        self._hand = 'somebody else has just changed something'
        self._hand_at, self._target, self._refusal = time, math.nan, ''
        if not on_the_way:
            return self._withdraw(self._hand)
        return Action('Somebody else changes the cut: the speed stays where it is on its way.')

    def another_run(self) -> Action | None:
        """The lathe has begun again: what was known of chatter was known of the run before."""
        self._is_of_before |= not math.isnan(self._alarm_at)
        self._vibration, self._has_seen_quiet, self._ended = VibrationHistory(), False, ''
        withdrawn = self._withdraw('the lathe has begun again')
        self._forget()
        return withdrawn

    def _withdraw(self, reason: str) -> Action | None:
        """What was offered, if anything was: who reads the offer must not think that it stands."""
        if self._offer is None:
            return None
        self._offer, self._said = None, ''
        return Action(f'What was offered is withdrawn, for {reason}.')

    def refused(self, reason: str) -> Action:
        """The lathe did not say that it did what was asked: no more is tried, for that reason."""
        self._offer, self._target = None, math.nan
        self._refusal = reason.rstrip('.')
        return Action(f'Nothing more is done, for {self._refusal}.')

    def accept(self, seen: Seen) -> tuple[bool, str, Action | None]:
        """A person says yes to the offer: whether there is one, why not, and what is done."""
        if self._offer is None:
            return False, 'Nothing is waiting to be accepted.', None
        cut, action = self._offer
        hindrance = self._hindrance(seen)
        if hindrance or cut != seen.cut:
            reason = hindrance or 'the cut has changed'
            return False, f'Nothing is done, for {reason}.', self._withdraw(reason)
        return True, action.sentence, self._begin(action, seen)

    def look(self, seen: Seen) -> Action | None:
        """What is to be said or done now; to be called some fifty times a second."""
        self._vibration.note(seen.time, seen.amplitude)
        if self._offer is not None and self._offer[0] != seen.cut:
            return self._withdraw('the cut has changed')
        if math.isfinite(self._target):
            return self._go_on(seen)
        if seen.chatter:
            return self._chatter(seen)
        return self._quiet(seen)

    # -- chatter -----------------------------------------------------------------------------

    def _chatter(self, seen: Seen) -> Action | None:
        self._ended = ''
        if math.isnan(self._alarm_at):
            self._alarm_at = seen.time
        if hindrance := self._hindrance(seen):
            self._offer = None
            return self._once(f'{_figures(seen)}: nothing is done, for {hindrance}.')
        if self._vibration.is_beyond(self.limits.amplitude_limit):
            limit = f'beyond amplitude_limit, {1e6 * self.limits.amplitude_limit:.0f} um'
            return self._decide(seen, Action(f'{_figures(seen)}, {limit}: {{}} stop', stop=True))
        if seen.time < self._judge_at or self._offer is not None:
            return None
        if self.moves and self._vibration.dies(self._at_move, seen.growth_rate):
            self._judge_at = seen.time + SETTLING
            return None
        if not (self.moves or self._is_sure(seen)):
            return None
        return self._move(seen, _figures(seen))

    def _move(self, seen: Seen, why: str) -> Action | None:
        """The best move that was not tried."""
        if self.machine is None:
            return None
        machine = as_heard(self.machine, seen.cut, seen.cutting_stiffness, seen.tool_frequency)
        if self.moves > self._doubted:  # the machine is not as it was told
            self._doubted = self.moves
            self._doubt = min(_DOUBT * self._doubt, _MOST_DOUBT)
        amplitude = seen.amplitude if math.isfinite(seen.amplitude) else 0.0
        self._judge_at = seen.time + _AGAIN
        sure, surer = self._machine_error, _SURER * self._machine_error
        tries = [(sure, ODD), *([(surer, ODD)] if self._fits else []), (sure, MOST_ODD)]
        found = (
            moves_for(may_be(machine, error), seen.cut, self.limits, amplitude, self._doubt, odd)
            for error, odd in tries
        )
        for move in chain.from_iterable(found):
            if not any(_same(move.cut, cut) for cut in (seen.cut, *self._tried)):
                if not seen.flag_stays():
                    return None
                changes = move.changes_from(seen.cut)
                said = f'{why}: {{}} set {change_words(changes, seen.cut)} ({expectation(move)})'
                settling = min(SETTLING - _EFOLDS / min(move.growth_rate, -0.1), _LONGEST)
                return self._decide(seen, Action(said, changes, settling=settling))
        new = ' that was not tried' if self._tried else ''
        nothing = f'no move within the limits{new} is predicted to help'
        return self._once(f'{why}: {nothing}; a person has to decide.')

    def _decide(self, seen: Seen, action: Action) -> Action | None:
        """Act, or say what would be done, as the mode has it."""

        def said(who: str, end: str) -> str:
            return action.sentence.format(who) + end

        self._offer = None
        if self.mode is Mode.SHADOW:
            return self._once(said('I would', ', but only watch.'))
        spent = self.moves >= self.limits.most_moves and not action.stop
        if self.mode is Mode.ACT and not spent:
            return self._begin(replace(action, sentence=said('I', '.')), seen)
        self._offer = seen.cut, replace(action, sentence=said('I', ', as was accepted.'))
        many = '1 move was' if self.moves == 1 else f'{self.moves} moves were'
        tried = f' {many} no cure.' if spent and self.moves else ''
        return self._once(said('I would', f': {ASKS}.{tried}'))

    def _begin(self, action: Action, seen: Seen) -> Action:
        """Do it: at once, or the first step of a ramp."""
        self._offer, self._said = None, ''
        self._tried.append(seen.cut.with_changes(**action.changes))
        self.moves += 1
        self._at_move = seen.amplitude
        self._settling = math.inf if action.stop else action.settling
        self._judge_at = seen.time + self._settling
        target = action.changes.get('spindle_speed_rpm')
        if target is None:
            return action
        own = seen.spindle_acceleration
        if 0.0 < own <= self.limits.ramp:  # the spindle ramps by itself
            self._judge_at += abs(target - seen.cut.spindle_speed_rpm) / own
            return action
        self._target, self._reached = target, seen.cut.spindle_speed_rpm
        first = self._go_on(replace(seen, lasted=min(seen.lasted, _STEP)))
        return replace(action, changes={**action.changes, **(first.changes if first else {})})

    def _go_on(self, seen: Seen) -> Action | None:
        """The next speed of the ramp, if the one before has lasted."""
        if seen.lasted < _STEP:
            return None
        # Where looks come late the ramp takes longer: it has no greater steps for that.
        step = self.limits.ramp * min(seen.lasted, _LONGEST_STEP)
        left = self._target - self._reached
        self._reached += math.copysign(min(step, abs(left)), left)
        if step >= abs(left):
            self._reached, self._target = self._target, math.nan
            self._judge_at = seen.time + self._settling
        return Action(changes={'spindle_speed_rpm': self._reached})

    def _hindrance(self, seen: Seen) -> str:
        """Why nothing may be done."""
        if seen.hindrance or self._refusal:
            return seen.hindrance or self._refusal
        if self.machine is None:
            return NO_MACHINE
        if seen.time < self._hand_at + self._hands_off:
            return self._hand
        if seen.chatter and not math.isfinite(seen.amplitude):
            return 'the amplitude is not known'
        return ''

    def _is_sure(self, seen: Seen) -> bool:
        """Whether the vibration is more than noise; so where no quiet cut was seen before."""
        if self.machine is None:
            return True
        if self._chance is None or self._chance[0] != seen.cut:
            machines = may_be(self.machine, self._machine_error)
            self._chance = seen.cut, chance_of(machines, seen.cut)
        flagged_for, grows = seen.time - self._alarm_at, seen.growth_rate > 0.0
        if flagged_for < _EARLY:
            # Before it has grown so far that the tool leaves the cut.
            self._fits |= fits(self.machine, seen.cut, seen.frequency, seen.growth_rate)
            return grows and seen.amplitude > _NEAR * self.limits.amplitude_limit
        if flagged_for > _LASTING_FLAG and self._vibration.is_steady():
            return True
        if flagged_for > _EXPECTED_FLAG and self._chance[1] < _EXPECTED:
            return True
        times = _GROWING if grows else _GROWN
        return self._vibration.stands_out(_UNEXPECTED if self._chance[1] > 0.5 else times)

    # -- no chatter --------------------------------------------------------------------------

    def _quiet(self, seen: Seen) -> Action | None:
        """Say that it is over, and watch the margin."""
        if not math.isnan(self._alarm_at):
            when = f', {seen.time - self._alarm_at:.1f} s after the flag'
            if not self._has_seen_quiet:  # the flag was up before anybody looked
                when = ''
            moves, self._has_seen_quiet = self.moves, True
            self._forget()
            word = 'move' if moves == 1 else 'moves'
            if moves or not self._is_of_before:
                self._ended = f'The chatter has ended{when}; {moves} {word}.'
        self._is_of_before = False
        if self._ended and not seen.judged:  # by a lathe or a monitor that has begun anew
            return None
        if self._ended:
            ended, self._ended = self._ended, ''
            return Action(ended)
        self._has_seen_quiet = True
        self._vibration.note_quiet()
        if not seen.margin < self._margin_limit:
            self._safe_since = math.nan
            self._warned &= not seen.margin > 1.5 * self._margin_limit
            return None
        if math.isnan(self._safe_since):
            self._safe_since = seen.time
        if self._warned or seen.time < self._safe_since + _LASTING:
            return None
        self._warned = True
        why = _small_margin(100.0 * seen.margin, 100.0 * self._margin_limit)
        if not self._move_early or self._hindrance(seen):
            return Action(f'{why}.')
        return self._move(seen, why)

    def _once(self, sentence: str) -> Action | None:
        """A sentence, unless the same was the last one: figures do not make it another."""
        kind = ''.join(letter for letter in sentence if not (letter.isdigit() or letter in '.-+'))
        if kind == self._said:
            return None
        self._said = kind
        return Action(sentence)


def _same(one: Cut, other: Cut) -> bool:
    """Whether two cuts are one and the same to a machinist."""
    pairs = (
        (getattr(one, name), getattr(other, name))
        for name in ('spindle_speed_rpm', 'depth_of_cut', 'feed', 'speed_variation_amplitude')
    )
    return all(abs(a - b) <= _SAME * abs(b) for a, b in pairs)


def _small_margin(margin: float, limit: float) -> str:
    """That a margin is less than its limit, both in %."""
    less = f'less than margin_limit, {limit:.4g} %'
    if margin <= 0.0:
        return f'The depth is at or beyond the limit: its margin is {margin:.3g} %, {less}'
    rounded = f'{margin:.0f}'
    if float(rounded) >= limit:
        rounded = f'{math.floor(10.0 * margin) / 10.0:g}'
    return f'The depth may grow by {rounded} % only, {less}'


def _figures(seen: Seen) -> str:
    # Of small vibration: large vibration may last where that is negative.
    growth = 'growing at' if seen.growth_rate > 0.0 else 'growth rate'
    known = [
        (seen.frequency, f'at {seen.frequency:.1f} Hz'),
        (seen.growth_rate, f'{growth} {seen.growth_rate:.1f} 1/s'),
        (seen.amplitude, f'amplitude {1e6 * seen.amplitude:.3g} um'),
    ]
    words = [text for value, text in known if math.isfinite(value)]
    return f'Chatter {", ".join(words) or "flagged"}'
