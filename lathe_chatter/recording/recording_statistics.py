"""What happens in a run while it is being recorded, kept for the summary at its end.

It looks at the numbers of messages that it knows and at nothing else of them; they are recorded
as they came.
"""

from __future__ import annotations

import json
from bisect import bisect_left
from collections import Counter, deque
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from lathe_chatter.errors import LayoutError
from lathe_chatter.recording.cut_log import CutLog, logger_of
from lathe_chatter.recording.ros_messages import LOG_TYPE, namespace_of, types
from lathe_chatter.samples.codec import SAMPLES_TYPE, SampleDecoder
from lathe_chatter.samples.continuity import BlockOrder, missing_in
from lathe_chatter.samples.mixed_streams import MixedContinuity

FLAG_TYPE = 'std_msgs/msg/Bool'
_FLAG_BYTE = 4
"""Where the truth is in a serialised Bool, after the encapsulation."""
_MAX_DISCONTINUITIES = 1000
"""Discontinuities that are kept for who asks for them."""
_MAX_BLOCKS = 1000
"""Blocks about which it is known when they came, to date other messages by."""
_MIN_SILENCE = 0.1
"""s without a block that count as silence, where blocks usually come more often."""
_MISSED_RATIO = 2.0
"""Times as long as usual that a lathe whose blocks come seldom may take before it is silent."""
_SILENCE_RATIO = 10.0
"""So many times longer than usual must a silence be."""


class Discontinuity(NamedTuple):
    """Where samples do not simply follow those before.

    Attributes:
        order: What is there instead.
        before: Simulated time of the last sample before, s; None before the first.
        after: Of the first after it, s.
        missing: How many samples of the lathe are missing there.
    """

    order: BlockOrder
    before: float | None
    after: float
    missing: int


@dataclass
class SamplesReceived:
    """The samples of one lathe, by their own times.

    Attributes:
        continuity: Counts samples, gaps, lost samples and restarts.
        first: Simulated time of the first sample, s; None before it.
        head: Samples that the lathe took before the first one that came.
        silent: Whether none came since the last look; where they come seldom, for twice as long as
            usual.
        silences: How often it published nothing for much longer than usual.
        longest: The longest time from one block to the next, s.
        pauses: Simulated times before and after what the recorder left out in pauses, s.
        complaint: What is wrong with the layout of a message; empty where all is well.
        restarted: Whether a lathe began again since this was taken back.
        mixture: Who sends at once what only one may, a sentence of the recorder; else empty.
        discontinuities: The latest places where samples are missing or begin, until they are
            logged.
    """

    continuity: MixedContinuity = field(default_factory=MixedContinuity)
    first: float | None = None
    head: int = 0
    silent: bool = False
    silences: int = 0
    longest: float = 0.0
    pauses: list[tuple[float, float]] = field(default_factory=list)
    complaint: str = ''
    restarted: bool = False
    mixture: str = ''
    discontinuities: deque[Discontinuity] = field(
        default_factory=lambda: deque(maxlen=_MAX_DISCONTINUITIES)
    )
    _decoder: SampleDecoder = field(default_factory=SampleDecoder)
    _published: int = 0
    _seen: int = 0
    _missed: int = 0
    _paused: bool = False
    _usual: float = 0.0
    _came: deque[tuple[int, float]] = field(default_factory=lambda: deque(maxlen=_MAX_BLOCKS))

    def receive(self, data: bytes, log_time: int, publish_time: int) -> None:
        """Follow a block of samples, serialised; times in ns since the epoch."""
        try:
            times = self._times(data)
        except LayoutError as error:
            self.complaint = str(error)
            return
        if not len(times):
            return
        if not np.logical_and.reduce(np.isfinite(times)):  # half of what its method `all` takes
            self.complaint = 'The times of samples are no numbers.'
            return
        last = float(times[-1])
        self._join(times)
        self._came.append((log_time, last))
        self._follow(publish_time)

    def _join(self, times: Any) -> None:
        """Join a block by its times (n,), s."""
        before, lost = self.continuity.last, self.continuity.lost
        order = self.continuity.join(times)
        if self._paused:
            self._paused = False
            if order is BlockOrder.GAP and before is not None:  # it was left out, and not lost
                self.pauses.append((before, float(times[0])))
                self.continuity.lost = lost
                self.continuity.gaps -= 1
                return
        if order is BlockOrder.CONTIGUOUS:
            return
        if order is BlockOrder.RETURN:
            for each in [*self.discontinuities]:
                if (each.before, each.after) == self.continuity.undone:
                    self.discontinuities.remove(each)
            return
        first, missing = float(times[0]), self.continuity.lost - lost
        if order is not BlockOrder.GAP:
            step = (float(times[-1]) - first) / (len(times) - 1) if len(times) > 1 else first
            missing = max(missing_in((0.0, first), step), 0) if step > 0.0 else 0
        if order is BlockOrder.FIRST:
            self.first, self.head = first, missing
        self.discontinuities.append(Discontinuity(order, before, first, missing))
        self.restarted |= order is BlockOrder.RESTART

    def look(self, *, awaited: bool) -> None:
        """Notice once a second whether samples have come, where they are awaited."""
        self._missed = self._missed + 1 if self.continuity.samples == self._seen else 0
        self.silent = awaited and self._missed > _MISSED_RATIO * self._usual
        self._seen = self.continuity.samples

    def pause(self) -> None:
        """Blocks are left out from now on."""
        self._paused, self._published = True, 0

    def clock_stepped(self, step: int) -> None:
        """The clock that dates blocks was set, by so many ns."""
        self._published += step if self._published else 0
        self._came.clear()

    def time_at(self, log_time: int) -> float:
        """Simulated time when another message was received, s: that of the block about then."""
        place = bisect_left(self._came, (log_time, 0.0))
        return self._came[min(place, len(self._came) - 1)][1] if self._came else 0.0

    def _times(self, data: bytes) -> Any:
        samples, columns = self._decoder.decode(data)
        if 'time' not in columns:
            raise LayoutError('The samples have no column time.')
        return samples[:, columns.index('time')]

    def _follow(self, publish_time: int) -> None:
        """Notice silences, by the clock of who publishes."""
        if self._published:
            passed = (publish_time - self._published) / 1e9
            self.longest = max(self.longest, passed)
            if self._usual and passed > max(_MIN_SILENCE, _SILENCE_RATIO * self._usual):
                self.silences += 1
            else:
                self._usual += 0.1 * (passed - self._usual) if self._usual else passed
        self._published = publish_time


