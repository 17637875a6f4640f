"""What a virtual lathe is given at the start and keeps: the machine, and how it is integrated."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from lathe_chatter.errors import ParameterError
from lathe_chatter.model.machine import Machine
from lathe_chatter.model.quantity_fields import Quantity, check_fields, quantity

SEED = Quantity('seed of every random number', high=2.0**31 - 1.0, only_samples=True)


@dataclass(frozen=True)
class LatheSetup:
    """Machine, force law and sampling of a lathe.

    Attributes:
        machine: Tool, workpiece, bearing and material.
        sample_rate: Samples per simulated second, Hz.
        tool_leaves_cut: The total force C w max(h, 0), or the paper's linear one about the mean.
        spindle_acceleration: At which the speed follows a change, rev/min per s; 0 for a step.
        seed: Of force noise and sensor noise.
        displacement_limit: The run ends when a displacement passes it, m.
        accelerometers: Whether the samples have the accelerations of tool and workpiece too.

    Raises:
        ParameterError: If a value is not allowed.
    """

    machine: Machine = field(default_factory=Machine)
    sample_rate: float = quantity(
        'samples per simulated second',
        'Hz',
        default=1e4,
        low=10.0,
        high=1e6,
        only_samples=True,
    )
    tool_leaves_cut: bool = True
    spindle_acceleration: float = quantity(
        'rate of change of the spindle speed, 0 for a step',
        'rev/min per s',
        default=0.0,
        high=1e6,
        only_samples=True,
    )
    seed: int = 0
    displacement_limit: float = quantity(
        'displacement beyond which a run ends', 'm', default=1.0, high=1e12, exclusive=True
    )
    accelerometers: bool = False

    def __post_init__(self) -> None:
        """Validate."""
        check_fields(self)
        if not isinstance(self.machine, Machine):
            raise ParameterError('machine', self.machine, '', 'a Machine')
        for name in ('tool_leaves_cut', 'accelerometers'):
            value = getattr(self, name)
            if not isinstance(value, (bool, np.bool_)):
                raise ParameterError(name, value, '', 'True or False')
            object.__setattr__(self, name, bool(value))
        if isinstance(self.seed, bool) or not isinstance(self.seed, (int, np.integer)):
            raise ParameterError('seed', self.seed, '', 'a whole number')
        object.__setattr__(self, 'seed', int(SEED.check('seed', self.seed)))
