"""The moves that end chatter within limits: another speed, a varied speed, a smaller cut."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from lathe_chatter.arrays import Array
from lathe_chatter.errors import ParameterError
from lathe_chatter.model import BearingContact, Cut, Machine
from lathe_chatter.model.quantities import check_fields, limits_of, quantity
from lathe_chatter.stability import (
    ProcessDamping,
    contact_at,
    critical_depth,
    floquet,
    rightmost_root,
    rightmost_roots,
    seating_depth,
    stable_speed_intervals,
)

_RESERVES = (0.25, 0.12, 0.04)
"""Parts by which a deeper cut must be stable still, wished and needed."""
_EDGE, _LEAST_EDGE = 0.08, 0.012
"""Parts of a speed that it stays away from the edges of its stable speeds, wished and needed."""
_DEPTHS = (1.0, 0.95, 0.9, 0.85, 0.8, 0.75, 0.7, 0.65, 0.6, 0.55, 0.5, 0.4, 0.3, 0.2, 0.1)
_SHORT_WAY = 0.05
"""Part of the removal rate that a speed e times as far away has to be worth."""
_SURE_DECAY = -1.0
"""Growth rate below which a varied speed is believed to help, 1/s."""
_ROUNDING = 1e-9
_NEARLY_ALL = 0.9
"""Of the removal rate: a move that keeps it leaves no need to look for others than speeds."""
_NEAREST = 4
"""Intervals of stable speeds that are looked into, the nearest ones."""
_SLOWEST_SWING = 0.2
"""Frequency of a variation below which none is tried, Hz."""
_MOST_HEARD = 2.0
"""Times the told C w that may be heard."""
_SURGE = 5.0
"""Times that vibration may grow to while the varied speed passes where it grows."""
_WAY = 24
"""Speeds on the way to another one that are looked at."""


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
        kept: Of the removal rate, 1 for all.
        worth: What moves are compared by.
    """

    cut: Cut
    growth_rate: float
    margin: float
    kept: float
    worth: float

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


class Regime(NamedTuple):
    """A machine and whether its workpiece is seated."""

    machine: Machine
    seated: bool


def regimes_of(machine: Machine, cut: Cut) -> tuple[Regime, ...]:
    """What a cut may be: floating, seated or, across a clearance, both and in between.

    Where it is seated for a part of each cycle, a part of the bearing carries.
    """
    floating, seated = Regime(machine, seated=False), Regime(machine, seated=True)
    if cut.bearing_contact is BearingContact.NONE:
        return (floating,)
    if cut.bearing_contact is BearingContact.SEATED:
        return (seated,)
    half = replace(machine, bearing_stiffness=0.5 * machine.bearing_stiffness)
    return floating, Regime(half, seated=True), seated


def growth_of(regimes: tuple[Regime, ...], cut: Cut) -> float:
    """The greatest predicted growth rate in some regimes, 1/s."""
    if cut.speed_variation_amplitude:
        return max(floquet(each.machine, cut, seated=each.seated).growth_rate for each in regimes)
    at = cut.spindle_speed_rpm, cut.depth_of_cut
    process = ProcessDamping.of(cut)
    return max(
        rightmost_root(each.machine, *at, seated=each.seated, process=process).real
        for each in regimes
    )


def moves_for(machine: Machine, cut: Cut, limits: Limits, amplitude: float = 0.0) -> list[Move]:
    """Moves that are predicted to end chatter, the one of greatest worth first.

    A cut that chatters across a clearance is open and seated in turn, so a move suits both where
    one does; else the contact that the mean force makes.

    Args:
        machine: As known, with C as known or heard.
        cut: The present one.
        limits: That no move leaves.
        amplitude: Of the vibration now, m: it must not pass its limit on the way.
    """
    process = ProcessDamping.of(cut)
    found: list[Move] = []
    if not cut.depth_of_cut > 0.0:
        return found
    every = regimes_of(machine, cut)
    single = [(each,) for each in every if each.machine == machine and len(every) > 1]
    for regimes in (every, *single):
        searches = [
            _Search(cut, limits, amplitude, process, regimes, reserve) for reserve in _RESERVES
        ]
        for search in searches:
            found += search.constant_speeds(_DEPTHS[:1])
        if not any(move.kept > _NEARLY_ALL for move in found):
            for search in searches:
                found += search.constant_speeds(_DEPTHS[1:])
                found += [*search.varied_speeds(), *search.smaller_feeds()]
                if found:
                    break
        if found:
            return sorted(found, key=lambda move: -move.worth)
    return found


