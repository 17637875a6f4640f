"""Node `lathe`: the virtual lathe cutting in real-time ticks."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from typing import Any

from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from std_msgs.msg import Float64

from lathe_chatter.errors import ParameterError
from lathe_chatter.lathe.config import recorded_config
from lathe_chatter.lathe.virtual_lathe import IMPULSE
from lathe_chatter.model import Cut
from lathe_chatter.model.lathe_parameter_table import (
    CUT_ROWS,
    LATHE,
    cut_from,
    feed_refusal,
    pace_refusal,
    samples_per_tick,
)
from lathe_chatter.model.parameter_table import Value
from lathe_chatter.nodes import simulation_control, simulation_services
from lathe_chatter.nodes.diagnostics import Diagnostics, Status
from lathe_chatter.nodes.joint_state_message import nanoseconds
from lathe_chatter.nodes.lathe_diagnostics import TickStatistics
from lathe_chatter.nodes.lathe_graph_watch import ClockWatch, PublisherWatch
from lathe_chatter.nodes.lathe_log_and_record import LatheRecord
from lathe_chatter.nodes.lathe_topics import LatheTopics
from lathe_chatter.nodes.node_main import run_node
from lathe_chatter.nodes.parameter_node import ParameterNode
from lathe_chatter.nodes.real_time_loop import (
    NEVER,
    SECOND,
    Pacer,
    RealTime,
    ask_for_short_slices,
    spin_in_ticks,
)
from lathe_chatter.nodes.simulation_control import Answer, RunControl, RunState
from lathe_chatter.precompile import LATHE_LOOP, precompile

_BUDGET = 5_000_000
"""ns of ticks after which requests have their turn."""
_PATIENCE = 0.1
"""s that a node as fast as possible waits for a reader that is far behind; else for none such."""
_MAX_KNOCKS = 1000
"""Knocks between two ticks; they come one after the other, and are applied together."""
_LOOK_FOR_READERS = 5_000_000
"""ns from one look to the next for the readers that it waits for."""


class LatheNode(ParameterNode):
    """Integrates a `VirtualLathe` tick by tick and publishes what it does.

    It is woken at the rate of the ticks; how many ticks it then makes follows from the clock:
    none while paused, one as a rule, several after a delay or at a real-time factor above 1.
    Under `use_sim_time` that clock is /clock, and its time is cut but for jumps.

    Topics, services and parameters are those of docs/reference/nodes.md. A parameter set takes
    effect between two samples, all of an atomic set at the same one.

    Args:
        by_timer: Whether a timer wakes it, so that any executor will do; else its loop calls
            `wake` (`real_time_loop.spin_in_ticks`). Under `use_sim_time` there is a timer anyway.
        options: As for `rclpy.node.Node`.

    Raises:
        ParameterError: If a parameter given at the start is not allowed.
    """

    def __init__(self, *, by_timer: bool = True, **options: Any) -> None:
        """Compile the inner loop, then begin to cut."""
        super().__init__('lathe', LATHE, **options)
        values: Mapping[str, Any] = self.values
        self._follows = bool(self.get_parameter('use_sim_time').value)
        if self._follows and values['publish_clock']:
            allowed = 'false under use_sim_time, for /clock has one owner'
            raise ParameterError('publish_clock', 'true', '', allowed)
        self._sample_rate: float = values['sample_rate']
        self._samples_per_tick = samples_per_tick(self._sample_rate, values['tick_rate'])
        # Before the first tick is due.
        precompile(LATHE_LOOP, say=self.bounded_log.info)
        self._lathe = recorded_config(values).lathe()
        self._pending: Cut | None = None
        self._knocks: list[float] = []
        drives: bool = values['publish_clock']
        self._topics = LatheTopics(
            self, self._lathe.columns, values['tick_rate'], self._factor, publish_clock=drives
        )
        self._record = LatheRecord(self)

        self._control = RunControl()
        self._awaited: int = values['await_readers']
        if self._awaited:
            self._control.pause(pause=True)
        self._stamp_of_zero = 0
        tick = SECOND / values['tick_rate']
        self._pacer = Pacer(tick, self._factor or 1.0, keeps_all=self._follows)
        self._free = self._factor == 0.0
        self._others = PublisherWatch(self)
        self._clock_watch = ClockWatch(self, follows=self._follows, drives=drives)
        self._meter = TickStatistics(self._pacer, tick, self.requests)
        self._real_time = RealTime(values['realtime_priority'])
        self._diagnostics = Diagnostics(self, 'virtual lathe')
        simulation_control.create_services(self)
        if simulation_services.AVAILABLE:
            simulation_services.create_services(self)
        self.create_subscription(Float64, '~/knock', self._on_knock, QoSProfile(depth=_MAX_KNOCKS))
        self._by_timer = by_timer or self._follows
        if self._by_timer:
            self.every(1.0 / values['tick_rate'], self.wake)
        self.every(1.0, self._report)
        if self._awaited:
            self.bounded_log.info(f'Waiting for {self._awaited} readers of my samples.')

    # -- time ------------------------------------------------------------------------------

    @property
    def _factor(self) -> float:
        """Simulated seconds per second; under another's clock, its seconds."""
        return 1.0 if self._follows else float(self.values['real_time_factor'])  # type: ignore[arg-type]  # a double

    def _now(self) -> int:
        return int(self.get_clock().now().nanoseconds) if self._follows else time.monotonic_ns()

    def _start_clock(self) -> None:
        """Let simulated time go on from here; what has passed until now does not count."""
        now = self._now()
        self._pacer.start(now)
        self._stamp_of_zero = 0
        if self._follows:
            self._stamp_of_zero = now - self._stamp()

    def _stamp(self) -> int:
        """Simulated time as stamps have it: since the start, or on the clock that is followed."""
        since_start = nanoseconds(self._lathe.samples_taken, self._sample_rate)
        return self._stamp_of_zero + since_start

    def next_wake(self) -> int:
        """When it should be woken, ns of time.monotonic_ns(); NEVER for not at all."""
        if self._by_timer:
            return NEVER
        if self._awaited:
            return time.monotonic_ns() + _LOOK_FOR_READERS
        if self._control.state is not RunState.RUNNING:
            return NEVER
        if self._free or not self._pacer.started:
            return time.monotonic_ns()
        return self._pacer.next_wake()

    def wake(self) -> None:
        """Make the ticks that are due, or as many of them as there is time for in one go."""
        if self._awaited and self._topics.readers() >= self._awaited:
            self.announce()  # those who read samples may read events too
            self.pause(pause=False)
        if self._control.state is not RunState.RUNNING:
            return
        faster = self._free or self._pacer.factor > 1.0  # in real time it waits for nobody
        if faster and not self._topics.readers_follow(_PATIENCE if self._free else 0.0):
            return
        now = self._now()
        if self._follows and now == 0:
            return  # no /clock yet
        if not self._pacer.started:
            self._start_clock()
        elif self._follows:
            self._follow(now)
        if self._free:
            self._cut_freely(now)
            return
        overruns = self._pacer.overruns
        due = self._pacer.due(now)
        self._meter.lateness.add(self._pacer.lateness(now))
        self._make(due)
        if self._pacer.overruns != overruns:
            self.bounded_log.warning(
                f'Behind: {self._pacer.lag / SECOND:.3f} s of simulated time given up so far.',
                'behind',
            )
            if not self._meter.was_behind(overruns):  # what is known is not said again
                self._diagnostics.publish_changes(self._statuses())

    def _make(self, ticks: int) -> None:
        """Make ticks that are due, until the time for one go is over."""
        until = time.monotonic_ns() + _BUDGET
        for made in range(1, ticks + 1):
            self._tick()
            if made < ticks and time.monotonic_ns() > until:
                self._pacer.give_back(ticks - made)
                return

    def _cut_freely(self, now: int) -> None:
        """Cut as fast as it goes, and as the readers can take it."""
        while self._now() - now < _BUDGET and self._control.state is RunState.RUNNING:
            self._tick()

    def _follow(self, now: int) -> None:
        """See that /clock goes on as a clock does; else say so, and go on from where it is."""
        late = self._pacer.lateness(now) / SECOND
        bound: float = self.values['clock_catch_up']  # type: ignore[assignment]  # a double
        if self._pacer.gone_back(now):
            self.bounded_log.warning(
                f'/clock went back to {now / SECOND:.3f} s, {-late:.3f} s before the next tick: '
                'the cut goes on from there.',
                'clock back',
            )
            self._start_clock()
        elif late > bound:
            self._pacer.skip(now)
            self.bounded_log.warning(
                f'/clock is {late:.3f} s ahead of the cut at {now / SECOND:.3f} s, more than the '
                f'{bound:g} s of clock_catch_up: that time is not cut.',
                'clock ahead',
            )
            self._start_clock()

    def update_scheduling(self) -> None:
        """Be scheduled in real time only while that disturbs nobody: with cores to spare."""
        running = self._control.state is RunState.RUNNING and not self._free
        self._real_time.hold(wanted=running and self._factor <= 1.0 and not self._meter.behind)

    def _tick(self) -> None:
        """Cut one tick and publish it."""
        if self._control.state is RunState.ENDED:
            return
        began = time.perf_counter_ns()
        if self._pending is not None:
            self._retune(self._pending)
            self._pending = None
        if self._knocks:
            self._knock()
        samples = self._lathe.advance(self._samples_per_tick)
        if len(samples):
            self._topics.publish(samples, self._stamp)
            self._record.write(samples)
        if self._lathe.guard:
            self._end(self._lathe.guard)
        self._meter.note_tick(time.perf_counter_ns() - began, self._lathe)

    def _end(self, because: str) -> None:
        self._control.end(because)
        self.bounded_log.error(because)
        self._diagnostics.publish(self._statuses())

    def finish(self) -> None:
        """Finish its own record."""
        if hasattr(self, '_record'):  # Kilted destroys nodes, too, that were refused half-made
            self._record.close()

    # -- the cut ---------------------------------------------------------------------------

    def _refusal(self, parameters: list[Parameter]) -> str:
        """Also of a feed speed or a pace that would have no effect."""
        given = dict.fromkeys(self.set_together) | {p.name: p.value for p in parameters}
        said = super()._refusal(parameters) or feed_refusal(given, self.values)
        return said or (pace_refusal(given, self.values) if self._follows else '')

    def parameters_accepted(self, changed: Mapping[str, Value]) -> None:
        """Queue the new cut for the next tick, or take the new pace at once."""
        if 'real_time_factor' in changed:
            self._change_pace(self._factor)
        if any(row.name in changed for row in CUT_ROWS):
            self._pending = cut_from(self.values)

    def _change_pace(self, factor: float) -> None:
        self._record.paced(self._lathe.time, factor)
        free, self._free = self._free, factor == 0.0
        if free or self._free:
            self._start_clock()
        if factor:
            self._pacer.change(factor, self._now())

    def _retune(self, cut: Cut) -> None:
        before = self._lathe.cut
        self._lathe.retune(cut)
        self._record.changed(self._lathe.time, before, cut)

    def _on_knock(self, message: Float64) -> None:
        """Keep a knock for the next tick; a client that knocks without end holds up nobody."""
        began = time.monotonic_ns()
        try:
            IMPULSE.check('impulse', message.data)
        except ParameterError as error:
            self.bounded_log.warning(str(error), 'knock')
        else:
            if len(self._knocks) == _MAX_KNOCKS:
                self.bounded_log.warning(
                    f'More than {_MAX_KNOCKS} knocks between two ticks: the others are dropped.',
                    'too many knocks',
                )
            else:
                self._knocks.append(message.data)
        self.requests.note(began)

    def _knock(self) -> None:
        """Hit the tool with all that came since the last tick: impulses add up."""
        impulse, self._knocks = math.fsum(self._knocks), []
        try:
            self._lathe.knock(impulse)
        except ParameterError as error:
            self.bounded_log.warning(str(error), 'knock')
        else:
            self._record.knocked(self._lathe.time, impulse)

    # -- control ---------------------------------------------------------------------------

    @property
    def run_state(self) -> RunState:
        """Whether simulated time goes on."""
        return self._control.state

    @property
    def samples_taken(self) -> int:
        """Samples since the start or the last reset."""
        return self._lathe.samples_taken

    def pause(self, *, pause: bool) -> Answer:
        """Pause, or go on from where it was paused with nothing to catch up."""
        before, self._awaited = self._control.state, 0
        answer = self._control.pause(pause=pause)
        if self._control.state is not before:
            self._start_clock()
        return self._reported(answer)

    def step(self, ticks: int = 1) -> Answer:
        """Make ticks by hand, while paused; fewer if the guard trips."""
        answer = self._control.may_step()
        if answer.done:
            for _ in range(ticks):
                self._tick()
            answer = Answer(done=True, message=f'Now at {self._lathe.time:.6f} s.')
        return self._reported(answer)

    def reset(self) -> Answer:
        """Start again at time zero with the present parameters: the same run, bit for bit."""
        answer = self._control.reset()
        self._pending, self._knocks = None, []
        before, self._lathe = self._lathe, recorded_config(self.values).lathe()
        if before.samples_taken or before.cut != self._lathe.cut:  # else nothing has begun again
            self._record.restarted(before.time, before.cut, self._lathe.cut)
        self._start_clock()
        self.bounded_log.info(answer.message, 'reset')
        return self._reported(answer)

    def _reported(self, answer: Answer) -> Answer:
        self._diagnostics.publish_changes(self._statuses())
        return answer

    # -- diagnostics -----------------------------------------------------------------------

    def _report(self) -> None:
        if self._follows:
            self._clock_watch.look(self._now())
        self._others.look()
        if self._meter.flooded:
            share, served = self._meter.requests_share, self._meter.requests_served
            said = f'Requests take {share:.0%} of the time: {served} in the last second.'
            self.bounded_log.warning(said, 'flood')
        self._diagnostics.publish(self._statuses())
        self._meter.begin_second()
        if self._control.state is not RunState.RUNNING:
            self._topics.publish_clock(self._stamp())  # for those that join a clock at rest

    def _statuses(self) -> list[Status]:
        running = self._control.state is RunState.RUNNING and not self._free
        late = self._pacer.lateness(self._now()) - self._pacer.period if running else 0.0
        return [
            self._meter.pace(
                self._control,
                asked=self._factor,
                late=max(late, 0.0) / SECOND,
                clock=self._clock_watch.complaint(self._now()),
                scheduling=self._real_time.word,
            ),
            self._meter.cutting(self._control, self._lathe),
            self._others.status(self._topics.readers(), self._topics.zero),
            *self._record.statuses(),
        ]


def main() -> None:
    """Run the node until it is told to end."""
    ask_for_short_slices()
    run_node(
        lambda own: LatheNode(by_timer=False, cli_args=own['lathe']),
        {'lathe': LATHE},
        spin=spin_in_ticks,
    )
