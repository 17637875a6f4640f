"""The machine and the cut: equations (1)-(14) of the paper as frozen values in SI.

A tool and a workpiece-spindle, each one mode, are coupled by the cutting force; the workpiece
may rest on its bearing across a clearance:

    m_t  x_t''  + c_t  x_t'  + k_t  x_t                            + F = 0        (8a)
    m_wp x_wp'' + c_wp x_wp' + k_wp x_wp + s k_bc (x_wp - gamma)   - F = 0        (8b)
    F = C w [r(t) - r(t - tau)],   r = x_t - x_wp                                 (2)

with the screening function s = 1 while x_wp >= gamma (9). The delay enters through the scalar r
alone, which is why a lathe needs to remember one signal and not its whole state.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lathe_chatter.errors import ParameterError
from lathe_chatter.quantities import check_choice, check_fields, quantity

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

STATE_FIELDS = (
    'tool_displacement',
    'tool_velocity',
    'workpiece_displacement',
    'workpiece_velocity',
)
SAMPLE_COLUMNS = ('time', 'spindle_angle', *STATE_FIELDS, 'chip_thickness', 'cutting_force')
"""The columns of a block of samples: s, rev, m, m/s, m, m/s, m, N."""


class BearingContact(str, Enum):
    """How the bearing clearance enters the model (see the README for what the paper did)."""

    NONE = 'none'
    """No bearing clearance in the model, equations (1)-(7)."""
    GAP = 'gap'
    """Equation (9) as printed: the bearing engages while x_wp >= gamma."""
    SEATED = 'seated'
    """The screening function is 1 throughout: the workpiece-spindle rests on its bearing."""


@dataclass(frozen=True)
class Mode:
    """One vibration mode of the tool or of the workpiece-spindle (Table 1).

    Raises:
        ParameterError: If a value is not finite or outside its limits.
    """

    mass: float = quantity('modal mass', 'kg', low=1e-6, high=1e4)
    natural_frequency: float = quantity(
        'undamped natural frequency', 'rad/s', high=1e6, exclusive=True
    )
    damping_ratio: float = quantity('damping ratio zeta', high=1.0)

    def __post_init__(self) -> None:
        """Validate."""
        check_fields(self)

    @property
    def stiffness(self) -> float:
        """k = m omega_n^2, N/m."""
        return self.mass * self.natural_frequency**2

    @property
    def damping(self) -> float:
        """c = 2 zeta m omega_n, N s/m."""
        return 2.0 * self.damping_ratio * self.mass * self.natural_frequency


@dataclass(frozen=True)
class Machine:
    """What does not change while cutting: the two modes, the bearing and the material.

    `bearing_stiffness` None means the paper's k_bc = 0.5 k_wp.

    Raises:
        ParameterError: If a value is not finite or outside its limits.
    """

    tool: Mode = field(default_factory=lambda: Mode(0.05, 775.0, 0.05))
    workpiece: Mode = field(default_factory=lambda: Mode(0.05, 650.0, 0.05))
    bearing_stiffness: float = quantity(
        'stiffness k_bc of the bearing behind its clearance', 'N/m', default=None, high=1e12
    )
    cutting_coefficient: float = quantity(
        'cutting force coefficient C', 'N/m2', default=3.5e6, high=1e12
    )

    def __post_init__(self) -> None:
        """Validate, with the paper's bearing stiffness where none is given."""
        for name in ('tool', 'workpiece'):
            if not isinstance(getattr(self, name), Mode):
                raise ParameterError(name, getattr(self, name), '', 'a Mode')
        if self.bearing_stiffness is None:
            object.__setattr__(self, 'bearing_stiffness', 0.5 * self.workpiece.stiffness)
        check_fields(self)

    def cutting_stiffness(self, depth_of_cut: float) -> float:
        """C w, the force per metre of chip thickness, N/m."""
        return self.cutting_coefficient * depth_of_cut

    def workpiece_stiffness(self, *, seated: bool) -> float:
        """k_wp, plus k_bc where the workpiece rests on its bearing, N/m."""
        return self.workpiece.stiffness + (self.bearing_stiffness if seated else 0.0)

    def matrices(self, depth_of_cut: float, *, seated: bool) -> tuple[Array, Array, Array]:
        """A, B and d/gamma of x' = A x + B x(t - tau) + d, equations (5)-(7), (13) and (14).

        Args:
            depth_of_cut: w, m. With 0 the matrices are those of the tool out of the cut.
            seated: The screening function: whether the bearing carries.

        Returns:
            A (4, 4), B (4, 4) and d per metre of clearance (4,), in the order of the paper:
            tool displacement and velocity, workpiece displacement and velocity.
        """
        tool, workpiece = self.tool, self.workpiece
        on_tool = self.cutting_stiffness(depth_of_cut) / tool.mass
        on_workpiece = self.cutting_stiffness(depth_of_cut) / workpiece.mass
        bearing = self.bearing_stiffness / workpiece.mass if seated else 0.0
        a = np.zeros((4, 4))
        a[0, 1] = a[2, 3] = 1.0
        a[1] = [
            -(tool.natural_frequency**2) - on_tool,
            -2.0 * tool.damping_ratio * tool.natural_frequency,
            on_tool,
            0.0,
        ]
        a[3] = [
            on_workpiece,
            0.0,
            -(workpiece.natural_frequency**2) - bearing - on_workpiece,
            -2.0 * workpiece.damping_ratio * workpiece.natural_frequency,
        ]
        b = np.zeros((4, 4))
        b[1, 0], b[1, 2] = on_tool, -on_tool
        b[3, 0], b[3, 2] = -on_workpiece, on_workpiece
        return a, b, np.array([0.0, 0.0, 0.0, bearing])


