"""One lathe as the operator's page has it, with its monitor, recorder and supervisor."""

from __future__ import annotations

import asyncio
import math
import struct
import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from std_msgs.msg import Bool, Float64, Float64MultiArray, String

from lathe_chatter.detection.estimate import FIGURES, RECOMMENDED_SPEED
from lathe_chatter.errors import LatheChatterError
from lathe_chatter.model.lathe_parameter_table import CUT_ROWS, LATHE
from lathe_chatter.nodes.diagnostics import DiagnosticsListener
from lathe_chatter.nodes.lathe_diagnostics import GUARD_ON
from lathe_chatter.nodes.operator_page_clients import CellClients
from lathe_chatter.nodes.polled_subscription import PolledSubscription
from lathe_chatter.nodes.sample_receiver import join_blocks
from lathe_chatter.page.live_signals import LiveSignals
from lathe_chatter.page.server import Viewer
from lathe_chatter.page.stability_chart import chart_key, fits, stability_chart
from lathe_chatter.page.versioned_values import Board
from lathe_chatter.samples.codec import SampleDecoder
from lathe_chatter.scenario import Scenario, Step, find_scenario, load_scenario
from lathe_chatter.scenario.player import ScenarioPlayer
from lathe_chatter.scenario.scenario import ASKED, CLEARED, FLAGGED
from lathe_chatter.supervisor import ASKS

_LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
_LOSSY = QoSProfile(depth=10_000, reliability=ReliabilityPolicy.BEST_EFFORT)
"""The page holds up no lathe that waits for its readers."""
_SILENCE = 2.5
"""s without a word from a node, which speaks once a second, after which it is called silent."""
_STALE = 1.0
"""Simulated s after which a figure that does not come again is not known any more."""
_CLOSEUP_PERIOD, _LOOK_PERIOD = 0.25, 0.5
_SHOWN_SENTENCES = 80
_WAITS = {
    FLAGGED: 'when chatter is flagged',
    CLEARED: 'when the flag is cleared',
    ASKED: 'when the supervisor asks',
}


