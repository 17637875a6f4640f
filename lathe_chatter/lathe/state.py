"""`LatheState`: everything that a virtual lathe remembers, as one value, in memory or a file."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from lathe_chatter.array_types import Array, Integers
from lathe_chatter.errors import ParameterError, StateError
from lathe_chatter.lathe.integrator import state_layout as layout
from lathe_chatter.lathe.integrator import surface
from lathe_chatter.lathe.integrator.coefficients import Constants, constants_of
from lathe_chatter.lathe.integrator.eigenvectors import product
from lathe_chatter.lathe.integrator.step_size import steps_per_sample
from lathe_chatter.model import BearingContact, Cut, Machine, Mode, paper_initial_state
from lathe_chatter.model.machine import RIGID
from lathe_chatter.model.machine_and_sampling import LatheSetup
from lathe_chatter.model.quantity_fields import Quantity

_STATE = Quantity('initial state', 'm or m/s', low=-1e6, high=1e6)
_FORMAT = 3
"""Of a saved state; another one is refused."""


@dataclass(eq=False)
class LatheState:
    """A lathe between two samples.

    Attributes:
        setup: What it was given at the start.
        cut: The parameters of the cut in force.
        numbers: Spindle, surface met, and the coordinates of the 2n modes
            (layout.NUMBERS_SIZE + 4n,).
        counts: Samples and regimes (layout.COUNTS_SIZE,).
        nodes: The surface of the last turn (surface.NODE_SIZE, nodes).
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
                (4,), m and m/s; by default the paper's, of a rigid body none. A body with several
                modes is displaced as by a force that rests on it, and has its velocity from a
                blow, both in the chip direction.

        Raises:
            ParameterError: If the initial state is not four finite numbers, or the machine with
                this cut is too fast for the sample rate.
        """
        given = _usual_start(setup.machine, cut) if initial_state is None else initial_state
        if np.shape(given) != (4,):
            raise ParameterError('initial_state', given, '', 'four numbers')
        start = np.array([_STATE.check('initial_state', value) for value in given])
        modes = len(setup.machine.tool.modes) + len(setup.machine.workpiece.modes)
        numbers = np.zeros(layout.NUMBERS_SIZE + 4 * modes)
        speed = cut.spindle_speed_rpm / 60.0
        numbers[layout.SPEED] = speed
        counts = np.zeros(layout.COUNTS_SIZE, dtype=np.int64)
        counts[layout.HEAD], counts[layout.CORNER] = 1, 1
        counts[layout.STEPS] = steps_per_sample(setup, cut, speed)
        state = cls(setup, cut, numbers, counts, np.empty((surface.NODE_SIZE, 0)))
        settings = state.constants.settings
        motion = _modal(start, state.constants)
        counts[layout.REGIME] = layout.IN_CUT + 2 * state._touch(_bearing(state.constants, motion))
        state._take_coordinates(motion)
        offset = numbers[layout.RELATIVE]
        state.nodes = surface.fresh_surface(offset, settings[layout.TURN], 2)
        numbers[layout.HEIGHT] = offset
        return state

    @property
    def constants(self) -> Constants:
        """Of the inner loop, for this cut."""
        return constants_of(self.setup, self.cut, int(self.counts[layout.STEPS]))

    def retune(self, cut: Cut) -> None:
        """Change the cut here; nothing is restarted.

        Raises:
            ParameterError: If the machine with this cut is too fast for the sample rate, or
                turns too slowly for it; then nothing has changed.
        """
        steps = steps_per_sample(self.setup, cut, float(self.numbers[layout.SPEED]))
        old, new, motion = self.constants, constants_of(self.setup, cut, steps), self._motion()
        bearing = (self.cut.bearing_contact, self.cut.bearing_clearance)
        self.cut, self.counts[layout.STEPS] = cut, steps
        counts = self.counts
        if self.setup.spindle_acceleration == 0.0:
            self.numbers[layout.SPEED] = cut.spindle_speed_rpm / 60.0
        if (cut.bearing_contact, cut.bearing_clearance) != bearing:
            touch = self._touch(float(self.numbers[layout.AT_BEARING]))
            counts[layout.REGIME] = (counts[layout.REGIME] & layout.IN_CUT) + 2 * touch
        self._recount(old.settings, new.settings)
        self._take_coordinates(motion)
        self._corner(1)

    def motion(self) -> tuple[float, float, float, float]:
        """Tool displacement and velocity, workpiece displacement and velocity, m and m/s."""
        constants, motion = self.constants, self._motion()
        half, shapes = len(motion) // 2, constants.shapes
        return (
            _sum(shapes.tool * motion[:half]),
            _sum(shapes.tool * motion[half:]),
            _sum(shapes.workpiece * motion[:half]),
            _sum(shapes.workpiece * motion[half:]),
        )

    def knock(self, impulse: float) -> None:
        """Let the tool's modes start as a blow of `impulse`, N s, makes them; here."""
        motion, constants = self._motion(), self.constants
        motion[len(motion) // 2 :] += constants.shapes.on_tool * impulse
        self._take_coordinates(motion)
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
        counts, pointer = self.counts.copy(), int(self.counts[layout.POINTER])
        nodes = self.nodes[:, pointer : int(counts[layout.HEAD]) + 1].copy()
        counts[layout.POINTER], counts[layout.HEAD] = 0, nodes.shape[1] - 1
        return LatheState(self.setup, self.cut, self.numbers.copy(), counts, nodes, self.guard)

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
        machine = self.setup.machine
        modes = len(machine.tool.modes) + len(machine.workpiece.modes)
        fits = (
            self.numbers.shape == (layout.NUMBERS_SIZE + 4 * modes,)
            and self.counts.shape == (layout.COUNTS_SIZE,)
            and self.nodes.shape == (surface.NODE_SIZE, int(self.counts[layout.HEAD]) + 1)
            and [array.dtype.str[1:] for array in (self.numbers, self.counts, self.nodes)]
            == ['f8', 'i8', 'f8']
            and 0 <= self.counts[layout.POINTER] < self.counts[layout.HEAD]
            and 0 <= self.counts[layout.REGIME] < layout.REGIMES
            and self.counts[layout.STEPS] > 0
            and np.isfinite(self.numbers).all()
        )
        if not fits:
            raise StateError(f'{path} is the saved state of a lathe, but damaged.')

    # -- how -------------------------------------------------------------------------------

    def _touch(self, displacement: float) -> int:
        """Which side of its bearing the workpiece touches with a displacement there, m."""
        contact, clearance = self.cut.bearing_contact, self.cut.bearing_clearance
        if contact is BearingContact.NONE:
            return layout.FREE
        if contact is BearingContact.SEATED or displacement >= clearance:
            return layout.ABOVE
        both = contact is BearingContact.BOTH_SIDES
        return layout.BELOW if both and displacement <= -clearance else layout.FREE

    def _motion(self) -> Array:
        """The modes over their root of mass, and their velocities per second (2n,).

        Where nothing has moved since they were made, they are what was made: then changes before
        the first step are as if the lathe had begun with them, to the last bit.
        """
        first = layout.NUMBERS_SIZE
        half = (len(self.numbers) - first) // 4
        if self.counts[layout.MADE]:
            return self.numbers[first + 2 * half :].copy()
        constants, regime = self.constants, int(self.counts[layout.REGIME])
        coordinates = self.numbers[first : first + 2 * half, None]
        moved = product(constants.bases[regime].vectors, coordinates)[:, 0]
        result: Array = moved + constants.rests[regime]
        result[half:] /= constants.settings[layout.STEP_LENGTH]
        return result

    def _take_coordinates(self, motion: Array) -> None:
        """Remember a motion as coordinates of the present regime, and what it means."""
        constants, regime = self.constants, int(self.counts[layout.REGIME])
        half, shapes, first = len(motion) // 2, constants.shapes, layout.NUMBERS_SIZE
        self.numbers[first + 2 * half :], self.counts[layout.MADE] = motion, 1
        motion = motion.copy()
        motion[half:] *= constants.settings[layout.STEP_LENGTH]
        away = (motion - constants.rests[regime])[:, None]
        self.numbers[first : first + 2 * half] = product(constants.bases[regime].inverse, away)[
            :, 0
        ]
        for place, rate, shape in (
            (layout.RELATIVE, layout.RELATIVE_RATE, shapes.relative),
            (layout.AT_BEARING, layout.AT_BEARING_RATE, shapes.bearing),
        ):
            self.numbers[place] = product(shape[None], motion[:half, None])[0, 0]
            self.numbers[rate] = product(shape[None], motion[half:, None])[0, 0]

    def _recount(self, old: Array, new: Array) -> None:
        """Count the spindle's angle in other steps, and the surface from another feed."""
        numbers, counts = self.numbers, self.counts
        feeds = np.array([s[layout.FEED] / s[layout.TURN] for s in (old, new)])
        ratio = new[layout.TURN] / old[layout.TURN]
        if ratio == 1.0 and feeds[0] == feeds[1]:
            return
        place, ahead = numbers[layout.PLACE], numbers[layout.AHEAD]
        # What the tool has met is forgotten here too: places that begin anew with each change
        # would else never become so large that it is.
        pointer = int(counts[layout.POINTER])
        used = self.nodes[:, pointer : int(counts[layout.HEAD]) + 1]
        last = used.shape[1] - 1
        self.nodes[:, : last + 1] = surface.recounted(used, place, ratio, ahead, feeds)
        counts[layout.POINTER], counts[layout.HEAD] = 0, last
        met: Array = np.zeros((surface.NODE_SIZE, 1))
        met[surface.PLACE, 0] = place - old[layout.TURN]
        met[surface.HEIGHT, 0] = numbers[layout.HEIGHT]
        met[surface.SLOPE_AFTER, 0] = numbers[layout.SLOPE]
        met[surface.CURVATURE_AFTER, 0] = numbers[layout.CURVATURE]
        met = surface.recounted(met, place, ratio, ahead, feeds)
        numbers[layout.HEIGHT] = met[surface.HEIGHT, 0]
        numbers[layout.SLOPE] = met[surface.SLOPE_AFTER, 0]
        numbers[layout.CURVATURE] = met[surface.CURVATURE_AFTER, 0]
        turned = numbers[layout.ORIGIN_LOW] + place / old[layout.TURN]
        total = numbers[layout.ORIGIN] + turned
        numbers[layout.ORIGIN_LOW] = turned - (total - numbers[layout.ORIGIN])
        numbers[layout.ORIGIN] = total
        numbers[layout.PLACE] = numbers[layout.AHEAD] = 0.0

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
    for name in ('tool', 'workpiece'):
        body = machine[name]
        several = 'modes' in body
        machine[name] = [Mode(**mode) for mode in body['modes']] if several else Mode(**body)
    return LatheSetup(Machine(**machine), **words)


def _usual_start(machine: Machine, cut: Cut) -> Array:
    """The paper's initial state (4,), in which a body that does not give stands still."""
    moves = [body != RIGID for body in (machine.tool, machine.workpiece)]
    return np.where(np.repeat(moves, 2), paper_initial_state(cut), 0.0)


def _modal(start: Array, constants: Constants) -> Array:
    """The modes over their root of mass, and their velocities (2n,), of a start (4,)."""
    shapes = constants.shapes
    motion = np.zeros((2, len(shapes.frequency)))
    for shape, x, v in ((shapes.tool, *start[:2]), (shapes.workpiece, *start[2:])):
        if shape.any():
            pressed = shape / shapes.frequency**2
            motion[0] += pressed * (x / _sum(pressed * shape))
            motion[1] += shape * (v / _sum(shape * shape))
    return motion.ravel()


def _bearing(constants: Constants, motion: Array) -> float:
    """The displacement at the bearing, m."""
    return _sum(constants.shapes.bearing * motion[: len(motion) // 2])


def _sum(values: Array) -> float:
    """In order: so the bits are the same everywhere."""
    return float(sum(values.tolist()))


def differences(one: LatheSetup, other: LatheSetup) -> list[str]:
    """Names of the fields in which two setups differ."""
    return [
        entry.name
        for entry in fields(one)
        if getattr(one, entry.name) != getattr(other, entry.name)
    ]
