"""What a lathe watches of the graph: a /clock that it follows, and others on its topic."""

from __future__ import annotations

import time

from lathe_chatter.nodes.diagnostics import OK, WARN, Status
from lathe_chatter.nodes.parameter_node import ParameterNode
from lathe_chatter.nodes.polled_subscription import publisher_names
from lathe_chatter.nodes.real_time_loop import SECOND

_CLOCK_STOPPED = 2.0
"""s after which a /clock that shows the same time stands still."""


class ClockWatch:
    """Says when a /clock stands still, and when it goes on.

    Args:
        node: The lathe.
        follows: Whether it cuts the time of /clock.
        drives: Whether it publishes it.
    """

    def __init__(self, node: ParameterNode, *, follows: bool, drives: bool) -> None:
        """Nothing is seen yet."""
        self._node, self._log = node, node.bounded_log
        self._follows, self._drives = follows, drives
        self._stands = self._told = False
        self._shown, self._since = 0, time.monotonic()

    def look(self, now: int) -> None:
        """Look at the time that it shows, ns; called once a second."""
        at, before = time.monotonic(), self._stands
        if now != self._shown:
            self._shown, self._since = now, at
        if not (now or self._told) and at - self._since >= _CLOCK_STOPPED:
            self._told = True
            self._log.warning(
                'use_sim_time is set, and /clock has shown no time yet: nothing is cut before.',
                'clock awaited',
            )
        self._stands = bool(now) and at - self._since >= _CLOCK_STOPPED
        if self._stands and not before:
            self._log.warning(
                f'/clock stands still at {now / SECOND:.3f} s, and the cut with it.',
                'clock stands',
            )
        elif before and not self._stands:
            self._log.info(f'/clock goes on at {now / SECOND:.3f} s.', 'clock goes on')

    def complaint(self, now: int) -> str:
        """What is wrong with it, where the node drives or follows it; `now` is its time, ns."""
        owners = self._node.count_publishers('/clock')
        if self._follows and not (owners and now):
            return 'waiting for /clock'
        if (self._follows or self._drives) and owners > 1:
            return f'{owners} nodes publish /clock: it must have one owner'
        return '/clock stands still' if self._stands else ''


class PublisherWatch:
    """Says who else publishes samples on the topic of a lathe.

    Args:
        node: The lathe.
    """

    def __init__(self, node: ParameterNode) -> None:
        """Nobody is seen yet."""
        self._node, self._log = node, node.bounded_log
        self._names: list[str] = []

    def look(self) -> None:
        """See who is there, and say it once; called once a second."""
        before, self._names = self._names, publisher_names(self._node, '~/samples')
        if len(self._names) > max(1, len(before)):
            self._log.warning(
                f'I am not the only one that publishes '
                f'{self._node.resolve_topic_name("~/samples")}: {" and ".join(self._names)} do, '
                'and readers cannot tell them apart.',
                'publishers',
            )

    def status(self, readers: int, zero: int | None) -> Status:
        """Whether the samples on the topic are all of this node.

        Args:
            readers: How many read them.
            zero: What /clock shows at their time 0, ns, where it is followed.
        """
        values: dict[str, object] = {'publishers': ', '.join(self._names), 'readers': readers}
        if zero is not None:
            values['time 0 on /clock, s'] = zero / SECOND
        if len(self._names) > 1:
            return Status('samples', WARN, 'not the only lathe on the topic', values)
        return Status('samples', OK, 'published', values)
