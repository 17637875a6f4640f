"""The machine: equations (1)-(14) of the paper as frozen values in SI.

A tool and a workpiece-spindle, each one mode, are coupled by the cutting force; the workpiece
may rest on its bearing across a clearance:

    m_t  x_t''  + c_t  x_t'  + k_t  x_t                            + F = 0        (8a)
    m_wp x_wp'' + c_wp x_wp' + k_wp x_wp + s k_bc (x_wp - gamma)   - F = 0        (8b)
    F = C w [r(t) - r(t - tau)],   r = x_t - x_wp                                 (2)

with the screening function s = 1 while x_wp >= gamma (9). The delay enters through the scalar r
alone, which is why a lathe needs to remember one signal and not its whole state.

A tool or a workpiece of a real machine has several modes, a `Structure`. With a force F on the
body, mode k moves by

    m_k q_k'' + c_k q_k' + k_k q_k = phi_F,k F,   x = sum phi_C,k q_k,   x_B = sum phi_B,k q_k

where x is the displacement in the chip direction and x_B that at the bearing.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

import numpy as np

from lathe_chatter.array_types import Array
from lathe_chatter.errors import ParameterError
from lathe_chatter.model.quantity_fields import Quantity, check_fields, quantity


@dataclass(frozen=True)
class Mode:
    """One vibration mode of the tool or of the workpiece-spindle (Table 1).

    Attributes:
        mass: kg.
        natural_frequency: Undamped, rad/s.
        damping_ratio: zeta.
        chip: Participation phi_C in the displacement across the chip; of either sign, like all.
        force: Participation phi_F in the cutting force. Where it differs from `chip`, the mode
            moves in another direction than the force acts: mode coupling.
        bearing: Participation phi_B at the bearing, of a mode of the workpiece.

    Raises:
        ParameterError: If a value is not finite or outside its limits.
    """

    mass: float = quantity('modal mass', 'kg', low=1e-6, high=1e6)
    natural_frequency: float = quantity(
        'undamped natural frequency', 'rad/s', high=1e6, exclusive=True
    )
    damping_ratio: float = quantity('damping ratio zeta', high=1.0)
    chip: float = 1.0
    force: float = 1.0
    bearing: float = 1.0

    def __post_init__(self) -> None:
        """Validate."""
        check_fields(self)
        for name in ('chip', 'force', 'bearing'):
            object.__setattr__(self, name, PARTICIPATION.check(name, getattr(self, name)))

    @property
    def modes(self) -> tuple[Mode, ...]:
        """This one mode, as a `Structure` has several."""
        return (self,)

    @property
    def stiffness(self) -> float:
        """k = m omega_n^2, N/m."""
        return self.mass * self.natural_frequency**2

    @property
    def damping(self) -> float:
        """c = 2 zeta m omega_n, N s/m."""
        return 2.0 * self.damping_ratio * self.mass * self.natural_frequency


@dataclass(frozen=True)
class Structure:
    """A tool or a workpiece with several modes.

    What only a single mode has (`mass`, `natural_frequency`, `damping_ratio`, `damping`) is
    refused in a sentence, so that nothing is computed from the first mode alone.

    Attributes:
        modes: 2 or more, in any order.

    Raises:
        ParameterError: If there are fewer, or what is given are no modes.
    """

    modes: tuple[Mode, ...]

    def __post_init__(self) -> None:
        """Validate."""
        modes = tuple(self.modes) if isinstance(self.modes, Iterable) else ()
        if len(modes) < 2 or not all(isinstance(mode, Mode) for mode in modes):
            raise ParameterError('modes', self.modes, '', 'two Modes or more')
        object.__setattr__(self, 'modes', modes)

    def __iter__(self) -> Iterator[Mode]:
        return iter(self.modes)

    @property
    def stiffness(self) -> float:
        """Static stiffness in the chip direction against the cutting force, N/m."""
        compliance = sum(mode.chip * mode.force / mode.stiffness for mode in self.modes)
        return 1.0 / compliance if compliance else math.inf

    @property
    def mass(self) -> float:
        """A single mode has one."""
        raise self._several('mass')

    @property
    def natural_frequency(self) -> float:
        """A single mode has one."""
        raise self._several('natural frequency')

    @property
    def damping_ratio(self) -> float:
        """A single mode has one."""
        raise self._several('damping ratio')

    @property
    def damping(self) -> float:
        """A single mode has one."""
        raise self._several('damping')

    def _several(self, what: str) -> ParameterError:
        allowed = f'1, as only one mode has a {what}'
        return ParameterError('the number of modes', len(self.modes), '', allowed)


Body = Mode | Structure
"""A tool or a workpiece: `modes` is what both have."""

MOST_MODES = 16
"""Of tool and workpiece together."""


@dataclass(frozen=True)
class Machine:
    """What does not change while cutting: tool, workpiece, the bearing and the material.

    `bearing_stiffness` None means the paper's k_bc = 0.5 k_wp. A body is given as a `Mode`, as a
    `Structure` or as a list of modes.

    Raises:
        ParameterError: If a value is not finite or outside its limits, or there are more than
            `MOST_MODES` modes.
    """

    tool: Body = field(default_factory=lambda: Mode(0.05, 775.0, 0.05))
    workpiece: Body = field(default_factory=lambda: Mode(0.05, 650.0, 0.05))
    bearing_stiffness: float = quantity(
        'stiffness k_bc of the bearing behind its clearance', 'N/m', default=None, high=1e12
    )
    cutting_coefficient: float = quantity(
        'cutting force coefficient C', 'N/m2', default=3.5e6, high=1e12
    )

    def __post_init__(self) -> None:
        """Validate, with the paper's bearing stiffness where none is given."""
        for name in ('tool', 'workpiece'):
            object.__setattr__(self, name, _body(name, getattr(self, name)))
        count = len(self.tool.modes) + len(self.workpiece.modes)
        if count > MOST_MODES:
            allowed = f'at most {MOST_MODES}, of tool and workpiece together'
            raise ParameterError('the number of modes', count, '', allowed)
        if self.bearing_stiffness is None:
            object.__setattr__(self, 'bearing_stiffness', 0.5 * abs(self.workpiece.stiffness))
        check_fields(self)

    def cutting_stiffness(self, depth_of_cut: float) -> float:
        """C w, the force per metre of chip thickness, N/m."""
        return self.cutting_coefficient * depth_of_cut

    def workpiece_stiffness(self, *, seated: bool) -> float:
        """k_wp against the cutting force, with k_bc where it rests on its bearing, N/m."""
        modes = self.workpiece.modes
        chip, force, bearing, stiffness = (
            np.array([getattr(mode, name) for mode in modes])
            for name in ('chip', 'force', 'bearing', 'stiffness')
        )
        if len(modes) == 1 and chip == force == bearing == 1.0:
            return float(stiffness[0]) + (self.bearing_stiffness if seated else 0.0)
        compliance = (chip * force / stiffness).sum()
        if seated:
            across = (chip * bearing / stiffness).sum() * (bearing * force / stiffness).sum()
            at_bearing = 1.0 + self.bearing_stiffness * (bearing**2 / stiffness).sum()
            compliance -= self.bearing_stiffness * across / at_bearing
        return float(1.0 / compliance)

    def matrices(self, depth_of_cut: float, *, seated: bool) -> tuple[Array, Array, Array]:
        """A, B and d/gamma of x' = A x + B x(t - tau) + d, equations (5)-(7), (13) and (14).

        Args:
            depth_of_cut: w, m. With 0 the matrices are those of the tool out of the cut.
            seated: The screening function: whether the bearing carries.

        Returns:
            A (2n, 2n), B (2n, 2n) and d per metre of clearance (2n,) for n modes: displacement
            and velocity of each, those of the tool first. With one mode each this is the order of
            the paper: tool displacement and velocity, workpiece displacement and velocity.
        """
        modes = (*self.tool.modes, *self.workpiece.modes)
        of_tool = np.arange(len(modes)) < len(self.tool.modes)
        mass, chip, force, bearing = (
            np.array([getattr(mode, name) for mode in modes])
            for name in ('mass', 'chip', 'force', 'bearing')
        )
        across = np.where(of_tool, chip, -chip)  # r = across . q
        cutting = self.cutting_stiffness(depth_of_cut) * np.outer(
            np.where(of_tool, force, -force) / mass, across
        )
        at_bearing = np.where(of_tool, 0.0, bearing) * float(seated)
        push = self.bearing_stiffness / mass * at_bearing
        a = np.zeros((2 * len(modes), 2 * len(modes)))
        b = np.zeros_like(a)
        d = np.zeros(len(a))
        a[0::2, 1::2] = np.eye(len(modes))
        a[1::2, 0::2] = -cutting - np.outer(push, at_bearing)
        for k, mode in enumerate(modes):
            a[2 * k + 1, 2 * k] -= mode.natural_frequency**2
            a[2 * k + 1, 2 * k + 1] = -2.0 * mode.damping_ratio * mode.natural_frequency
        b[1::2, 0::2] = cutting
        d[1::2] = push
        return a, b, d

    def _repr_html_(self) -> str:
        """As a notebook shows it."""
        from lathe_chatter.model.parameter_table import html_of

        return html_of(self)


PARTICIPATION = Quantity('participation of a mode', low=-1e6, high=1e6)
RIGID = Mode(5e4, 2.0 * math.pi * 1e3, 0.5)
"""What a machine file calls `rigid`: 2e12 N/m, well damped: no figure shows that it gives."""


def _body(name: str, given: object) -> Body:
    """A body from a mode, a structure, or a list of modes."""
    if isinstance(given, (Mode, Structure)):
        return given
    modes = tuple(given) if isinstance(given, (list, tuple)) else ()
    if not modes or not all(isinstance(mode, Mode) for mode in modes):
        raise ParameterError(name, given, '', 'a Mode, or a list of Modes')
    return modes[0] if len(modes) == 1 else Structure(modes)
