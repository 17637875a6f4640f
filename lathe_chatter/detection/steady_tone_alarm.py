"""A line that stands above everything else that is heard: chatter that nobody heard begin.

Where the spindle is not seen, or sound is all there is, the rise of a vibration tells little: a
cut that begins is louder too. But chatter is one tone that holds nearly all the power, and keeps
its amplitude, where cutting and an idle machine have many lines, and a mode that noise excites
swells and fades. Nor does a rise of energy raise an alarm here but where a line holds the power:
of the last hops, where the spindle's angle has freed the signal of all that repeats with it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lathe_chatter.array_types import Array
from lathe_chatter.detection.baseline import SLOWEST_FALL
from lathe_chatter.detection.detector_state import HOPS
from lathe_chatter.detection.one_band_detector import BandDetector

_SHARE, _GONE = 0.55, 0.3
"""Part of all power in the line that makes an alarm, and below which it is over."""
_UNSTEADY, _SLOW_UNSTEADY, _SLOW = 0.6, 0.35, 250.0
"""Standard deviation of its power over the mean; 1 for noise in a mode, but less is seen of one
that swells slowly: below so many Hz more is asked."""
_QUIET, _FORGETTING = 0.1, 1e-3
"""Part of the loudest that was heard, below which nothing is cut: a hum that is left alone there
is no chatter; and what of the loudest a look forgets."""
_PRESENT = 0.2
"""Part of its mean power that a line must have now: what has ended stands in the mean for long."""
_LOOKS, _LOOKS_GONE = 3, 4
"""Looks in a row that must find it, and that must find none any more."""
_EVEN = 0.9
"""Part of the changes of its power that is one even fall, where it dies down: noise is uneven."""
_FALLEN = 0.75
"""Part of its mean power that the power of the last hops is at least, if it does not die down."""
_NEWEST = 8
"""Hops whose power is looked at where a rise is enough."""
_OTHER = 0.08
"""Part by which a line is another line: chatter keeps its frequency."""


class SteadyToneAlarm:
    """Looks for the line over the bands of a few judges, and raises the alarm of its band.

    Args:
        judges: Of the bands, rising; they raise no alarm by themselves any more.
        strictness: The score that makes an alarm.
        angle: Whether the spindle's angle is seen.
    """

    def __init__(self, judges: Sequence[BandDetector], strictness: float, *, angle: bool) -> None:
        """Nothing found."""
        self._judges, self._angle = judges, angle
        self._strictness = strictness
        for judge in judges:
            judge.state.now[0].strictness = np.inf
        self._weights = [judge.line_weights for judge in judges]
        self._found, self._hertz, self._loudest = 0, 0.0, 0.0

    def look(self) -> None:
        """Look, after hops were judged."""
        powers = [j.state.line[0] * w for j, w in zip(self._judges, self._weights, strict=True)]
        heard = zip(self._judges, powers, strict=True)
        total = sum(float(power.sum()) / judge.overlap for judge, power in heard)
        if not total > 0.0:
            return
        self._loudest = max((1.0 - _FORGETTING) * self._loudest, total)
        best = max(range(len(powers)), key=lambda k: float(powers[k].max()))
        place = int(powers[best].argmax())
        share = _with_neighbour(powers[best], place) / total
        audible = total > _QUIET * self._loudest
        if self._angle and audible:
            self._alarm_by_rise()
        self._weigh(self._judges[best], place, share if audible else 0.0)
        for k, judge in enumerate(self._judges):
            now = judge.state.now[0]
            if k == best and share > _GONE and self._is_same(self._judges[best].centres[place]):
                now.line_gone = 0
            elif now.alarmed and judge.line_known(int(powers[k].argmax())):
                # An alarm from other sensors stands until it is known that there is no line.
                now.line_gone += 1
                if now.line_gone >= _LOOKS_GONE:
                    judge.end_alarm()

    def _alarm_by_rise(self) -> None:
        """Raise the alarm where a band's energy has risen enough, and a line holds the newest."""
        judge = max(self._judges, key=lambda each: float(each.state.now[0].score))
        now = judge.state.now[0]
        if not now.score >= self._strictness or now.by_line:
            return
        total = line = 0.0
        for each, weights in zip(self._judges, self._weights, strict=True):
            last = int(each.state.now[0].newest) - np.arange(_NEWEST)
            powers = (np.abs(each.state.motion[last % HOPS]) ** 2).mean(axis=0) * weights
            total += float(powers.sum()) / each.overlap
            if each is judge:
                place = int(powers.argmax())
                line = _with_neighbour(powers, place)
        if line > _SHARE * total:
            self._hertz = float(judge.centres[place])
            judge.raise_by_line()

    def _is_same(self, hertz: float) -> bool:
        """Whether this is the frequency of the line that was found last."""
        return bool(abs(hertz - self._hertz) < _OTHER * hertz)

    def _weigh(self, judge: BandDetector, place: int, share: float) -> None:
        """Raise the alarm where the loudest line, in a resonator of a judge, is chatter."""
        if share < _SHARE or not judge.line_known(place):
            self._found = 0
            return
        now, hertz = judge.state.now[0], float(judge.centres[place])
        mean, square = judge.state.line[:, place]
        unsteady = _UNSTEADY if hertz > _SLOW else _SLOW_UNSTEADY
        steady = square < (1.0 + unsteady**2) * mean**2
        if not self._is_same(hertz):
            self._found, self._hertz = 0, hertz
        risen = now.score >= self._strictness
        present = abs(judge.state.motion[now.newest, place]) ** 2 > _PRESENT * mean
        present = present and not _dies_down(judge, place)
        change = 1 if present and (steady or risen) else -1
        self._found = min(max(self._found + change, 0), _LOOKS)
        if self._found >= _LOOKS and not now.by_line:
            judge.raise_by_line()


def _dies_down(judge: BandDetector, place: int) -> bool:
    """Whether the power of a resonator falls as that of vibration that is left to itself."""
    last = int(judge.state.now[0].newest) - np.arange(HOPS)
    power = np.abs(judge.state.motion[last % HOPS, place]) ** 2
    if power.mean() < _FALLEN * judge.state.line[0, place]:
        return True
    ago = np.arange(HOPS) - 0.5 * (HOPS - 1)
    fall = ago @ power / (ago @ ago)
    even = fall**2 * (ago @ ago) > _EVEN * HOPS * power.var()
    return bool(even and fall > 2.0 * SLOWEST_FALL * judge.period * power.mean())


def _with_neighbour(power: Array, place: int) -> float:
    """A line's power where it falls between two resonators: that of both."""
    below = float(power[place - 1]) if place > 0 else 0.0
    above = float(power[place + 1]) if place + 1 < power.size else 0.0
    return float(power[place]) + max(below, above)
