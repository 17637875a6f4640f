"""What happened in a recorded run, by the record alone: the story of all lathes that were in it.

The samples carry simulated time, and so do the changes of a cut; other topics are dated by the
blocks of samples about which they came (`run_timeline`). A lathe that was reset or started again
begins a new session at time zero: on the axis of a history the sessions follow each other, so its
times are simulated times as long as there is one.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from lathe_chatter.array_types import Array
from lathe_chatter.lathe.change_and_knock_sentences import (
    BEGINNING,
    BEGINNING_AGAIN,
    Change,
    Knock,
    on_the_shop_floor,
)
from lathe_chatter.model import Cut, Machine
from lathe_chatter.model.lathe_parameter_table import cut_from, described_by, machine_from
from lathe_chatter.model.machine_file import MachineDescription
from lathe_chatter.plot_style import text_of
from lathe_chatter.recording import Run, read_run
from lathe_chatter.recording.clock_steps import step_sentence
from lathe_chatter.recording.cut_log import logger_of
from lathe_chatter.recording.recorded_cuts import LOG, RecordedCuts, message_of, recorded_cuts
from lathe_chatter.recording.run_timeline import blocks_as_written
from lathe_chatter.recording.sample_blocks import TIME, SampleBlocks
from lathe_chatter.report.monitor_record import Flag, MonitorRecord
from lathe_chatter.report.plotted_samples import RunSamples, Spans

_REASONS = {
    BEGINNING: 'the lathe was started again',
    BEGINNING_AGAIN: 'the lathe was reset',
    '': 'simulated time went back, and why is not in the record',
}
"""Why a session but the first begins, by the sentence of its beginning."""
_SPEED = 'spindle_speed_rpm'
_CLOSE_UPON = 0.2
"""s between two steps of the speed that are told as one: who sets it by hand takes longer."""
_ESTIMATES = ('growth_rate', 'frequency', 'amplitude', 'recommended_speed_rpm')


class Ramp(NamedTuple):
    """The spindle on its way to a speed: from when to when, s, and between which, rev/min."""

    start: float
    end: float
    low: float
    high: float


class SpeedSteps(NamedTuple):
    """Steps of the spindle speed, one close upon the other, as a supervisor makes a ramp of them.

    Attributes:
        time: Of the last, s.
        start: Of the first, s.
        speed: That the last has set, rev/min.
        steps: How many they are.
    """

    time: float
    start: float
    speed: float
    steps: int


class Session(NamedTuple):
    """A lathe from one time zero to the next.

    Attributes:
        time: Where its time zero is on the axis of the history, s.
        why: How it came to begin, where it is not the first.
        machine: That cut.
        start: The cut at time zero.
        tool_leaves_cut: The force law, see `VirtualLathe`.
        spindle_acceleration: rev/min per s; 0 where the speed steps.
        known: Whether the record has its parameters; else they are those of the one before.
        described: The machine file that it was given, None where there was none.
        ended: What happened at the very end of the one before, and so at the same time.
    """

    time: float
    why: str
    machine: Machine
    start: Cut
    tool_leaves_cut: bool
    spindle_acceleration: float
    known: bool
    described: MachineDescription | None = None
    ended: tuple[Change | Knock, ...] = ()


Event: TypeAlias = Session | Change | Knock | Flag | SpeedSteps


@dataclass(frozen=True)
class History:
    """A run as arrays and occurrences.

    Attributes:
        path: The folder of the run.
        sessions: One, and another for each reset and each new start.
        samples: Of the lathe.
        changes: Of the cut, in order.
        knocks: On the tool, in order.
        flags: Of the monitor, in order.
        estimates: Growth rate, frequency and so on by name: simulated times and values (2, m).
        states: What the monitor said that the cut does, from when on, s.
        remarks: What else is to be known, sentences: steps of the clock, contradictions.
    """

    path: Path
    sessions: tuple[Session, ...]
    samples: RunSamples
    changes: list[Change] = field(default_factory=list)
    knocks: list[Knock] = field(default_factory=list)
    flags: list[Flag] = field(default_factory=list)
    estimates: dict[str, Array] = field(default_factory=dict)
    states: list[tuple[float, str]] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)

    @property
    def later_sessions(self) -> tuple[Session, ...]:
        """After the first."""
        return self.sessions[1:]

    @property
    def edges(self) -> set[float]:
        """When the cut was changed or began anew, and when its spindle reached its speed, s."""
        times = {change.time for change in self.changes} | {ramp.end for ramp in self.ramps}
        times |= {session.time for session in self.later_sessions}
        return {time for time in times if self.begin < time <= self.duration}

    def in_order(self) -> list[Event]:
        """What happened after the start, as it happened."""
        at_ends = [event for session in self.later_sessions for event in session.ended]
        found: list[Event] = [*at_ends, *self.later_sessions]
        found += (change for change in self.changes if change not in at_ends)
        found += (knock for knock in self.knocks if knock not in at_ends)
        found += self.flags
        # A flag at the time at which a session begins is of the one before: no sample had come.
        found.sort(key=lambda each: (round(each.time, 9), not isinstance(each, Flag)))
        return _with_steps_joined(found)

    def session_at(self, time: float) -> Session:
        """The session in which a time is, s."""
        return [self.sessions[0], *(s for s in self.later_sessions if s.time <= time)][-1]

    def cut_at(self, time: float) -> Cut:
        """The cut in force at a simulated time, s: what is set, and the speed that is reached."""
        values: dict[str, Any] = {}
        session = self.session_at(time)
        for change in self.changes:
            if session.time <= change.time <= time:
                values |= change.new
        return session.start.with_changes(**{**values, _SPEED: self.speed_at(time)})

    def speed_at(self, time: float) -> float:
        """The spindle speed that is reached at a simulated time, rev/min; without its swing."""
        speed = self.sessions[0].start.spindle_speed_rpm
        for ramp in self.ramps:
            if time >= ramp.end:
                speed = ramp.high
            elif time >= ramp.start:
                share = (time - ramp.start) / (ramp.end - ramp.start)
                speed = ramp.low + share * (ramp.high - ramp.low)
        return speed

    @property
    def ramps(self) -> list[Ramp]:
        """Every change of the spindle speed in order; a step takes no time."""
        found: list[Ramp] = []
        speed = self.sessions[0].start.spindle_speed_rpm
        ends = [*(session.time for session in self.later_sessions), math.inf]
        for session, end in zip(self.sessions, ends, strict=True):
            if session.time:
                if found and found[-1].end > session.time:
                    found[-1] = _cut_short(found[-1], session.time)
                begin = session.start.spindle_speed_rpm
                found.append(Ramp(session.time, session.time, speed, begin))
            speed = session.start.spindle_speed_rpm
            for change in self.changes:
                target = change.new.get(_SPEED)
                if target is None or not session.time <= change.time < end:
                    continue
                if found and found[-1].start <= change.time < found[-1].end:
                    found[-1] = _cut_short(found[-1], change.time)  # turned round on its way
                    speed = found[-1].high
                taken = 0.0
                if session.spindle_acceleration:
                    taken = abs(target - speed) / session.spindle_acceleration
                found.append(Ramp(change.time, change.time + taken, speed, float(target)))
                speed = float(target)
        return found

    @property
    def begin(self) -> float:
        """Simulated time of the first sample, s."""
        return self.samples.first

    @property
    def duration(self) -> float:
        """Simulated time of the last sample, s."""
        return self.samples.last

    def settled(self, name: str, start: float, end: float) -> float:
        """Median of an estimate between two times, s: the first ones may be far off."""
        time, values = self.estimates.get(name, np.zeros((2, 0)))
        inside = values[(time >= start) & (time < end) & np.isfinite(values)]
        return float(np.median(inside)) if inside.size else math.nan

    def chatter_spans(self) -> list[tuple[float, float]]:
        """When the flag was up: from and to, s."""
        spans: list[tuple[float, float]] = []
        since: float | None = None
        for flag in self.flags:
            if flag.chatter and since is None:
                since = flag.time
            elif not flag.chatter and since is not None:
                spans.append((since, flag.time))
                since = None
        if since is not None:
            spans.append((since, self.duration))
        return spans


def _with_steps_joined(events: list[Event]) -> list[Event]:
    joined: list[Event] = []
    for event in events:
        step, last = _speed_steps(event), _speed_steps(joined[-1]) if joined else None
        if step and last and 0.0 < step.time - last.time < _CLOSE_UPON:
            joined[-1] = step._replace(start=last.start, steps=last.steps + 1)
        else:
            joined.append(event)
    return joined


def _speed_steps(event: Event) -> SpeedSteps | None:
    """A change of the speed alone as one step; None of anything else."""
    if isinstance(event, Change) and event.new.keys() == {_SPEED}:
        return SpeedSteps(event.time, event.time, float(event.new[_SPEED]), 1)
    return event if isinstance(event, SpeedSteps) else None


def in_words(event: Event) -> str:
    """What happened, for a table or a list."""
    if isinstance(event, Session):
        return event.why
    if isinstance(event, SpeedSteps):
        steps = f'in {event.steps} steps since {event.start:.3f} s'
        return f'{on_the_shop_floor(_SPEED, event.speed)}, {steps}'
    if isinstance(event, Change):
        return ', '.join(on_the_shop_floor(*changed) for changed in event.new.items())
    if isinstance(event, Knock):
        return f'knock, {text_of(event.impulse, "N s")}'
    if event.started:
        return 'the monitor was started anew'
    return 'chatter flagged' if event.chatter else 'flag cleared'


def _cut_short(ramp: Ramp, time: float) -> Ramp:
    """A ramp that ends before it has reached its speed."""
    share = (time - ramp.start) / (ramp.end - ramp.start)
    return ramp._replace(end=time, high=ramp.low + share * (ramp.high - ramp.low))


def read_history(path: Path, topic: str | None = None) -> History:
    """Read what happened in a recorded run.

    Args:
        path: Of the run.
        topic: Of the samples; may be left out where the run has one lathe.

    Raises:
        RunReadError: If there is no such run, it has no samples, or several lathes and no topic
            is named.
    """
    run = read_run(path)
    topic = run.samples_topic(topic)
    wanted = {*run.monitor_topics(topic), LOG}
    cuts = recorded_cuts(run, topic.removesuffix('/samples'), lambda name: name in wanted)
    if not cuts.sampled:
        raise run.without_samples(topic)
    sessions = _sessions(cuts)
    monitor = MonitorRecord(cuts, [session.time for session in sessions])
    estimates = {name: monitor.series(name) for name in _ESTIMATES}
    told = [
        [replace(event, time=event.time + session.time) for event in recorded.events]
        for session, recorded in zip(sessions, cuts.sampled, strict=True)
    ]
    later = [
        session._replace(ended=tuple(event for event in before if event.time >= session.time))
        for session, before in zip(sessions[1:], told[:-1], strict=True)
    ]
    events = [event for each in told for event in each]
    return History(
        path=Path(path),
        sessions=(sessions[0], *later),
        samples=RunSamples(lambda spans: _on_one_axis(run, topic, cuts, sessions, spans)),
        changes=[event for event in events if isinstance(event, Change)],
        knocks=[event for event in events if isinstance(event, Knock)],
        flags=monitor.flags(estimates),
        estimates=estimates,
        states=monitor.said('state'),
        remarks=_remarks(cuts, logger_of(topic.rsplit('/', 1)[0])),
    )


def _sessions(cuts: RecordedCuts) -> list[Session]:
    """The sessions of which there are samples, one after the other on one axis."""
    sessions: list[Session] = []
    values: dict[str, Any] = {}
    time = 0.0
    for recorded in cuts.sampled:
        values = recorded.parameters or values
        sessions.append(
            Session(
                time, _REASONS[recorded.beginning] if sessions else '', machine_from(values),
                cut_from(values),
                bool(values.get('tool_leaves_cut', True)),
                float(values.get('spindle_acceleration', 0.0)), bool(recorded.parameters),
                described_by(values),
            )
        )  # fmt: skip
        time += float(cuts.timeline.last[recorded.blocks.stop - 1])
    return sessions


def _on_one_axis(
    run: Run, topic: str, cuts: RecordedCuts, sessions: list[Session], spans: Spans
) -> Iterator[SampleBlocks]:
    """The samples with times that go on from session to session, at least those of some spans."""
    if len(sessions) == 1:
        yield from run.sample_blocks(topic, None, cuts.timeline.received_in(spans))
        return
    starts = [recorded.blocks.start for recorded in cuts.sampled]
    begins = np.array([session.time for session in sessions])
    done = 0
    for blocks in blocks_as_written(run, topic):
        which = np.searchsorted(starts, np.arange(done, done + len(blocks.rows)), 'right') - 1
        signals = np.array(blocks.signals)
        signals[blocks.columns.index(TIME)] += np.repeat(begins[which], blocks.rows)
        done += len(blocks.rows)
        yield blocks._replace(signals=signals)


def _remarks(cuts: RecordedCuts, lathe: str) -> list[str]:
    """Steps of the clocks, what does not fit, and lathes that left no sample."""
    remarks = [
        f'At {time:.3f} s {step_sentence(seconds)}' for time, seconds in cuts.timeline.steps
    ]
    if cuts.unseen:
        remarks.append(
            f'The parameters at the start are of {cuts.unseen:.3f} s before the first sample: '
            'whether the cut was changed in between is not in the record.'
        )
    remarks += cuts.log.contradictions
    said = [message_of(each) for each in cuts.messages if each.raw.topic == LOG]
    remarks += [
        f'The lathe said: {each.msg}'
        for each in said
        if each.name == lathe and each.msg.startswith('/clock ')
    ]
    sampled = {id(session) for session in cuts.sampled}
    lost = [each for each in cuts.log.sessions if each.beginning and id(each) not in sampled]
    if lost:
        times = 'Once' if len(lost) == 1 else f'{len(lost)} times'
        remarks.append(f'{times} the lathe began, and no sample of it is in the record.')
    return remarks
