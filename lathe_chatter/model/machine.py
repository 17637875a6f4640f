"""The machine: equations (1)-(14) of the paper as frozen values in SI.

A tool and a workpiece-spindle, each one mode, are coupled by the cutting force; the workpiece
may rest on its bearing across a clearance:

    m_t  x_t''  + c_t  x_t'  + k_t  x_t                            + F = 0        (8a)
    m_wp x_wp'' + c_wp x_wp' + k_wp x_wp + s k_bc (x_wp - gamma)   - F = 0        (8b)
    F = C w [r(t) - r(t - tau)],   r = x_t - x_wp                                 (2)

with the screening function s = 1 while x_wp >= gamma (9). The delay enters through the scalar r
alone, which is why a lathe needs to remember one signal and not its whole state.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from lathe_chatter.arrays import Array
from lathe_chatter.errors import ParameterError
from lathe_chatter.model.quantities import check_fields, quantity


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

    def _repr_html_(self) -> str:
        """As a notebook shows it."""
        from lathe_chatter.model.parameter_table import html_of

        return html_of(self)
