"""From a setup and its cut to the constants of the inner loop.

In each regime the machine is linear. Its modes are taken over their root of mass, p = sqrt(m) q,
so that with time in steps of h

    p'' = h^2 [-omega^2 p - psi_F F + ...] - 2 zeta omega h p',   r = psi_C . p

and turned into the coordinates of the regime's eigenvectors, measured from its rest.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from lathe_chatter.array_types import Array
from lathe_chatter.errors import ParameterError
from lathe_chatter.lathe.integrator import state_layout as layout
from lathe_chatter.lathe.integrator.eigenvectors import Basis, basis_of, inverse_of, product
from lathe_chatter.lathe.integrator.propagation import TERMS
from lathe_chatter.lathe.integrator.surface import aligned, between_nodes, hermite
from lathe_chatter.lathe.integrator.surface_moments import MOMENTS
from lathe_chatter.model import BearingContact, Cut, Machine
from lathe_chatter.model.machine_and_sampling import LatheSetup

_LEAST_SPAN = 1024.0

_TOUCHES = {
    BearingContact.NONE: (layout.FREE,),
    BearingContact.SEATED: (layout.ABOVE,),
    BearingContact.GAP: (layout.FREE, layout.ABOVE),
    BearingContact.BOTH_SIDES: (layout.FREE, layout.ABOVE, layout.BELOW),
}


class Shapes(NamedTuple):
    """The modes of a machine over their root of mass, those of the tool first, each (n,).

    Attributes:
        frequency: rad/s.
        damping: 2 zeta omega, 1/s.
        tool: What a coordinate moves the tool by across the chip, m.
        workpiece: The same of the workpiece.
        bearing: The same at the bearing.
        on_tool: How a force on the tool pushes it.
        on_workpiece: How a force on the workpiece does.
    """

    frequency: Array
    damping: Array
    tool: Array
    workpiece: Array
    bearing: Array
    on_tool: Array
    on_workpiece: Array

    @property
    def relative(self) -> Array:
        """Of r."""
        return self.tool - self.workpiece

    @property
    def apart(self) -> Array:
        """How a force that drives tool and workpiece together pushes it, turned round."""
        return self.on_tool - self.on_workpiece


class Constants(NamedTuple):
    """What the inner loop is given beside a lathe's memory.

    Attributes:
        settings: What machine and cut ask for (layout.SETTINGS_SIZE,).
        flat: These and the coefficients of all regimes in one array, see `stepper.advance`.
        shapes: The modes.
        bases: The coordinates of each regime that occurs.
        rests: Where each such regime rests (2n,).
        rules: The coefficients of all regimes (REGIMES, ROWS, 2n).
        outputs: What their coordinates mean (REGIMES, 2n + 1, OUTPUTS).
        answers: How they answer by derivatives (REGIMES, 2n, SERIES, SERIES_SIZE).
    """

    settings: Array
    flat: Array
    shapes: Shapes
    bases: dict[int, Basis]
    rests: dict[int, Array]
    rules: Array
    outputs: Array
    answers: Array


@lru_cache(maxsize=64)
def constants_of(setup: LatheSetup, cut: Cut, steps: int) -> Constants:
    """The constants for a cut that takes so many steps a sample."""
    settings, shapes = settings_of(setup, cut, steps), shapes_of(setup.machine)
    width = 2 * len(shapes.frequency)
    rules = np.zeros((layout.REGIMES, layout.ROWS, width))
    outputs = np.zeros((layout.REGIMES, width + 1, layout.OUTPUTS))
    direct = np.zeros((layout.REGIMES, layout.DIRECT))
    answers = np.zeros((layout.REGIMES, width, layout.SERIES, layout.SERIES_SIZE))
    matrices = np.zeros((layout.REGIMES, 2, width, width))
    bases, rests = {}, {}
    for regime in regimes_of(setup, cut):
        known = _regime(setup.machine, regime, *acting_in(settings, regime))
        bases[regime], rests[regime] = known.basis, known.rest
        rules[regime], outputs[regime] = known.rules, known.outputs
        direct[regime], matrices[regime] = known.direct, known.matrices
        answers[regime] = known.answers
    moves = np.zeros((layout.REGIMES, layout.REGIMES, width + 1, width))
    for old, basis in bases.items():
        for new, other in bases.items():
            moves[old, new, :-1] = product(other.inverse, basis.vectors)
            shift = rests[old] - rests[new]
            moves[old, new, -1] = product(other.inverse, shift[:, None])[:, 0]
    parts = [part.ravel() for part in (settings, rules, outputs, direct, answers, moves, matrices)]
    flat = aligned(sum(map(len, parts)))
    np.concatenate(parts, out=flat)
    return Constants(settings, flat, shapes, bases, rests, rules, outputs, answers)


class _Regime(NamedTuple):
    """What `Constants` have of one regime."""

    basis: Basis
    rest: Array
    rules: Array
    outputs: Array
    direct: Array
    answers: Array
    matrices: Array


_ACTING = (layout.STEP_LENGTH, layout.CUTTING_STIFFNESS, layout.PROCESS_DAMPING, layout.CLEARANCE)
"""The settings that a regime depends on."""


def acting_in(settings: Array, regime: int) -> tuple[float, float, float, float]:
    """Those settings, as far as they act in a regime: what no cut changes is computed once."""
    step, stiffness, damping, clearance = (float(settings[place]) for place in _ACTING)
    if not regime & layout.IN_CUT:
        stiffness = damping = 0.0
    return step, stiffness, damping, clearance if regime >> 1 else 0.0


@lru_cache(maxsize=256)
def _regime(machine: Machine, regime: int, *acting: float) -> _Regime:
    shapes, settings = shapes_of(machine), np.zeros(layout.SETTINGS_SIZE)
    settings[list(_ACTING)] = acting
    step, width = settings[layout.STEP_LENGTH], 2 * len(shapes.frequency)
    rules, outputs = np.zeros((layout.ROWS, width)), np.zeros((width + 1, layout.OUTPUTS))
    answers = np.zeros((width, layout.SERIES, layout.SERIES_SIZE))
    matrices = np.zeros((2, width, width))
    matrix, push = motion(machine, shapes, settings, regime)
    basis, rest = basis_in(machine, regime, *acting[:3]), _rest(matrix, push)
    _fill_rules(shapes, settings, matrix, basis, regime, rules, answers, matrices)
    _fill_outputs(shapes, matrix, basis, rest, outputs)
    rules[layout.RELATIVE_RATE_ROW] = (
        outputs[:-1, layout.TOOL_V] - outputs[:-1, layout.WORKPIECE_V]
    )
    for row, shape in (
        (layout.TOOL_ACCELERATION, shapes.tool),
        (layout.WORKPIECE_ACCELERATION, shapes.workpiece),
    ):
        below = product(shape[None], matrix[width // 2 :]) / (step * step)
        rules[row] = product(below, basis.vectors)[0]
    direct = _direct(shapes, settings, regime, basis)
    return _Regime(basis, rest, rules, outputs, direct, answers, matrices)


@lru_cache(maxsize=256)
def basis_in(machine: Machine, regime: int, *acting: float) -> Basis:
    """The coordinates of a regime, by all that acts in it but the clearance."""
    shapes, settings = shapes_of(machine), np.zeros(layout.SETTINGS_SIZE)
    settings[list(_ACTING[:3])] = acting
    matrix, _ = motion(machine, shapes, settings, regime)
    return basis_of(matrix, _scale(shapes, settings[layout.STEP_LENGTH]))


def regimes_of(setup: LatheSetup, cut: Cut) -> list[int]:
    """The regimes that can occur."""
    cuts = (layout.OUT_OF_CUT, layout.IN_CUT) if setup.tool_leaves_cut else (layout.IN_CUT,)
    return [in_cut + 2 * touch for touch in _TOUCHES[cut.bearing_contact] for in_cut in cuts]


def shapes_of(machine: Machine) -> Shapes:
    """The modes of a machine over their root of mass."""
    modes = (*machine.tool.modes, *machine.workpiece.modes)
    of_tool = np.arange(len(modes)) < len(machine.tool.modes)
    root = np.array([math.sqrt(mode.mass) for mode in modes])
    chip, force, bearing = (
        np.array([getattr(mode, name) for mode in modes]) / root
        for name in ('chip', 'force', 'bearing')
    )
    return Shapes(
        np.array([mode.natural_frequency for mode in modes]),
        np.array([2.0 * mode.damping_ratio * mode.natural_frequency for mode in modes]),
        np.where(of_tool, chip, 0.0),
        np.where(of_tool, 0.0, chip),
        np.where(of_tool, 0.0, bearing),
        np.where(of_tool, force, 0.0),
        np.where(of_tool, 0.0, force),
    )


def settings_of(setup: LatheSetup, cut: Cut, steps: int) -> Array:
    """What machine and cut ask of the inner loop (layout.SETTINGS_SIZE,)."""
    rate = setup.sample_rate * steps
    step, speed = 1.0 / rate, cut.spindle_speed_rpm / 60.0
    turn = rate * 60.0 / cut.spindle_speed_rpm
    if abs(turn - round(turn)) <= 1e-12 * turn:
        turn = float(round(turn))
    feed = cut.feed if setup.tool_leaves_cut else 0.0
    surface_speed = math.pi * cut.workpiece_diameter * speed
    damping = cut.process_damping * cut.depth_of_cut / surface_speed
    held = math.sqrt(setup.sample_rate)
    contact = cut.bearing_contact
    settings = np.zeros(layout.SETTINGS_SIZE)
    settings[layout.SAMPLE_RATE] = setup.sample_rate
    settings[layout.STEP_LENGTH] = step
    settings[layout.TARGET_SPEED] = speed
    settings[layout.ACCELERATION] = setup.spindle_acceleration / 60.0 / speed * step
    settings[layout.VARIATION] = cut.speed_variation_amplitude
    settings[layout.VARIATION_FREQUENCY] = cut.speed_variation_frequency * step
    settings[layout.TURN] = turn
    settings[layout.SPAN] = max(_LEAST_SPAN, 2.0 ** math.ceil(math.log2(turn) + 1.0))
    settings[layout.FEED] = feed
    settings[layout.LEAD] = 0.0 if cut.feed_per_revolution > 0.0 else feed / turn
    settings[layout.CUTTING_STIFFNESS] = setup.machine.cutting_stiffness(cut.depth_of_cut)
    settings[layout.PROCESS_DAMPING] = damping / step
    settings[layout.MAY_LEAVE_CUT] = setup.tool_leaves_cut
    settings[layout.SIDES] = (
        2.0 if contact is BearingContact.BOTH_SIDES else float(contact is BearingContact.GAP)
    )
    settings[layout.CLEARANCE] = cut.bearing_clearance
    settings[layout.FORCE_NOISE] = cut.force_noise * held
    settings[layout.CUTTING_FORCE_NOISE] = cut.cutting_force_noise * held
    settings[layout.SENSOR_NOISE] = cut.sensor_noise
    settings[layout.ACCELERATION_NOISE] = cut.acceleration_noise
    settings[layout.RUNOUT], settings[layout.TOOL_RUNOUT] = cut.runout, cut.tool_runout
    settings[layout.UNBALANCE] = cut.unbalance / (step * step)
    settings[layout.LIMIT] = setup.displacement_limit
    settings[layout.SEED] = setup.seed
    part = math.ceil(turn) - turn
    settings[layout.WEIGHTS : layout.WEIGHTS + 15] = between_nodes(part).ravel()
    return settings


def motion(machine: Machine, shapes: Shapes, settings: Array, regime: int) -> tuple[Array, Array]:
    """The matrix (2n, 2n) and the constant push (2n,) of y' = matrix y + push, y = (p, p')."""
    n, step = len(shapes.frequency), settings[layout.STEP_LENGTH]
    square = step * step
    matrix, push = np.zeros((2 * n, 2 * n)), np.zeros(2 * n)
    stiffness, damping = np.diag(shapes.frequency**2 * square), np.diag(shapes.damping * step)
    if regime & layout.IN_CUT:
        across = np.outer(shapes.apart, shapes.relative)
        stiffness = stiffness + settings[layout.CUTTING_STIFFNESS] * square * across
        damping = damping + settings[layout.PROCESS_DAMPING] * square * across
    side = (0.0, 1.0, -1.0)[regime >> 1]
    if side != 0.0:
        bearing = machine.bearing_stiffness * square
        stiffness = stiffness + bearing * np.outer(shapes.bearing, shapes.bearing)
        push[n:] = side * bearing * settings[layout.CLEARANCE] * shapes.bearing
    matrix[:n, n:] = np.eye(n)
    matrix[n:, :n], matrix[n:, n:] = -stiffness, -damping
    return matrix, push


def _scale(shapes: Shapes, step: float) -> Array:
    """Displacements that go with a velocity of one (2n,)."""
    return np.append(1.0 / (shapes.frequency * step), np.ones(len(shapes.frequency)))


def _rest(matrix: Array, push: Array) -> Array:
    """Where y' = matrix y + push stands still (2n,)."""
    if not push.any():
        return push
    n = len(push) // 2
    inverse, regular = inverse_of(-matrix[n:, :n])
    if not regular:
        allowed = 'such that cutting force and stiffness do not balance at every displacement'
        raise ParameterError('depth_of_cut', 'this', '', allowed)
    return np.append(product(inverse, push[n:, None])[:, 0], np.zeros(n))