@dataclass(frozen=True)
class _Search:
    """A cut for which another is looked for, that is stable in some regimes with a reserve."""

    cut: Cut
    limits: Limits
    amplitude: float
    process: ProcessDamping
    regimes: tuple[Regime, ...]
    reserve: float

    def constant_speeds(self, parts: Sequence[float]) -> list[Move]:
        """Speeds at parts of the present depth, from the deepest that has some."""
        found: list[Move] = []
        deepest = self.cut.depth_of_cut
        for part in parts:
            depth = part * deepest
            if depth < self.limits.smallest_depth and part < 1.0:
                break
            speeds = [
                self._inside(*each)
                for each in self._intervals((1.0 + self.reserve) * depth).tolist()
            ]
            away = {rpm: abs(math.log(rpm / self.cut.spindle_speed_rpm)) for rpm, _ in speeds}
            for rpm, edge in sorted(speeds, key=lambda speed: away[speed[0]])[:_NEAREST]:
                if edge < _LEAST_EDGE:
                    continue
                if part < 1.0:  # between two of the depths
                    depth = self._critical_depth(rpm) / (1.001 + self.reserve)
                    depth = min(max(depth, part * deepest), deepest)
                changes = {'spindle_speed_rpm': rpm, 'depth_of_cut': depth}
                found += self._move(changes, min(edge / _EDGE, 1.0))
            if any(move.kept >= part - 0.05 for move in found):
                break
        return found

    def varied_speeds(self) -> Iterator[Move]:
        """The largest variations that the spindle can follow, around the present speed."""
        rpm, largest = self.cut.spindle_speed_rpm, self.limits.largest_variation
        highest = limits_of(Cut, 'speed_variation_frequency').high
        for amplitude in (0.5 * largest, largest) if largest else ():
            low, high = rpm * (1.0 - amplitude), rpm * (1.0 + amplitude)
            if self.limits.slowest_speed <= low and high <= self.limits.fastest_speed:
                frequency = self.limits.ramp / (2.0 * math.pi * amplitude * rpm)
                if frequency < _SLOWEST_SWING:
                    continue
                changes = {
                    'speed_variation_amplitude': amplitude,
                    'speed_variation_frequency': min(frequency, 0.1 * highest),
                }
                yield from self._move(changes, 0.9)

    def smaller_feeds(self) -> Iterator[Move]:
        """The largest feed at which the mean force leaves the workpiece floating."""
        cut = self.cut
        machine, seated = self.regimes[0]
        if seated or not self._is_one_of_several():
            return
        seats = seating_depth(machine, cut.bearing_clearance, cut.feed)
        part = seats / cut.depth_of_cut / (1.0 + 2.0 * self.reserve)
        if part < 1.0 and part * cut.feed >= self.limits.smallest_feed:
            name = 'feed_per_revolution' if cut.feed_per_revolution else 'feed_speed'
            yield from self._move({name: part * getattr(cut, name)}, 0.8)

    def _intervals(self, depth: float) -> Array:
        """The speeds at which a depth is stable in all regimes (n, 2), rev/min."""
        common = np.array([[self.limits.slowest_speed, self.limits.fastest_speed]])
        for machine, seated in self.regimes:
            found = stable_speed_intervals(
                machine, depth, seated=seated, process=self.process,
                low_rpm=self.limits.slowest_speed, high_rpm=self.limits.fastest_speed,
            )  # fmt: skip
            low = np.maximum(common[:, None, 0], found[None, :, 0]).ravel()
            high = np.minimum(common[:, None, 1], found[None, :, 1]).ravel()
            common = np.stack((low, high), axis=1)[low < high]
        return common

    def _inside(self, low: float, high: float) -> tuple[float, float]:
        """The speed of an interval that is nearest to the present one, and its relative edge."""
        ends = (low, high)
        if low > self.limits.slowest_speed * (1.0 + _ROUNDING):
            ends = (low * (1.0 + _EDGE), high)
        if high < self.limits.fastest_speed * (1.0 - _ROUNDING):
            ends = (ends[0], high * (1.0 - _EDGE))
        if ends[0] >= ends[1]:
            return 0.5 * (low + high), (high - low) / (high + low)
        present = self.cut.spindle_speed_rpm
        # A whole number, as a machinist would set it.
        near = min(max(present, ends[0]), ends[1])
        return near if near == present else float(round(near)), _EDGE

    def _move(self, changes: dict[str, float], sureness: float) -> Iterator[Move]:
        """A move to a changed cut, if it is stable there, and on the way."""
        new = self.cut.with_changes(**changes)
        if new.feed < min(self.limits.smallest_feed, self.cut.feed):
            return  # a faster spindle turns more often while the feed speed stays
        deeper = new.with_changes(depth_of_cut=(1.0 + self.reserve) * new.depth_of_cut)
        varied = new.speed_variation_amplitude > 0.0
        machine, seated = self.regimes[0]
        if self._is_one_of_several() and any(
            contact_at(machine, each).seated is not seated for each in (new, deeper)
        ):
            return
        if growth_of(self.regimes, deeper) > (_SURE_DECAY if varied else 0.0):
            return
        rise = self._rise(new)
        if self.amplitude * rise > self.limits.amplitude_limit or (varied and rise > _SURGE):
            return
        margin = math.nan
        if not varied:
            margin = self._critical_depth(new.spindle_speed_rpm) / new.depth_of_cut - 1.0
        before = removal_rate(self.cut)
        kept = min(removal_rate(new) / before, 1.0) if before else 1.0
        away = abs(math.log(new.spindle_speed_rpm / self.cut.spindle_speed_rpm))
        sureness *= min(0.7 + 2.0 * self.reserve, 1.0)
        worth = kept * (0.5 + 0.5 * sureness) - _SHORT_WAY * away
        yield Move(new, growth_of(self.regimes, new), margin, kept, worth)

    def _is_one_of_several(self) -> bool:
        """Whether the regime is only that of the mean force, and holds while this does."""
        return len(self.regimes) < len(regimes_of(self.regimes[0].machine, self.cut))

    def _critical_depth(self, rpm: float) -> float:
        """The smallest of the regimes, m."""
        return min(
            critical_depth(machine, rpm, seated=seated, process=self.process)
            for machine, seated in self.regimes
        )

    def _rise(self, new: Cut) -> float:
        """How many times its amplitude the vibration may grow to while the speed changes."""
        rpm = self.cut.spindle_speed_rpm, new.spindle_speed_rpm
        lasting = abs(rpm[1] - rpm[0]) / self.limits.ramp / _WAY
        on_the_way = np.linspace(*rpm, _WAY)
        if swing := new.speed_variation_amplitude:  # and while it varies
            lasting = 1.0 / new.speed_variation_frequency / _WAY
            turn = np.linspace(0.0, 4.0 * np.pi, 2 * _WAY)
            on_the_way = rpm[1] * (1.0 + swing * np.sin(turn))
        rates = [
            rightmost_roots(
                machine, on_the_way, new.depth_of_cut, seated=seated, process=self.process,
                proven=False,
            ).real
            for machine, seated in self.regimes
        ]  # fmt: skip
        grown = highest = 0.0
        for rate in np.max(rates, axis=0) * lasting:
            grown = max(grown + rate, 0.0)
            highest = max(highest, grown)
        return math.exp(min(highest, 50.0))


def heard(machine: Machine, cut: Cut, cutting_stiffness: float) -> Machine:
    """The machine with the C that is heard, where it is greater than what was told.

    Chatter that leaves the cut makes C w look less than it is. Much more than was told is an
    error: a cut begun a moment ago, or not this one.
    """
    told = machine.cutting_stiffness(cut.depth_of_cut)
    if not 0.0 < told < cutting_stiffness < _MOST_HEARD * told:
        return machine
    return replace(machine, cutting_coefficient=cutting_stiffness / cut.depth_of_cut)


def with_tool_at(machine: Machine, frequency: float) -> Machine:
    """The machine whose tool is heard at a natural frequency, Hz; as told where that is nan."""
    if not math.isfinite(frequency) or len(machine.tool.modes) > 1:
        return machine
    tool = replace(machine.tool.modes[0], natural_frequency=2.0 * math.pi * frequency)
    return replace(machine, tool=tool)
