"""`VirtualLathe`: a machine that cuts, can be retuned while it does, saved and continued."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from lathe_chatter.errors import ParameterError
from lathe_chatter.integrator import layout, propagation, stepper, surface
from lathe_chatter.integrator.preparation import mechanics_of, steps_per_sample
from lathe_chatter.model import (
    SAMPLE_COLUMNS,
    Array,
    BearingContact,
    Cut,
    Integers,
    Machine,
    paper_initial_state,
)
from lathe_chatter.quantities import Quantity

SAMPLE_RATE = Quantity('samples per simulated second', 'Hz', low=10.0, high=1e6)
SPINDLE_ACCELERATION = Quantity(
    'rate of change of the spindle speed, 0 for a step', 'rev/min per s', high=1e6
)
SEED = Quantity('seed of every random number', low=0.0, high=2.0**31 - 1.0)
DISPLACEMENT_LIMIT = Quantity(
    'displacement beyond which a run ends', 'm', high=1e12, exclusive=True
)
_STATE = Quantity('initial state', 'm or m/s', low=-1e6, high=1e6)
_IMPULSE = Quantity('impulse of a knock on the tool', 'N s', low=-1e3, high=1e3)


class EventKind(IntEnum):
    """What can happen inside a step."""

    BEARING_ENGAGES = layout.BEARING_ENGAGES
    BEARING_RELEASES = layout.BEARING_RELEASES
    TOOL_LEAVES_CUT = layout.TOOL_LEAVES
    TOOL_ENTERS_CUT = layout.TOOL_ENTERS


class Event(NamedTuple):
    """A located event: simulated time, s, and what happened."""

    time: float
    kind: EventKind


@dataclass
class LatheState:
    """Everything that a lathe remembers, as one value.

    Attributes:
        cut: The parameters of the cut.
        numbers: State, spindle angle, feed and speed (layout.NUMBERS_SIZE,).
        counts: Samples, turns and regimes (layout.COUNTS_SIZE,).
        nodes: The surface of the last turn (nodes, surface.NODE_SIZE).
        guard: Why the run has ended, or an empty string.
    """

    cut: Cut
    numbers: Array
    counts: Integers
    nodes: Array
    guard: str = ''

    def __eq__(self, other: object) -> bool:
        """Equal bit for bit."""
        if not isinstance(other, LatheState):
            return NotImplemented
        return (self.cut, self.guard) == (other.cut, other.guard) and all(
            mine.tobytes() == theirs.tobytes()
            for mine, theirs in (
                (self.numbers, other.numbers),
                (self.counts, other.counts),
                (self.nodes, other.nodes),
            )
        )

    __hash__ = None  # type: ignore[assignment]  # a mutable value


def _settle_regime(state: LatheState) -> None:
    """Decide from the displacement whether the bearing carries, after its clearance was set."""
    contact = state.cut.bearing_contact
    touches = state.numbers[layout.WORKPIECE_X] >= state.cut.bearing_clearance
    state.counts[layout.REGIME] &= ~propagation.ENGAGED
    if contact is BearingContact.SEATED or (contact is BearingContact.GAP and touches):
        state.counts[layout.REGIME] |= propagation.ENGAGED


class VirtualLathe:
    """A turning process with bearing clearance, integrated sample by sample.

    The machine is that of the paper's equations (8)-(9). With `tool_leaves_cut` the cutting
    force is F = C w max(h, 0), h = feed + r - (surface left before), and where the tool is out
    of the cut the surface of earlier revolutions stays; without it the force is the paper's
    linear one about the mean, equation (2). Speed changes need no restart: the delay is the
    time since the spindle was one turn back.

    Args:
        machine: Tool, workpiece, bearing and material.
        cut: What is cut at the start; see `retune`.
        sample_rate: Samples per simulated second, Hz.
        tool_leaves_cut: The force law, as above.
        spindle_acceleration: rev/min per s at which the speed follows a change; 0 for a step.
        seed: Of force noise and sensor noise.
        initial_state: Tool displacement and velocity, workpiece displacement and velocity at
            t = 0 (4,), m and m/s; by default the paper's. The surface before t = 0 is smooth.
        displacement_limit: The run ends when a displacement passes it, m.

    Raises:
        ParameterError: If a value is not allowed.
    """

    def __init__(  # noqa: PLR0913 -- what cannot change later is named here
        self,
        machine: Machine | None = None,
        cut: Cut | None = None,
        *,
        sample_rate: float = 1e4,
        tool_leaves_cut: bool = True,
        spindle_acceleration: float = 0.0,
        seed: int = 0,
        initial_state: Sequence[float] | Array | None = None,
        displacement_limit: float = 1.0,
    ) -> None:
        """See the class."""
        self.machine = machine or Machine()
        self.sample_rate = SAMPLE_RATE.check('sample_rate', sample_rate)
        self.tool_leaves_cut = bool(tool_leaves_cut)
        self.spindle_acceleration = SPINDLE_ACCELERATION.check(
            'spindle_acceleration', spindle_acceleration
        )
        if not isinstance(seed, (int, np.integer)):
            raise ParameterError('seed', seed, '', 'a whole number')
        self.seed = int(SEED.check('seed', seed))
        self.displacement_limit = DISPLACEMENT_LIMIT.check(
            'displacement_limit', displacement_limit
        )
        self.events: list[Event] = []
        self._event_space: Array = np.empty((64, 3))
        self._state = self._fresh(cut or Cut(), initial_state)
        self._state.counts[layout.STEPS] = self._steps_for(self.cut, self._state)
        self._prepare()

    # -- what it is doing ----------------------------------------------------------------

    @property
    def cut(self) -> Cut:
        """The parameters of the cut in force."""
        return self._state.cut

    @property
    def samples_taken(self) -> int:
        """Samples since the start."""
        return int(self._state.counts[layout.SAMPLES])

    @property
    def time(self) -> float:
        """Simulated time, s."""
        return self.samples_taken / self.sample_rate

    @property
    def spindle_angle(self) -> float:
        """Revolutions since the start."""
        return float(self._state.counts[layout.TURNS] + self._state.numbers[layout.ANGLE])

    @property
    def bearing_engaged(self) -> bool:
        """Whether the workpiece touches its bearing across the clearance."""
        return bool(self._state.counts[layout.REGIME] & propagation.ENGAGED)

    @property
    def tool_in_cut(self) -> bool:
        """Whether the tool removes material."""
        return bool(self._state.counts[layout.REGIME] & propagation.IN_CUT)

    @property
    def guard(self) -> str:
        """Why the run has ended, as a sentence; empty while it goes on."""
        return self._state.guard

    # -- what it can be told ---------------------------------------------------------------

    def advance(self, samples: int) -> Array:
        """Cut on for a number of samples.

        The events located on the way are left in `events`.

        Args:
            samples: How many, 0 or more.

        Returns:
            The samples (n, 8), columns as in `model.SAMPLE_COLUMNS`. Fewer than asked for,
            and `guard` says why, once a displacement has passed its limit.

        Raises:
            ParameterError: If `samples` is negative.
        """
        if not isinstance(samples, (int, np.integer)) or samples < 0:
            raise ParameterError('samples', samples, '', 'a whole number of 0 or more')
        out = np.empty((0 if self.guard else samples, len(SAMPLE_COLUMNS)))
        self.events = []
        rows, status = 0, layout.SURFACE_FULL
        while status in {layout.SURFACE_FULL, layout.EVENTS_FULL}:
            done, found, status = self._call(out[rows:])
            rows += done
            self.events += [
                Event(float(before / self.sample_rate + since), EventKind(int(kind)))
                for before, since, kind in self._event_space[:found]
            ]
            if status == layout.SURFACE_FULL:
                self._state.nodes = surface.grown(self._state.nodes)
            elif status == layout.EVENTS_FULL:
                self._event_space = np.empty((2 * len(self._event_space), 3))
        if status == layout.GUARD:
            time = (self.samples_taken + 1) / self.sample_rate
            self._state.guard = (
                f'The run ended at {time:.4f} s: a displacement passed '
                f'{self.displacement_limit:g} m, beyond which this machine has no meaning.'
            )
        return out[:rows]

    def retune(self, cut: Cut) -> None:
        """Change the cut at the instant of the last sample; nothing is restarted.

        Raises:
            ParameterError: If the machine with this cut is too fast for the sample rate; then
                nothing has changed.
        """
        if cut == self.cut:
            return
        old, steps = self.cut, self._steps_for(cut, self._state)
        self._state.cut = cut
        self._state.counts[layout.STEPS] = steps
        self._prepare()
        contact_changed = (cut.bearing_contact, cut.bearing_clearance) != (
            old.bearing_contact,
            old.bearing_clearance,
        )
        if contact_changed:
            _settle_regime(self._state)
        self._corner(1)

    def knock(self, impulse: float) -> None:
        """Hit the tool at the instant of the last sample: its velocity jumps by impulse / m_t.

        Args:
            impulse: N s, positive towards greater chip thickness.

        Raises:
            ParameterError: If it is not finite or beyond 1000 N s.
        """
        impulse = _IMPULSE.check('impulse', impulse)
        self._state.numbers[layout.TOOL_V] += impulse / self.machine.tool.mass
        self._corner(1)

    def snapshot(self) -> LatheState:
        """A copy of everything that the lathe remembers."""
        state = copy.deepcopy(self._state)
        state.nodes = state.nodes[: int(state.counts[layout.HEAD]) + 1].copy()
        return state

    def restore(self, state: LatheState) -> None:
        """Continue from a snapshot, bit for bit.

        The lathe must have the same machine, sample rate, force law, acceleration and seed.
        """
        self._state = copy.deepcopy(state)
        self.events = []
        self._prepare()

    # -- how ------------------------------------------------------------------------------

    def _call(self, out: Array) -> tuple[int, int, int]:
        """Run the inner loop on `out`: samples, events, and how it ended."""
        state = self._state
        done, found, status = stepper.advance(
            state.numbers,
            state.counts,
            state.nodes,
            self._settings,
            self._mechanics,
            self._matrices,
            self.seed,
            out,
            self._event_space,
        )
        return int(done), int(found), int(status)

    def _fresh(self, cut: Cut, initial_state: Sequence[float] | Array | None) -> LatheState:
        """The state at t = 0, with a smooth surface of the turn before."""
        given = paper_initial_state(cut) if initial_state is None else initial_state
        if np.shape(given) != (4,):
            raise ParameterError('initial_state', given, '', 'four numbers')
        start = np.array([_STATE.check('initial_state', value) for value in given])
        numbers = np.zeros(layout.NUMBERS_SIZE)
        numbers[:4] = start
        speed = cut.spindle_speed_rpm / 60.0
        numbers[layout.SPEED] = speed
        feed = cut.feed_speed / speed if self.tool_leaves_cut else 0.0
        offset = start[0] - start[2]
        nodes = surface.fresh_surface(feed, 512)
        nodes[:2, surface.HEIGHT] += offset
        numbers[layout.MET], numbers[layout.MET_SLOPE] = offset - feed, feed
        counts = np.zeros(layout.COUNTS_SIZE, dtype=np.int64)
        counts[layout.HEAD], counts[layout.CORNER] = 1, 1
        counts[layout.REGIME] = propagation.IN_CUT
        state = LatheState(cut, numbers, counts, nodes)
        _settle_regime(state)
        return state

    def _corner(self, order: int) -> None:
        """Note that derivative `order` of the surface jumps here."""
        counts = self._state.counts
        counts[layout.CORNER] = min(counts[layout.CORNER] or order, order)

    def _prepare(self) -> None:
        """Turn machine and cut into the constants of the inner loop."""
        cut, state = self.cut, self._state
        speed = cut.spindle_speed_rpm / 60.0
        if self.spindle_acceleration == 0.0:
            state.numbers[layout.SPEED] = speed
        settings = np.empty(layout.SETTINGS_SIZE)
        settings[layout.SAMPLE_RATE] = self.sample_rate
        settings[layout.TARGET_SPEED] = speed
        settings[layout.ACCELERATION] = self.spindle_acceleration / 60.0
        settings[layout.VARIATION] = cut.speed_variation_amplitude
        settings[layout.VARIATION_FREQUENCY] = cut.speed_variation_frequency
        settings[layout.FEED_SPEED] = cut.feed_speed if self.tool_leaves_cut else 0.0
        settings[layout.CUTTING_STIFFNESS] = self.machine.cutting_stiffness(cut.depth_of_cut)
        settings[layout.NOMINAL_FEED_SPEED] = cut.feed_speed
        settings[layout.MAY_LEAVE_CUT] = self.tool_leaves_cut
        settings[layout.HAS_CLEARANCE] = cut.bearing_contact is BearingContact.GAP
        settings[layout.FORCE_NOISE] = cut.force_noise
        settings[layout.SENSOR_NOISE] = cut.sensor_noise
        settings[layout.RUNOUT] = cut.runout
        settings[layout.LIMIT] = self.displacement_limit
        self._settings, self._mechanics = settings, mechanics_of(self.machine, cut)
        step = 1.0 / (self.sample_rate * state.counts[layout.STEPS])
        self._matrices = propagation.step_matrices(step, self._mechanics)

    def _steps_for(self, cut: Cut, state: LatheState) -> int:
        """Steps a sample for a cut that begins now.

        Chosen when the cut changes and then remembered: a restored run takes the same steps.

        Raises:
            ParameterError: If the machine is too fast for the sample rate.
        """
        speed = max(cut.spindle_speed_rpm / 60.0, float(state.numbers[layout.SPEED]))
        return steps_per_sample(self.machine, cut, speed, self.sample_rate)
