"""The moves that end chatter within limits: another speed, a varied speed, a smaller cut.

No machine is told exactly, so machines are drawn that the truth may be, and a move has to suit
them all; where none does, most of them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from lathe_chatter.array_types import Array
from lathe_chatter.errors import ParameterError
from lathe_chatter.model import Cut, Machine
from lathe_chatter.model.quantity_fields import check_fields, limits_of, quantity
from lathe_chatter.stability import (
    ProcessDamping,
    critical_depths,
    floquet,
    rightmost_roots,
    seating_depth,
)
from lathe_chatter.supervisor.likely_machines import carried, contacts_of
from lathe_chatter.supervisor.rehearsal import dies

_VARIED, _REHEARSED, _FAILING = 8, 4, 1
"""Of the machines that the truth may be: those that a varied speed has to suit, those on which a
move is rehearsed, and those of them, never the told one, on which that may fail."""
ODD, MOST_ODD = (0, 2, 6), (12,)
"""Of the machines, those that a move need not suit: none, and more where there is no such move."""
_SPEEDS = 240
_MOST_TRIED = 10
"""Moves that are rehearsed before others are looked for."""
_RESERVE = 1.05
"""By which a depth stays away from every limit."""
_SHORT_WAY = 0.05
"""Part of the removal rate that a speed e times as far away has to be worth."""
_SHALLOWER = 0.75
_ONE_CONTACT, _VARYING = 0.85, 0.9
"""Worth of what suits one contact of the bearing alone, and of a varied speed."""
_SURE_DECAY = -1.0
"""Growth rate below which a varied speed is believed to help, 1/s."""
_NEARLY_ALL = 0.9
"""Of the removal rate: a move that keeps it leaves no need to look for others than speeds."""
_SLOWEST_SWING = 0.2
"""Frequency of a variation below which none is tried, Hz."""


def _speed(meaning: str, default: float) -> float:
    limits = limits_of(Cut, 'spindle_speed_rpm')
    speed: float = quantity(meaning, 'rev/min', default=default, low=limits.low, high=limits.high)
    return speed


@dataclass(frozen=True)
class Limits:
    """What nothing overrides.

    Raises:
        ParameterError: If a value is outside its own limits, or there is no speed left.
    """

    slowest_speed: float = _speed('slowest spindle speed to go to', 1000.0)
    fastest_speed: float = _speed('fastest spindle speed to go to', 12000.0)
    ramp: float = quantity(
        'change of the spindle speed at most, by a move and by a variation',
        'rev/min per s', default=5000.0, low=1.0, high=1e6,
    )  # fmt: skip
    smallest_depth: float = quantity('smallest depth of cut to go to', 'm', default=1e-4, high=0.1)
    smallest_feed: float = quantity(
        'smallest feed per revolution to go to', 'm', default=1e-5, high=0.01
    )
    largest_variation: float = quantity(
        'largest amplitude of a speed variation, fraction of the speed; 0: none',
        default=0.2, high=0.5,
    )  # fmt: skip
    amplitude_limit: float = quantity(
        'vibration of the tool beyond which growing chatter is stopped, and none goes on its way',
        'm', default=5e-4, high=0.1, exclusive=True,
    )  # fmt: skip
    most_moves: float = quantity('moves by itself against one chatter', default=3.0, high=100.0)

    def __post_init__(self) -> None:
        """Validate."""
        check_fields(self)
        if not self.slowest_speed < self.fastest_speed:
            allowed = f'above slowest_speed, which is {self.slowest_speed:g} rev/min'
            raise ParameterError('fastest_speed', self.fastest_speed, 'rev/min', allowed)


@dataclass(frozen=True)
class Move:
    """Another cut.

    Attributes:
        cut: To go to.
        growth_rate: Predicted there, the greater one of open and seated where both may be, 1/s.
        margin: By what fraction its depth may still grow; nan where the speed varies.
        kept: Of the removal rate; more than 1 where a faster spindle more than makes up for depth.
        tried: How many of the machines that the truth may be it was tried on.
        share: Of these, those on which it is stable, or more.
    """

    cut: Cut
    growth_rate: float
    margin: float
    kept: float
    tried: int
    share: float

    def changes_from(self, cut: Cut) -> dict[str, float]:
        """What has to be set, by name."""
        names = (
            *('spindle_speed_rpm', 'depth_of_cut', 'feed_speed', 'feed_per_revolution'),
            *('speed_variation_amplitude', 'speed_variation_frequency'),
        )
        return {n: getattr(self.cut, n) for n in names if getattr(self.cut, n) != getattr(cut, n)}


def removal_rate(cut: Cut) -> float:
    """Depth times the speed of the feed, m2/s: in turning the volume is pi D times that."""
    return cut.depth_of_cut * cut.feed * cut.spindle_speed_rpm / 60.0


def moves_for(  # noqa: PLR0913, PLR0917 -- a cut, and all that a move has to keep to
    machines: Sequence[Machine], cut: Cut, limits: Limits, amplitude: float = 0.0,
    reserve: float = 1.0, odd_ones: Sequence[int] = ODD,
) -> Iterator[Move]:  # fmt: skip
    """Moves that are predicted to end chatter, the one of greatest worth first.

    A cut that chatters across a clearance is open and seated in turn, so a move that suits both
    is worth more than one that suits the contact that the mean force makes.

    Args:
        machines: That the truth may be, the told one first, see `may_be`.
        cut: The present one.
        limits: That no move leaves.
        amplitude: Of the vibration now, m: it must not pass its limit on the way, and has to die;
            0 where there is none.
        reserve: By which a depth stays away from every limit, more than usual.
        odd_ones: Of the machines, how many a move need not suit, tried in turn.
    """
    if not cut.depth_of_cut > 0.0:
        return
    searches = [
        _Search(machines, cut, limits, reserve * _RESERVE, *contact)
        for contact in contacts_of(cut)
    ]
    for odd in odd_ones:
        if odd >= len(machines):
            return
        found = [each for search in searches for each in search.constant_speeds(odd)]
        if not any(removal_rate(each.cut) > _NEARLY_ALL * removal_rate(cut) for each in found):
            for search in searches:
                found += [*search.smaller_feeds(odd), *search.varied_speeds(odd)]
        passable = False
        for each in sorted(found, key=lambda each: -each.worth)[:_MOST_TRIED]:
            move = each.search.move(each.cut, odd)
            if _passes(machines, cut, move, limits, amplitude):
                passable = True
                yield move
        if passable:
            return


def _passes(
    machines: Sequence[Machine], cut: Cut, move: Move, limits: Limits, amplitude: float
) -> bool:
    """Whether vibration of an amplitude dies by a move, and keeps to its limit on the way."""
    if not amplitude:
        return True
    failed = 0
    for machine in machines[:_REHEARSED]:
        try:
            failed += not dies(
                machine, cut, move.cut, growth_rate=move.growth_rate, ramp=limits.ramp,
                amplitude=amplitude, amplitude_limit=limits.amplitude_limit,
            )  # fmt: skip
        except ParameterError:  # no lathe is computed that turns so slowly: roots alone tell
            return True
        if failed and (machine is machines[0] or failed > _FAILING):
            return False
    return True


class _Candidate(NamedTuple):
    """What a cut is worth, the cut, and who has found it."""

    worth: float
    cut: Cut
    search: _Search


class _Search:
    """Looks for another cut that is stable in some contact with the bearing."""

    def __init__(  # noqa: PLR0913, PLR0917 -- what it looks among
        self, machines: Sequence[Machine], cut: Cut, limits: Limits, reserve: float,
        parts: Sequence[float], side: int,
    ) -> None:  # fmt: skip
        """Compute the limits of all machines, in order at each speed."""
        self._cut, self._limits, self._reserve, self._side = cut, limits, reserve, side
        self._process = ProcessDamping.of(cut)
        self._machines = [[carried(machine, part) for part in parts] for machine in machines]
        low, high = limits.slowest_speed, limits.fastest_speed
        # Whole numbers, as a machinist would set them, and the present one.
        even = np.round(60.0 / np.linspace(60.0 / high, 60.0 / low, _SPEEDS))
        speeds = np.unique([*even, cut.spindle_speed_rpm])
        self._speeds: Array = speeds[(speeds >= low) & (speeds <= high)]
        self._feed = np.full(self._speeds.shape, cut.feed_per_revolution)
        if not cut.feed_per_revolution:
            self._feed = 60.0 * cut.feed_speed / self._speeds
        each = np.array(self._machines, dtype=object)[:, :, None]
        depths = critical_depths(each, self._speeds, seated=True, process=self._process)
        self._deepest: Array = np.sort(depths.min(axis=1), axis=0) / reserve
        # A seating line is inverse to the feed.
        line = [seating_depth(machine, cut.bearing_clearance, 1.0) for machine in machines]
        self._line: Array = np.sort(line)[:, None] / np.maximum(self._feed, 1e-30)

    def _suits(self, odd: int) -> tuple[Array, Array]:
        """Above which depth, and up to which, all machines but some are stable, at each speed."""
        deepest = self._deepest[odd]
        if self._side < 0:
            deepest = np.minimum(deepest, self._line[odd] / self._reserve)
        shallowest = np.zeros_like(deepest)
        if self._side > 0:
            shallowest = self._line[-1 - odd] * self._reserve
        return shallowest, deepest

    def _at_present(self, values: Array) -> float:
        """Of values at each speed, that at the present one; nan where that is not allowed."""
        here = values[self._speeds == self._cut.spindle_speed_rpm]
        return float(here[0]) if here.size else math.nan

    def constant_speeds(self, odd: int) -> Iterator[_Candidate]:
        """Speeds, each with the greatest depth that suits all machines but some."""
        cut, limits = self._cut, self._limits
        shallowest, deepest = self._suits(odd)
        depth = np.minimum(deepest, cut.depth_of_cut)
        allowed = (depth > shallowest) & (depth >= min(limits.smallest_depth, cut.depth_of_cut))
        # A faster spindle turns more often while the feed speed stays.
        allowed &= self._feed >= min(limits.smallest_feed, cut.feed)
        kept = depth * self._feed * self._speeds / 60.0 / max(removal_rate(cut), 1e-30)
        away = np.abs(np.log(self._speeds / cut.spindle_speed_rpm))
        worth = np.minimum(kept, 1.0) * (_ONE_CONTACT if self._side else 1.0) - _SHORT_WAY * away
        worth = np.where(allowed, worth, -np.inf)
        beside = np.pad(worth, 1, constant_values=-np.inf)
        best = allowed & (worth >= beside[:-2]) & (worth >= beside[2:])
        least = np.maximum(min(limits.smallest_depth, cut.depth_of_cut), shallowest)
        for k in np.flatnonzero(best).tolist():
            # Large vibration that the greatest depth would keep may die in a smaller one.
            for part in (1.0, _SHALLOWER)[: 1 + bool(self._side)]:
                changes = {'spindle_speed_rpm': self._speeds[k],
                           'depth_of_cut': max(part * depth[k], least[k])}  # fmt: skip
                yield self._candidate(part * worth[k], changes)

    def smaller_feeds(self, odd: int) -> Iterator[_Candidate]:
        """The largest feed at which the mean force leaves the workpiece floating."""
        cut = self._cut
        part = self._at_present(self._line[odd]) / self._reserve / cut.depth_of_cut
        stable = self._at_present(self._deepest[odd]) >= cut.depth_of_cut
        if self._side < 0 and stable and self._limits.smallest_feed / cut.feed <= part < 1.0:
            name = 'feed_per_revolution' if cut.feed_per_revolution else 'feed_speed'
            yield self._candidate(part * _ONE_CONTACT, {name: part * getattr(cut, name)})

    def varied_speeds(self, odd: int) -> Iterator[_Candidate]:
        """The largest variations that the spindle can follow, around the present speed."""
        cut, limits, rpm = self._cut, self._limits, self._cut.spindle_speed_rpm
        shallowest, _ = self._suits(odd)
        floats = self._side >= 0 or self._at_present(self._line[odd]) > cut.depth_of_cut
        if not (floats and cut.depth_of_cut > self._at_present(shallowest)):
            return
        highest = 0.1 * limits_of(Cut, 'speed_variation_frequency').high
        for amplitude in {0.5 * limits.largest_variation, limits.largest_variation} - {0.0}:
            swing = amplitude * rpm
            frequency = min(limits.ramp / (2.0 * math.pi * swing), highest)
            fits = limits.slowest_speed <= rpm - swing and rpm + swing <= limits.fastest_speed
            if fits and frequency >= _SLOWEST_SWING:
                changes = {'speed_variation_amplitude': amplitude,
                           'speed_variation_frequency': frequency}  # fmt: skip
                new = cut.with_changes(**changes)
                if all(
                    self._growth(number, new) < _SURE_DECAY
                    for number in range(min(_VARIED, len(self._machines)))
                ):
                    yield self._candidate(
                        _VARYING * (_ONE_CONTACT if self._side else 1.0), changes
                    )

    def _candidate(self, worth: float, changes: Mapping[str, float]) -> _Candidate:
        numbers = {name: float(value) for name, value in changes.items()}
        return _Candidate(float(worth), self._cut.with_changes(**numbers), self)

    def move(self, new: Cut, odd: int) -> Move:
        """What is predicted of a cut that suits all machines but some."""
        margin, tried = math.nan, len(self._machines)
        share = 1.0 - odd / tried
        if new.speed_variation_amplitude:
            tried, share = min(_VARIED, tried), 1.0
        else:
            depths = critical_depths(
                self._machines[0], new.spindle_speed_rpm, seated=True, process=self._process
            )
            margin = float(depths.min()) / new.depth_of_cut - 1.0
        kept = removal_rate(new) / max(removal_rate(self._cut), 1e-30)
        return Move(new, self._growth(0, new), margin, kept, tried, share)

    def _growth(self, number: int, new: Cut) -> float:
        """The greatest growth rate of one of the machines, 1/s."""
        if new.speed_variation_amplitude:
            return max(floquet(m, new, seated=True).growth_rate for m in self._machines[number])
        roots = rightmost_roots(
            self._machines[number], new.spindle_speed_rpm, new.depth_of_cut,
            seated=True, process=self._process, proven=False,
        )  # fmt: skip
        return float(roots.real.max())


def change_words(changes: Mapping[str, float], cut: Cut) -> str:
    """Changes of a cut in words."""
    return ', '.join(f'{n} from {getattr(cut, n):.6g} to {v:.6g}' for n, v in changes.items())


def expectation(move: Move) -> str:
    """What is expected of a move, in words."""
    margin = '' if math.isnan(move.margin) else f', margin {100.0 * move.margin:.0f} %'
    kept = f'{100.0 * move.kept:.0f} % of the removal rate'
    least = '' if move.share == 1.0 else 'at least '
    sure = f'on {least}{move.share * move.tried:.0f} of {move.tried} machines that this may be'
    return f'predicted: growth {move.growth_rate:.1f} 1/s{margin}, {kept}; stable {sure}'
