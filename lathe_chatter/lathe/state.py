"""`LatheState`: everything that a virtual lathe remembers, as one value, in memory or a file."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from lathe_chatter.arrays import Array, Integers
from lathe_chatter.errors import ParameterError, StateError
from lathe_chatter.lathe.integrator import propagation, surface
from lathe_chatter.lathe.integrator import state_layout as layout
from lathe_chatter.lathe.integrator.coefficients import steps_per_sample
from lathe_chatter.model import BearingContact, Cut, Machine, Mode, paper_initial_state
from lathe_chatter.model.lathe_setup import LatheSetup
from lathe_chatter.model.quantities import Quantity

_STATE = Quantity('initial state', 'm or m/s', low=-1e6, high=1e6)
_FORMAT = 1
"""Of a saved state; another one is refused."""
_ROOM = 512
"""Nodes of the surface for which there is room at first."""


@dataclass(eq=False)
class LatheState:
    """A lathe between two samples.

    Attributes:
        setup: What it was given at the start.
        cut: The parameters of the cut in force.
        numbers: State, spindle angle, feed and speed (layout.NUMBERS_SIZE,).
        counts: Samples, turns and regimes (layout.COUNTS_SIZE,).
        nodes: The surface of the last turn (nodes, surface.NODE_SIZE).
        guard: Why the run has ended, or an empty string.
    """

    setup: LatheSetup
    cut: Cut
    numbers: Array
    counts: Integers
    nodes: Array
    guard: str = ''

    @classmethod
    def fresh(
        cls, setup: LatheSetup, cut: Cut, initial_state: Sequence[float] | Array | None = None
    ) -> LatheState:
        """The state at t = 0, with a smooth surface of the turn before.

        Args:
            setup: Machine, force law and sampling.
            cut: What is cut at the start.
            initial_state: Tool displacement and velocity, workpiece displacement and velocity
                (4,), m and m/s; by default the paper's.

        Raises:
            ParameterError: If the initial state is not four finite numbers, or the machine with
                this cut is too fast for the sample rate.
        """
        given = paper_initial_state(cut) if initial_state is None else initial_state
        if np.shape(given) != (4,):
            raise ParameterError('initial_state', given, '', 'four numbers')
        start = np.array([_STATE.check('initial_state', value) for value in given])
        numbers = np.zeros(layout.NUMBERS_SIZE)
        numbers[:4] = start
        speed = cut.spindle_speed_rpm / 60.0
        numbers[layout.SPEED] = speed
        feed = cut.feed_speed / speed if setup.tool_leaves_cut else 0.0
        offset = start[0] - start[2]
        nodes = surface.fresh_surface(feed, _ROOM)
        nodes[:2, surface.HEIGHT] += offset
        numbers[layout.MET], numbers[layout.MET_SLOPE] = offset - feed, feed
        counts = np.zeros(layout.COUNTS_SIZE, dtype=np.int64)
        counts[layout.HEAD], counts[layout.CORNER] = 1, 1
        counts[layout.REGIME] = propagation.IN_CUT
        state = cls(setup, cut, numbers, counts, nodes)
        state._settle_regime()
        counts[layout.STEPS] = state.steps_for(cut)
        return state

    def steps_for(self, cut: Cut) -> int:
        """Steps a sample for a cut that begins now.

        Chosen when the cut changes and then remembered: a restored run takes the same steps.

        Raises:
            ParameterError: If the machine is too fast for the sample rate.
        """
        speed = max(cut.spindle_speed_rpm / 60.0, float(self.numbers[layout.SPEED]))
        return steps_per_sample(self.setup.machine, cut, speed, self.setup.sample_rate)

    def retune(self, cut: Cut) -> None:
        """Change the cut here; nothing is restarted.

        Raises:
            ParameterError: If the machine with this cut is too fast for the sample rate; then
                nothing has changed.
        """
        self.counts[layout.STEPS] = self.steps_for(cut)
        bearing = (self.cut.bearing_contact, self.cut.bearing_clearance)
        self.cut = cut
        if self.setup.spindle_acceleration == 0.0:
            self.numbers[layout.SPEED] = cut.spindle_speed_rpm / 60.0
        if (cut.bearing_contact, cut.bearing_clearance) != bearing:
            self._settle_regime()
        self._corner(1)

    def knock(self, impulse: float) -> None:
        """Let the tool's velocity jump by impulse / m_t here; `impulse` in N s."""
        self.numbers[layout.TOOL_V] += impulse / self.setup.machine.tool.mass
        self._corner(1)

    def end(self) -> None:
        """Note that the next sample would lie beyond what the machine means."""
        setup = self.setup
        time = (int(self.counts[layout.SAMPLES]) + 1) / setup.sample_rate
        self.guard = (
            f'The run ended at {time:.4f} s: a displacement passed '
            f'{setup.displacement_limit:g} m, beyond which this machine has no meaning.'
        )

    def copy(self) -> LatheState:
        """The same state with a memory of its own, no larger than it must be."""
        nodes = self.nodes[: int(self.counts[layout.HEAD]) + 1].copy()
        return LatheState(
            self.setup, self.cut, self.numbers.copy(), self.counts.copy(), nodes, self.guard
        )

    def __eq__(self, other: object) -> bool:
        """Equal bit for bit, whatever room there is for more."""
        if not isinstance(other, LatheState):
            return NotImplemented
        mine, theirs = self.copy(), other.copy()
        return (mine.setup, mine.cut, mine.guard) == (theirs.setup, theirs.cut, theirs.guard) and [
            array.tobytes() for array in (mine.numbers, mine.counts, mine.nodes)
        ] == [array.tobytes() for array in (theirs.numbers, theirs.counts, theirs.nodes)]

    __hash__ = None  # type: ignore[assignment]  # a mutable value

    # -- in a file -------------------------------------------------------------------------

    def save(self, path: str | Path) -> None:
        """Write the state to a file, from which another process continues bit for bit.

        Raises:
            OSError: If the file cannot be written.
        """
        state = self.copy()
        words = {
            'format': _FORMAT,
            'setup': asdict(state.setup),
            'cut': asdict(state.cut),
            'guard': state.guard,
        }
        with Path(path).open('wb') as file:
            np.savez_compressed(
                file,
                words=np.array(json.dumps(words)),
                numbers=state.numbers,
                counts=state.counts,
                nodes=state.nodes,
            )

    @classmethod
    def load(cls, path: str | Path) -> LatheState:
        """Read a saved state.

        Raises:
            OSError: If the file cannot be read.
            StateError: If it is no saved state, or one of another format.
        """
        try:
            with np.load(path, allow_pickle=False) as saved:
                words = json.loads(str(saved['words']))
                _check_format(path, words['format'])
                state = cls(
                    _setup_from(words['setup']), Cut(**words['cut']),
                    saved['numbers'], saved['counts'], saved['nodes'], words['guard'],
                )  # fmt: skip
        except StateError:
            raise
        except (ValueError, KeyError, TypeError, AttributeError, zipfile.BadZipFile, EOFError):
            raise StateError(f'{path} is not the saved state of a lathe.') from None
        state._check(path)
        return state

    def _check(self, path: str | Path) -> None:
        """Refuse arrays on which the inner loop could not work."""
        fits = (
            self.numbers.shape == (layout.NUMBERS_SIZE,)
            and self.counts.shape == (layout.COUNTS_SIZE,)
            and self.nodes.shape == (int(self.counts[layout.HEAD]) + 1, surface.NODE_SIZE)
            and [array.dtype.str[1:] for array in (self.numbers, self.counts, self.nodes)]
            == ['f8', 'i8', 'f8']
            and 0 <= self.counts[layout.POINTER] < self.counts[layout.HEAD]
            and 0 <= self.counts[layout.REGIME] < propagation.REGIMES
            and self.counts[layout.STEPS] > 0
            and np.isfinite(self.numbers).all()
        )
        if not fits:
            raise StateError(f'{path} is the saved state of a lathe, but damaged.')

    # -- how -------------------------------------------------------------------------------

    def _settle_regime(self) -> None:
        """Decide from the displacement whether the bearing carries."""
        contact = self.cut.bearing_contact
        touches = self.numbers[layout.WORKPIECE_X] >= self.cut.bearing_clearance
        self.counts[layout.REGIME] &= ~propagation.ENGAGED
        if contact is BearingContact.SEATED or (contact is BearingContact.GAP and touches):
            self.counts[layout.REGIME] |= propagation.ENGAGED

    def _corner(self, order: int) -> None:
        """Note that derivative `order` of the surface jumps here."""
        self.counts[layout.CORNER] = min(self.counts[layout.CORNER] or order, order)


def _check_format(path: str | Path, found: object) -> None:
    """Refuse a state that another version has saved otherwise."""
    if found != _FORMAT:
        raise StateError(
            f'{path} is a saved lathe of format {found}, and this version continues from '
            f'format {_FORMAT}.'
        )


def _setup_from(words: dict[str, Any]) -> LatheSetup:
    """A setup from its fields as JSON has them."""
    machine = words.pop('machine')
    tool, workpiece = Mode(**machine.pop('tool')), Mode(**machine.pop('workpiece'))
    return LatheSetup(Machine(tool, workpiece, **machine), **words)


def differences(one: LatheSetup, other: LatheSetup) -> list[str]:
    """Names of the fields in which two setups differ."""
    return [
        entry.name
        for entry in fields(one)
        if getattr(one, entry.name) != getattr(other, entry.name)
    ]