class OperatedCell:
    """Listens to one lathe, and drives it.

    Args:
        node: That listens.
        lathe: Full name of the lathe.
        heard: What is said in /diagnostics.

    Attributes:
        clients: Of its nodes.
        playing: The scenario that is played, None where none is.
    """

    def __init__(self, node: Node, lathe: str, heard: DiagnosticsListener) -> None:
        """Subscribe, and get to know the services."""
        self.board, self._signals = Board(), LiveSignals()
        self.clients = CellClients(node, lathe, self.board.put)
        self.playing: Scenario | None = None
        self._player: ScenarioPlayer | None = None
        self._before: dict[str, Any] | None = None
        self._changed_by_hand = self._resetting = False
        self._heard, self._names = heard, self.clients.names
        self._samples_name = f'{lathe}/samples'
        self._decoder = SampleDecoder()
        self._figures: dict[str, tuple[float, float]] = {}
        self._sentences: deque[dict[str, Any]] = deque(maxlen=_SHOWN_SENTENCES)
        self._chart_of: Any = None
        self._charting = False
        self._tasks: set[asyncio.Task[Any]] = set()
        self._closeup: tuple[float, Any, Any] = (math.nan, {}, {})
        self._closeup_at = self._look_at = 0.0
        self._listens_since = time.monotonic()
        monitor, supervisor = self._names['monitor'], self._names['supervisor']
        put = self.board.put
        self._samples = PolledSubscription(node, Float64MultiArray, self._samples_name, _LOSSY)
        usual = QoSProfile(depth=100)
        topics = [
            (Bool, f'{monitor}/chatter', _LATCHED, self._on_flag),
            (String, f'{monitor}/state', _LATCHED, lambda message: put('state', message.data)),
            (String, f'{supervisor}/action', _LATCHED, self._on_action),
        ]
        self._topics: list[tuple[PolledSubscription, Any, Callable[[Any], None]]] = [
            (PolledSubscription(node, kind, topic, qos), kind, take)
            for kind, topic, qos, take in topics
        ]
        self._figure_topics = {
            name: PolledSubscription(node, Float64, f'{monitor}/{name}', usual) for name in FIGURES
        }
        put('name', lathe)

    def end(self) -> None:
        """Listen no more."""
        for task in self._tasks:
            task.cancel()
        own = (self._samples, *self._figure_topics.values(), *(each[0] for each in self._topics))
        for subscription in own:
            subscription.end()
        self.clients.end()

    def _run(self, work: Any) -> None:
        """Let something go on beside; it raises nothing."""
        task = asyncio.ensure_future(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    # -- what comes ------------------------------------------------------------------------

    def take(self) -> None:
        """Take what has come."""
        before = self._signals.time
        try:
            self._take_samples()
        except LatheChatterError as error:
            self.board.put('complaint', str(error))
        for name, subscription in self._figure_topics.items():
            for data, _info in subscription.take():
                self._figures[name] = struct.unpack_from('<d', data, 4)[0], self._signals.time
        for subscription, kind, take in self._topics:
            for data, _info in subscription.take():
                take(deserialize_message(data, kind))
        if self._signals.time != before:
            self._play()
        now = time.monotonic()
        if now >= self._look_at:
            if 0.0 < self._look_at < now - _LOOK_PERIOD:  # it stood still itself
                self._listens_since = now
            self._look_at = now + _LOOK_PERIOD
            self._look(now - self._listens_since)

    def _take_samples(self) -> None:
        blocks: list[Any] = []
        columns: tuple[str, ...] = ()
        for data, _info in self._samples.take():
            block, names = self._decoder.decode(data)
            if names != columns:
                self._add(blocks, columns)
                blocks, columns = [], names
            if len(block):
                blocks.append(block)
        if blocks:
            self._heard.spoke(self._samples_name)
            self._add(blocks, columns)
            self.board.put('complaint', '')

    def _add(self, blocks: list[Any], columns: tuple[str, ...]) -> None:
        for batch in join_blocks(blocks, columns):
            had_begun = math.isfinite(self._signals.time)
            if self._signals.add(batch.samples, batch.columns):
                self._figures.clear()
                if had_begun:
                    self._end_scenario('is stopped, for the lathe has begun anew')
                if had_begun and not self._resetting:
                    self.clients.values.pop('lathe', None)  # it may be another one
                    self.board.put('lathe_values', {})

    def _on_flag(self, message: Bool) -> None:
        """The lamp; since when it is lit or out, the monitor's diagnostics say."""
        self.board.put('flag', {'up': message.data})
        if message.data:  # what was recommended before was for another chatter
            self._figures.pop(RECOMMENDED_SPEED, None)
        if self._player is not None:
            found = [self._figures.get(n, (math.nan,))[0] for n in ('frequency', 'growth_rate')]
            self._player.on_flag(self._signals.time, *found, up=message.data)

    def _on_action(self, message: String) -> None:
        self.board.put('action', message.data)
        self.board.put('asked', ASKS in message.data)
        if self._player is not None and ASKS in message.data:
            self._player.notice(ASKED, self._signals.time)

    def add_sentence(self, entry: Mapping[str, Any]) -> None:
        """Show what one of the nodes logged."""
        if entry['node'] in self._names.values():
            self._sentences.append(dict(entry))
            self.board.put('log', [*self._sentences])

    def _is_alive(self, who: str) -> bool:
        return self._heard.silence(self._names[who]) < _SILENCE

    def _look(self, listened: float) -> None:
        """Who is there, what they say, and what the chart is of.

        Nobody is silent before he was listened to for so long, s.
        """
        alive = {who: listened < _SILENCE or self._is_alive(who) for who in self._names}
        told = self.clients.values.get('lathe', {})
        ticks = told.get('tick_rate', 500.0) * (told.get('real_time_factor') or 1.0)
        silence = min(listened, self._heard.silence(self._samples_name))
        alive['samples'] = silence < 1.0 + 2.0 / ticks
        self.board.put('alive', alive)
        statuses = self._heard.statuses
        self.board.put('statuses', {who: statuses.get(n, {}) for who, n in self._names.items()})
        if not (alive['lathe'] and alive['supervisor']):
            self.board.put('asked', value=False)
        self._run(self.clients.look())
        values = self.clients.values.get('lathe')
        if not values or self._charting:
            return
        recommended = self._figures_now().get(RECOMMENDED_SPEED)
        speeds = values.get('spindle_speed_rpm'), recommended
        if not fits(self.board.get('chart'), speeds) or chart_key(values) != self._chart_of:
            self._charting, self._chart_of = True, chart_key(values)
            self._run(self._draw_chart(dict(values), speeds))

    async def _draw_chart(self, values: dict[str, Any], speeds: Iterable[float | None]) -> None:
        """Compute the chart beside the loop."""
        self.board.put('charting', value=True)
        try:
            chart: Any = await asyncio.to_thread(stability_chart, values, speeds)
        except LatheChatterError as error:
            chart = {'error': str(error)}
        self._charting = False
        self.board.put('chart', chart)
        self.board.put('charting', value=False)

    # -- what is shown ---------------------------------------------------------------------

    def _figures_now(self) -> dict[str, float]:
        """What the monitor has said of late."""
        oldest = self._signals.time - _STALE
        return {name: value for name, (value, at) in self._figures.items() if not at < oldest}

    def fill(self, viewer: Viewer, header: dict[str, Any], arrays: dict[str, Any]) -> None:
        """Put into a frame what a viewer has not seen."""
        signals = self._signals
        self.board.put('figures', self._figures_now())
        header['cell'] = self.board.news(viewer.seen.setdefault('cell', {}))
        if not (signals.envelopes or signals.emptied):
            return
        if viewer.cursors.get('epoch') != signals.epoch:
            viewer.cursors.update(epoch=signals.epoch, firsts=[0, 0])
        firsts, spans = viewer.cursors['firsts'], []
        for k, envelope in enumerate(signals.envelopes):
            first, values = envelope.since(firsts[k])
            firsts[k] = first + values.shape[1]
            spans.append([first, values.shape[1], envelope.samples * signals.step])
            arrays[f'envelope_{k}'] = values
        time_now = signals.time if signals.envelopes else None
        shown = {'epoch': signals.epoch, 'time': time_now, 'lost': signals.lost}
        header['signals'] = {**shown, 'spans': spans}
        at = time.monotonic()
        if at >= self._closeup_at and self._closeup[0] != signals.time:
            self._closeup_at = at + _CLOSEUP_PERIOD
            self._closeup = signals.time, *signals.closeup()
        if viewer.cursors.get('closeup') != self._closeup[0]:
            viewer.cursors['closeup'], header['closeup'], found = self._closeup
            arrays.update(found)

    # -- what is done ----------------------------------------------------------------------

    async def act(self, wish: Mapping[str, Any]) -> str:
        """Do what an operator wishes.

        Raises:
            LatheChatterError: If it is refused.
        """
        said = ''
        match wish['do']:
            case 'set':
                await self.clients.set(wish['node'], dict(wish['values']))
                self._changed_by_hand |= wish['node'] == 'lathe' and self.playing is None
            case 'back':
                said = await self._go_back()
            case 'knock':
                told = self._heard.values(self._names['lathe'], 'cut')
                if told.get('guard', GUARD_ON) != GUARD_ON:
                    raise LatheChatterError('The cut has ended: nothing was hit.')
                # One that was killed is on its topic for long still, and nothing answers for it.
                self.clients.knock(wish['impulse'], there=self._is_alive('lathe'))
                said = f'A knock of {wish["impulse"] * 1e3:g} mN s was sent.'
            case 'play':
                said = await self._begin(load_scenario(find_scenario(str(wish['scenario']))))
            case 'stop_playing':
                self._end_scenario('is stopped')
            case service:
                said = await self._call(service)
        return said

    async def _call(self, service: str) -> str:
        """Call a service, and see to what of it nobody else tells."""
        if service == 'accept':
            self.board.put('asked', value=False)  # whatever comes of it
        return await (self._reset() if service == 'reset' else self.clients.call(service))

    async def _reset(self) -> str:
        """Have the same lathe begin anew."""
        self._resetting = True
        try:
            said = await self.clients.call('reset')
        finally:
            self._resetting = False
        self._end_scenario('is stopped, for the lathe has begun anew')
        # What has come so far may be of the cut before, and a pause sends no more.
        for _ in self._samples.take():
            pass
        self._signals.empty()
        self._figures.clear()
        return said

    async def _begin(self, scenario: Scenario) -> str:
        """Begin a scenario: with its parameters, at time zero."""
        values = self.clients.values.get('lathe')
        if values is None:
            raise self.clients.unknown('lathe')
        wanted = LATHE.complete(scenario.parameters)
        for row in LATHE:
            fixed = not row.run_time and not row.node_only and row.name in wanted
            if fixed and row.name in values and values[row.name] != wanted[row.name]:
                raise LatheChatterError(
                    f'The scenario {scenario.name} is for a lathe that was started with '
                    f'{row.name} {wanted[row.name]!r:.40}; this one has {values[row.name]!r:.40}.'
                )
        if scenario.supervisor is not None and not self._is_alive('supervisor'):
            raise LatheChatterError(
                f'The scenario {scenario.name} needs a chatter_supervisor, and none is here: '
                'lathe-chatter run --page --supervise ask starts one.'
            )
        # Of a scenario after a scenario, the cut that somebody had set.
        if self._before is None or self._changed_by_hand:
            self._before = {row.name: values[row.name] for row in CUT_ROWS if row.name in values}
        self._changed_by_hand = False
        await self.clients.set('lathe', {row.name: wanted[row.name] for row in CUT_ROWS})
        self._end_scenario('is stopped, for another is to begin')
        await self._reset()
        await self.clients.call('resume')
        self.playing, self._player = scenario, ScenarioPlayer(scenario)
        self._show_scenario('has begun')
        return f'{scenario.name} has begun.'

    async def _go_back(self) -> str:
        """Set what was set before a scenario, which may have had another noise, or none."""
        if self.playing is not None:
            raise LatheChatterError(f'{self.playing.name} is being played: stop it first.')
        if self._before is None:
            raise LatheChatterError('There is no cut of before a scenario to go back to.')
        await self.clients.set('lathe', self._before)
        self._before = None
        self._put_scenario('The cut was set as before the scenario.')
        return 'The cut was set as before the scenario.'

    def _play(self) -> None:
        """Carry out what is due, and end in time."""
        if self.playing is None or self._player is None:
            return
        recommended, _ = self._figures.get(RECOMMENDED_SPEED, (math.nan, 0.0))
        step = self._player.due(self._signals.time, recommended)
        if step is not None:
            self._run(self._carry_out(step, self._player))
        elif self._player.finished and self._signals.time >= self.playing.duration:
            self._end_scenario('is over')

    async def _carry_out(self, step: Step, player: ScenarioPlayer) -> None:
        try:
            if step.accept:
                await self.clients.call('accept')
            else:
                await self.clients.set('lathe', step.changes)
        except LatheChatterError as error:
            if self._player is player:
                self._end_scenario(f'is stopped: {error}')
        else:
            if self._player is player:
                self._show_scenario(step.because or 'a step was made')

    def _end_scenario(self, how: str) -> None:
        if self.playing is not None:
            name, self.playing, self._player = self.playing.name, None, None
            self._put_scenario(f'{name} {how.rstrip(".")}. Its cut and its noise were left so.')

    def _show_scenario(self, text: str) -> None:
        """Show what is played, and what it waits for."""
        if self.playing is None or self._player is None:
            return
        step, end = self._player.next_step, f'it ends at {self.playing.duration:g} s'
        if step is not None:
            when = f'at {step.at:g} s' if step.at is not None else _WAITS[str(step.when)]
            later = f', {step.after:g} s later' if step.after else ''
            end = f'next, {when}{later}: {step.because or "a change"}'
        self._put_scenario(f'{self.playing.name}: {text}; {end}.')

    def _put_scenario(self, text: str) -> None:
        playing = self.playing.name if self.playing else ''
        shown = {'playing': playing, 'text': text, 'before': self._before is not None}
        self.board.put('scenario', shown)