def _fill_rules(
    shapes: Shapes, settings: Array, matrix: Array, basis: Basis, regime: int, rules: Array,
    answers: Array, matrices: Array,
) -> None:  # fmt: skip
    """Generators, inputs and the response to a whole step (ROWS, 2n), as series and matrices."""
    n = len(matrix) // 2
    pairs = np.append(np.arange(n, 2 * n), np.arange(n))
    everyone = np.arange(2 * n)
    square = settings[layout.STEP_LENGTH] ** 2
    in_cut = float(regime & layout.IN_CUT)
    inputs: Array = np.zeros((2 * n, 4))
    inputs[n:, layout.SURFACE] = in_cut * settings[layout.CUTTING_STIFFNESS] * shapes.apart
    inputs[n:, layout.TOOL_FORCE] = shapes.on_tool
    inputs[n:, layout.CUTTING_FORCE] = -in_cut * shapes.apart
    inputs[n:, layout.UNBALANCE_FORCE] = shapes.on_workpiece
    inputs = product(basis.inverse, inputs * square)
    rules[layout.BY_SURFACE : layout.BY_UNBALANCE + 1] = inputs.T
    rules[layout.OWN] = basis.generator[everyone, everyone]
    rules[layout.PARTNER] = basis.generator[everyone, pairs]
    powers = hermite()
    held, starts = np.zeros((2 * n, 14, 6)), np.zeros((2 * n, 2 * n))
    held[:, :6] = inputs[:, layout.SURFACE, None, None] * powers.T
    held[:, 6:12] = inputs[:, layout.UNBALANCE_FORCE, None, None] * powers.T
    held[:, 12:, 0] = inputs[:, [layout.TOOL_FORCE, layout.CUTTING_FORCE]]
    starts[everyone, everyone] = 1.0
    state, forced = _whole_step(basis.generator, starts, held)
    rules[layout.STEP_SURFACE : layout.STEP_SURFACE + 12] = forced[:, :12].T
    rules[layout.STEP_TOOL_FORCE : layout.STEP_CUTTING_FORCE + 1] = forced[:, 12:].T
    terms = [np.hstack([inputs, basis.generator])]
    for _ in range(TERMS - 1):
        terms.append(product(basis.generator, terms[-1]))
    known, itself = np.array(terms), inputs.shape[1] + everyone
    following = answers[:, :, layout.SERIES_BEGIN :]
    following[:, : layout.OF_ITSELF] = known[:, :, : layout.OF_ITSELF].transpose(1, 2, 0)
    following[:, layout.OF_ITSELF] = known[:, everyone, itself].T
    following[:, layout.OF_PARTNER] = known[:, everyone, itself[pairs]].T
    rules[layout.STEP_MOMENT : layout.STEP_MOMENT + MOMENTS] = known[:MOMENTS, :, layout.SURFACE]
    rules[layout.STEP_OWN] = state[everyone, everyone]
    rules[layout.STEP_PARTNER] = state[everyone, pairs]
    matrices[0], matrices[1] = basis.generator, state