@dataclass
class RunLog:
    """What happened so far.

    Attributes:
        messages: By name of topic.
        samples: By name of topic.
        flags: Simulated time, topic and truth of each change of a monitor's flag.
        cut_logs: What each logger said of a cut.
        pauses: When what came was left out, from and to, ns since the epoch; 0: until now.
    """

    messages: Counter[str] = field(default_factory=Counter)
    samples: dict[str, SamplesReceived] = field(default_factory=dict)
    flags: list[tuple[float, str, bool]] = field(default_factory=list)
    cut_logs: dict[str, CutLog] = field(default_factory=dict)
    pauses: list[list[int]] = field(default_factory=list)
    _flag: dict[str, bool] = field(default_factory=dict)

    def receive(
        self, topic: str, kind: str, data: bytes, log_time: int, publish_time: int
    ) -> None:
        """Note a message of a topic, serialised; times in ns since the epoch."""
        self.messages[topic] += 1
        if kind == SAMPLES_TYPE and topic.endswith('/samples'):
            if (received := self.samples.get(topic)) is None:  # not one made for each message
                received = self.samples[topic] = SamplesReceived()
            received.receive(data, log_time, publish_time)
        elif kind == FLAG_TYPE and topic.endswith('/chatter') and len(data) > _FLAG_BYTE:
            self._receive_flag(topic, bool(data[_FLAG_BYTE]), log_time)
        elif kind == LOG_TYPE:
            self._receive_log(data, publish_time)

    def pause(self, now: int) -> None:
        """What comes is left out from now on, ns since the epoch."""
        self.pauses.append([now, 0])
        for received in self.samples.values():
            received.pause()

    def resume(self, now: int) -> None:
        """What comes is taken again."""
        self.pauses[-1][1] = now

    def pause_values(self) -> dict[str, str]:
        """The pauses as the values of a record, as far as samples have come since."""
        places = {name: json.dumps(each.pauses) for name, each in self.samples.items()}
        return {'clock': json.dumps(self.pauses), **places}

    def _receive_flag(self, topic: str, up: bool, log_time: int) -> None:  # noqa: FBT001 -- it is one
        if up != self._flag.get(topic, False):
            self._flag[topic] = up
            time = self._time_beside(topic, log_time)
            self.flags.append((time, topic, up))

    def _time_beside(self, topic: str, log_time: int) -> float:
        """Simulated time when a message came, s: of the lathe beside its node, or the first."""
        lathes = sorted(self.samples, key=lambda name: namespace_of(name) != namespace_of(topic))
        return self.samples[lathes[0]].time_at(log_time) if lathes else 0.0

    def _receive_log(self, data: bytes, publish_time: int) -> None:
        message = types().deserialize_cdr(data, LOG_TYPE)
        self.cut_logs.setdefault(message.name, CutLog()).receive(message.msg, publish_time)

    def cut_log_of(self, lathe: str) -> CutLog:
        """What a lathe, by the full name of its node, logged."""
        return self.cut_logs.get(logger_of(lathe), CutLog())