@dataclass(frozen=True)
class Cut:
    """What an operator or a disturbance may change while the machine cuts.

    Raises:
        ParameterError: If a value is not finite or outside its limits.
    """

    spindle_speed_rpm: float = quantity(
        'spindle speed', 'rev/min', default=3000.0, low=60.0, high=30000.0
    )
    depth_of_cut: float = quantity('depth of cut w', 'm', default=0.0005, high=0.01)
    bearing_clearance: float = quantity('bearing clearance gamma', 'm', default=5e-6, high=0.001)
    bearing_contact: BearingContact = BearingContact.GAP
    feed_speed: float = quantity('feed speed', 'm/s', default=0.0025, high=0.1)
    force_noise: float = quantity(
        'random force on the tool: its mean over T s has the variance force_noise^2/T',
        'N/sqrt(Hz)',
        default=0.0,
        high=1e3,
    )
    sensor_noise: float = quantity(
        'noise of the measured displacements, rms per sample', 'm', default=0.0, high=1e-3
    )
    runout: float = quantity(
        'once-per-turn amplitude at the workpiece', 'm', default=0.0, high=1e-3
    )
    speed_variation_amplitude: float = quantity(
        'sinusoidal speed variation, fraction of the spindle speed', default=0.0, high=0.5
    )
    speed_variation_frequency: float = quantity(
        'frequency of the speed variation', 'Hz', default=1.0, high=1e3, exclusive=True
    )

    def __post_init__(self) -> None:
        """Validate."""
        check_fields(self)
        contact = check_choice('bearing_contact', self.bearing_contact, BearingContact)
        object.__setattr__(self, 'bearing_contact', contact)

    @property
    def delay(self) -> float:
        """The regenerative delay tau, one spindle turn at the mean speed, s."""
        return 60.0 / self.spindle_speed_rpm

    @property
    def feed(self) -> float:
        """Feed per revolution at the mean speed, m."""
        return self.feed_speed * self.delay

    def with_changes(self, **changes: Any) -> Cut:
        """The same cut with some fields changed.

        Raises:
            ParameterError: If a field does not exist or may not have its new value.
        """
        unknown = next((name for name in changes if name not in self.__dataclass_fields__), None)
        if unknown is not None:
            allowed = 'one of ' + ', '.join(self.__dataclass_fields__)
            raise ParameterError('the name of a changed value', unknown, '', allowed)
        return replace(self, **changes)


def paper_initial_state(cut: Cut) -> Array:
    """The paper's history at t = 0: both bodies displaced by f/1000 and moving with v (4,)."""
    return np.array([cut.feed / 1000.0, cut.feed_speed, cut.feed / 1000.0, cut.feed_speed])
