"""What a monitor said in a recorded run: its figures and its flag, on the axis of a history.

Its messages have no time of their own and are dated by the samples about which they came. With a
change of the flag it logs a sentence, which has the simulated time at which that was decided: a
monitor that was late, or a recorder, does not move the flag where this is in the record.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from lathe_chatter.array_types import Array
from lathe_chatter.recording.cut_log import logger_of
from lathe_chatter.recording.recorded_cuts import LOG, RecordedCuts, message_of
from lathe_chatter.recording.run import MONITOR
from lathe_chatter.recording.run_timeline import Placed

DECIDED = re.compile(r'At (?P<time>\d+\.\d{6}) s: (?:(?P<up>chatter)|the chatter has died out)\b')
"""The sentences of the monitor about its flag (`nodes/monitor_sentences.py`)."""
_BEFORE, _AFTER = 100_000_000, 5_000_000_000
"""ns before and after a flag within which its sentence is published: the advice that this
gives is looked for meanwhile, on a busy machine for more than a second."""
_ROUNDING = 0.1
"""s by which a flag may be received before the samples of which it is."""


@dataclass(frozen=True)
class Flag:
    """The monitor's flag rising (or falling), with its estimates about then.

    Attributes:
        time: Simulated time, s: at which it was decided, if that is in the record.
        chatter: What the flag said.
        frequency: Hz, nan where unknown.
        growth_rate: 1/s, nan where unknown.
        started: Whether the monitor was started anew: its flag says nothing of before.
        late: How much later it was received, s.
    """

    time: float
    chatter: bool
    frequency: float = float('nan')
    growth_rate: float = float('nan')
    started: bool = False
    late: float = 0.0

    @property
    def received(self) -> float:
        """Simulated time of the samples about which it came, s: as its estimates are dated."""
        return self.time + self.late


class _Decision(NamedTuple):
    """When which monitor logged what of its flag: ns, and its simulated time, s."""

    logger: str
    published: int
    up: bool
    time: float


class MonitorRecord:
    """What the monitor of a lathe said.

    Args:
        cuts: Of the lathe, with the messages of its monitor and of the log.
        begins: Of the sessions that have samples, on the axis of the history, s.
    """

    def __init__(self, cuts: RecordedCuts, begins: Sequence[float]) -> None:
        """See the class."""
        self._cuts = cuts
        self._begins = {id(c): t for c, t in zip(cuts.sampled, begins, strict=True)}
        self._decisions = [*map(_decision, (m for m in cuts.messages if m.raw.topic == LOG))]

    def series(self, name: str) -> Array:
        """A figure over time (2, m)."""
        return np.array(self.said(name), dtype=float).reshape(-1, 2).T

    def said(self, name: str) -> list[tuple[float, Any]]:
        """When it said what on one of its topics, s."""
        return [(sum(self._time(each)), message_of(each).data) for each in self._of(name)]

    def flags(self, estimates: dict[str, Array]) -> list[Flag]:
        """Every change of the flag, and where a monitor was started anew, with its flag down."""
        flags: list[Flag] = []
        up, numbers = False, dict[str, tuple[int, int]]()
        for each in self._of('chatter'):
            raw, chatter = each.raw, bool(message_of(each).data)
            begin, since = self._time(each)
            received = begin + since
            # A file that begins with a message of the one before has it once more, as it was.
            number, published = numbers.get(raw.topic, (0, 0))
            numbers[raw.topic] = raw.sequence, raw.publish_time
            if 0 < raw.sequence <= number and raw.publish_time != published:
                up = False
                flags.append(Flag(received, chatter=False, started=True))
            if chatter == up:
                continue
            up = chatter
            frequency, growth_rate = (
                value_near(estimates[name], received) for name in ('frequency', 'growth_rate')
            )
            last = flags[-1].time - begin if flags else -math.inf
            late = since - self._decided(each, last, since, up=up)
            flags.append(Flag(received - late, up, frequency, growth_rate, late=late))
        return flags

    def _of(self, name: str) -> list[Placed]:
        return [each for each in self._cuts.messages if each.raw.topic.endswith(MONITOR + name)]

    def _time(self, found: Placed) -> tuple[float, float]:
        """Where the session begins in which a message was received, and how long after, s."""
        received, _ = self._cuts.timeline.steady(found)
        session = self._cuts.session_at(received)
        since = self._cuts.timeline.simulated_time(received, session.blocks)
        return self._begins[id(session)], since

    def _decided(self, found: Placed, last: float, received: float, *, up: bool) -> float:
        """When a flag was decided in its session, s; when it was received, if nothing tells.

        Not before the `last` change of it, s.
        """
        logger = logger_of(found.raw.topic.rsplit('/', 1)[0])
        told = [
            (each.published, each.time)
            for each in self._decisions
            if each is not None
            and each.logger == logger
            and each.up == up
            and -_BEFORE <= each.published - found.raw.publish_time <= _AFTER
            and last < each.time <= received + _ROUNDING  # else of samples before a reset
        ]
        return min(told)[1] if told else received


def _decision(found: Placed) -> _Decision | None:
    """What a sentence of the log says of a flag; None where it is about something else."""
    message = message_of(found)
    match = DECIDED.match(message.msg)
    if match is None:
        return None
    up, time = match['up'] is not None, float(match['time'])
    return _Decision(message.name, found.raw.publish_time, up, time)


def value_near(series: Array, time: float) -> float:
    """The value of an estimate (2, m) nearest to a time, nan where there is none."""
    if series.shape[1] == 0:
        return math.nan
    return float(series[1, np.argmin(np.abs(series[0] - time))])
