"""`VirtualLathe`: a machine that cuts, can be retuned while it does, saved and continued."""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from lathe_chatter.array_types import Array
from lathe_chatter.errors import ParameterError, StateError
from lathe_chatter.lathe.doubts import doubts
from lathe_chatter.lathe.integrator import state_layout as layout
from lathe_chatter.lathe.integrator import stepper, surface
from lathe_chatter.lathe.state import LatheState, differences
from lathe_chatter.model import Cut, Machine
from lathe_chatter.model.machine_and_sampling import LatheSetup
from lathe_chatter.model.quantity_fields import Quantity, count_of
from lathe_chatter.samples import sample_columns

IMPULSE = Quantity('impulse of a knock on the tool', 'N s', low=-1e6, high=1e6)

_AT_ONCE = 100_000
"""Samples of one call of the inner loop, within which no signal is answered."""
_NO_ROOM = (layout.SURFACE_FULL, layout.EVENTS_FULL)
"""How a call ends that goes on once there is more room."""
_ROOM = 512
"""Nodes of the surface for which there is room at first."""


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


class VirtualLathe:
    """A turning process with bearing clearance, integrated sample by sample.

    The machine is that of the paper's equations (8)-(9), of one mode a body or of several. With
    `tool_leaves_cut` the cutting force is F = C w max(h, 0), h = feed + r - (surface left before),
    and where the tool is out of the cut the surface of earlier revolutions stays; without it the
    force is the paper's linear one about the mean, equation (2), and so is the chip thickness.
    Speed changes need no restart: the delay is the time since the spindle was one turn back.

    Args:
        machine: Tool, workpiece, bearing and material; by default the paper's.
        cut: What is cut at the start; see `retune`.
        initial_state: Tool displacement and velocity, workpiece displacement and velocity at
            t = 0 (4,), m and m/s; by default the paper's, of a rigid body none. The surface
            before t = 0 is smooth.
        sample_rate: Samples per simulated second, Hz.
        tool_leaves_cut: The force law, as above.
        spindle_acceleration: rev/min per s at which the speed follows a change; 0 for a step.
        seed: Of force noise and sensor noise.
        displacement_limit: The run ends when a displacement passes it, m.
        accelerometers: Whether samples have the accelerations of both bodies too.

    Raises:
        ParameterError: If a value is not allowed.
    """

    _event_space: Array
    _found: list[Array]

    def __init__(  # noqa: PLR0913 -- what cannot change later is named here
        self,
        machine: Machine | None = None,
        cut: Cut | None = None,
        *,
        initial_state: Sequence[float] | Array | None = None,
        sample_rate: float = 1e4,
        tool_leaves_cut: bool = True,
        spindle_acceleration: float = 0.0,
        seed: int = 0,
        displacement_limit: float = 1.0,
        accelerometers: bool = False,
    ) -> None:
        """See the class."""
        setup = LatheSetup(
            Machine() if machine is None else machine,
            sample_rate,
            tool_leaves_cut,
            spindle_acceleration,
            seed,
            displacement_limit,
            accelerometers,
        )
        start = Cut() if cut is None else _checked(cut)
        self._begin(LatheState.fresh(setup, start, initial_state))

    @classmethod
    def continued(cls, state: LatheState) -> VirtualLathe:
        """A lathe that goes on from a snapshot or a loaded state, bit for bit."""
        lathe = cls.__new__(cls)
        lathe._begin(state.copy())  # noqa: SLF001 -- its own
        return lathe

    # -- what it is doing ----------------------------------------------------------------

    @property
    def setup(self) -> LatheSetup:
        """What it was given at the start."""
        return self._state.setup

    @property
    def machine(self) -> Machine:
        """Tool, workpiece, bearing and material."""
        return self.setup.machine

    @property
    def sample_rate(self) -> float:
        """Samples per simulated second, Hz."""
        return self.setup.sample_rate

    @property
    def cut(self) -> Cut:
        """The parameters of the cut in force."""
        return self._state.cut

    @property
    def columns(self) -> tuple[str, ...]:
        """Those of the samples: with accelerations where the setup has accelerometers."""
        return sample_columns(accelerometers=self.setup.accelerometers)

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
        numbers = self._state.numbers
        turn = self._flat[layout.TURN]  # constants begin with the settings
        turned = numbers[layout.ORIGIN_LOW] + numbers[layout.PLACE] * (1.0 / turn)
        return float(numbers[layout.ORIGIN] + turned)

    @property
    def bearing_engaged(self) -> bool:
        """Whether the workpiece touches its bearing across the clearance."""
        return bool(self._state.counts[layout.REGIME] >> 1)

    @property
    def tool_in_cut(self) -> bool:
        """Whether the tool removes material; at a depth of 0 there is none."""
        in_cut = self._state.counts[layout.REGIME] & layout.IN_CUT
        return bool(in_cut) and self.cut.depth_of_cut > 0.0

    @property
    def guard(self) -> str:
        """Why the run has ended, as a sentence; empty while it goes on."""
        return self._state.guard

    @property
    def doubts(self) -> list[str]:
        """Why its samples may not be what was meant, in sentences, see doubts.py."""
        return doubts(self.setup, self.cut)

    @property
    def events(self) -> list[Event]:
        """The events located in the last call of `advance`, in order of time."""
        return [
            Event(float(before / self.sample_rate + since), EventKind(int(kind)))
            for found in self._found
            for before, since, kind in found
        ]

    # -- what it can be told ---------------------------------------------------------------

    def advance(self, samples: int) -> Array:
        """Cut on for a number of samples.

        The events located on the way are left in `events`.

        Args:
            samples: How many, 0 or more.

        Returns:
            The samples (n, 8) or (n, 10), columns as in `columns`. Fewer than asked for,
            and `guard` says why, once a displacement has passed its limit.

        Raises:
            ParameterError: If `samples` is negative.
        """
        state = self._state
        samples = count_of('samples', samples) if not state.guard else 0
        out = np.empty((samples, self._columns))
        self._found = []
        rows, status = 0, layout.SURFACE_FULL
        while status in _NO_ROOM or (rows < samples and status != layout.GUARD):
            whole = rows == 0 and samples <= _AT_ONCE  # a tick: a view costs a tenth of it
            done, found, status = stepper.advance(
                state.numbers, state.counts, state.nodes, self._flat,
                out if whole else out[rows : rows + _AT_ONCE], self._event_space, self._room,
            )  # fmt: skip
            rows += done
            if found:
                self._found.append(self._event_space[:found].copy())
            if status == layout.SURFACE_FULL:
                state.nodes = surface.with_room(state.nodes, 2 * state.nodes.shape[1])
            elif status == layout.EVENTS_FULL:
                self._event_space = np.empty((2 * len(self._event_space), 3))
        if status == layout.GUARD:
            state.end()
        return out if rows == samples else out[:rows]

    def retune(self, cut: Cut) -> None:
        """Change the cut at the instant of the last sample; nothing is restarted.

        Raises:
            ParameterError: If the machine with this cut is too fast for the sample rate; then
                nothing has changed.
        """
        if _checked(cut) != self.cut:
            self._state.retune(cut)
            self._prepare()

    def knock(self, impulse: float) -> None:
        """Hit the tool at the instant of the last sample: its velocity jumps by impulse / m_t.

        Args:
            impulse: N s, positive towards greater chip thickness.

        Raises:
            ParameterError: If it is not finite or beyond 1000 N s.
        """
        self._state.knock(IMPULSE.check('impulse', impulse))

    def snapshot(self) -> LatheState:
        """A copy of everything that the lathe remembers; `LatheState.save` puts it in a file."""
        return self._state.copy()

    def restore(self, state: LatheState) -> None:
        """Continue from a snapshot of a lathe of the same setup, bit for bit.

        Raises:
            StateError: If the setup was another; `continued` takes any.
        """
        others = differences(state.setup, self.setup)
        if others:
            raise StateError(
                f'The saved lathe differs from this one in its {" and ".join(others)}: continue '
                'it as a lathe of its own.'
            )
        steps, now = layout.STEPS, self._state
        same = state.cut == now.cut and state.counts[steps] == now.counts[steps]
        self._begin(state.copy(), self._flat if same else None)

    # -- how ------------------------------------------------------------------------------

    def __getstate__(self) -> tuple[LatheState, Array, list[Array]]:
        """As another process gets it: without room for more, with constants that are dear."""
        return self._state.copy(), self._flat, self._found

    def __setstate__(self, sent: tuple[LatheState, Array, list[Array]]) -> None:
        """Go on as that lathe would."""
        state, flat, found = sent
        self._begin(state, surface.aligned_copy(flat))
        self._found = found

    def _begin(self, state: LatheState, constants: Array | None = None) -> None:
        """Take over a state, with the constants of the inner loop where they are known."""
        state.numbers = surface.aligned_copy(state.numbers)
        state.nodes = surface.with_room(state.nodes, state.nodes.shape[1] + _ROOM)
        self._state = state
        self._event_space = np.empty((64, 3))
        self._found = []
        self._prepare(constants)

    def _prepare(self, constants: Array | None = None) -> None:
        """Turn machine and cut into the constants of the inner loop."""
        modes = len(self._state.numbers) - layout.NUMBERS_SIZE >> 2
        self._flat = self._state.constants.flat if constants is None else constants
        self._columns = len(self.columns)
        self._room = stepper.room_for(modes)


def _checked(cut: Cut) -> Cut:
    """The cut, if it is one."""
    if not isinstance(cut, Cut):
        raise ParameterError('cut', cut, '', 'a Cut')
    return cut