def _whole_step(generator: Array, starts: Array, held: Array) -> tuple[Array, Array]:
    """The response to starts (2n, m) and to inputs as polynomials (2n, k, 6), after one step.

    By the same series as a piece: no second method.
    """
    state, forced = starts.copy(), np.zeros(held.shape[:2])
    term, pushed = starts, np.zeros(held.shape[:2])
    for k in range(TERMS):
        moved = product(generator, np.hstack([term, pushed]))
        pushed = moved[:, term.shape[1] :] + (held[:, :, k] if k < held.shape[2] else 0.0)
        term, pushed = moved[:, : term.shape[1]] / (k + 1), pushed / (k + 1)
        state, forced = state + term, forced + pushed
    return state, forced


def _fill_outputs(
    shapes: Shapes, matrix: Array, basis: Basis, rest: Array, outputs: Array
) -> None:
    """What the coordinates mean (2n + 1, OUTPUTS)."""
    n = len(matrix) // 2
    rows = np.zeros((layout.OUTPUTS, 2 * n))
    for place, slope, shape in (
        (layout.TOOL_X, layout.TOOL_V, shapes.tool),
        (layout.WORKPIECE_X, layout.WORKPIECE_V, shapes.workpiece),
        (layout.BEARING_X, layout.BEARING_V, shapes.bearing),
    ):
        rows[place, :n], rows[slope, n:] = shape, shape
    rows[layout.BEND] = product(shapes.relative[None], matrix[n:])[0]
    outputs[:-1] = product(rows, basis.vectors).T
    outputs[-1] = product(rows, rest[:, None])[:, 0]
    outputs[-1, layout.BEND] = 0.0


def _direct(shapes: Shapes, settings: Array, regime: int, basis: Basis) -> Array:
    """What surface and forces add to r'', m/step2, and to both accelerations, m/s2."""
    in_cut = float(regime & layout.IN_CUT)
    square = settings[layout.STEP_LENGTH] ** 2
    acting = np.column_stack(
        [
            in_cut * settings[layout.CUTTING_STIFFNESS] * shapes.apart,
            shapes.on_tool,
            -in_cut * shapes.apart,
            shapes.on_workpiece,
        ]
    )
    seen = np.array([shapes.relative * square, shapes.tool, shapes.workpiece])
    result = np.zeros(layout.DIRECT)
    result[: layout.COUPLED] = product(seen, acting).ravel()
    result[[layout.COUPLED, layout.RATE]] = float(not basis.in_pairs), basis.rate
    return result
