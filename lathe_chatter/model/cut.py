"""The cut: what an operator or a disturbance may change while the machine cuts."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from typing import Any

import numpy as np

from lathe_chatter.array_types import Array
from lathe_chatter.errors import ParameterError
from lathe_chatter.model.quantity_fields import check_choice, check_fields, quantity


class BearingContact(str, Enum):
    """None: no bearing; gap: beyond its clearance; seated: always on it; both_sides: on either.

    docs/explanation/model.md has the paper's equations.
    """

    NONE = 'none'
    """No bearing in the model, equations (1)-(7)."""
    GAP = 'gap'
    """Equation (9) as printed: the bearing engages while x_wp >= gamma."""
    SEATED = 'seated'
    """The screening function is 1 throughout: the workpiece-spindle rests on its bearing."""
    BOTH_SIDES = 'both_sides'
    """The bearing engages beyond the clearance on either side, abs(x_wp) >= gamma."""


@dataclass(frozen=True)
class Cut:
    """What an operator or a disturbance may change while the machine cuts.

    Raises:
        ParameterError: If a value is not finite or outside its limits.
    """

    spindle_speed_rpm: float = quantity(
        'spindle speed', 'rev/min', default=3000.0, low=1.0, high=1e5
    )
    depth_of_cut: float = quantity('depth of cut w', 'm', default=0.0005, high=0.1)
    bearing_clearance: float = quantity('bearing clearance gamma', 'm', default=5e-6, high=0.001)
    bearing_contact: BearingContact = BearingContact.GAP
    feed_speed: float = quantity('feed speed', 'm/s', default=0.0025, high=0.1)
    feed_per_revolution: float = quantity(
        'feed per revolution, with which the feed follows the spindle; 0: the feed speed holds',
        'm/rev',
        default=0.0,
        high=0.01,
    )
    process_damping: float = quantity(
        'C_pd of a damping force C_pd (w/V) r_dot, V the surface speed',
        'N/m',
        default=0.0,
        high=1e9,
    )
    workpiece_diameter: float = quantity(
        'diameter that is turned, for its surface speed', 'm', default=0.05, low=1e-4, high=10.0
    )
    unbalance: float = quantity(
        'unbalance U on the workpiece: a force U Omega^2 once a turn',
        'kg m',
        default=0.0,
        high=10.0,
        only_samples=True,
    )
    force_noise: float = quantity(
        'random force on the tool, two-sided: its mean over T s has the variance force_noise^2/T, '
        'and a spectrum of positive frequencies alone shows sqrt(2) times it',
        'N/sqrt(Hz)',
        default=0.0,
        high=1e3,
        only_samples=True,
    )
    cutting_force_noise: float = quantity(
        'random part of the cutting force, on tool and workpiece, measured like force_noise',
        'N/sqrt(Hz)',
        default=0.0,
        high=1e3,
        only_samples=True,
    )
    sensor_noise: float = quantity(
        'noise of the measured displacements, rms per sample',
        'm',
        default=0.0,
        high=1e-3,
        only_samples=True,
    )
    acceleration_noise: float = quantity(
        'noise of the measured accelerations, rms per sample',
        'm/s2',
        default=0.0,
        high=1e4,
        only_samples=True,
    )
    runout: float = quantity(
        'once-per-turn amplitude at the workpiece',
        'm',
        default=0.0,
        high=1e-3,
        only_samples=True,
    )
    tool_runout: float = quantity(
        "once-per-turn amplitude that the tool's sensor sees",
        'm',
        default=0.0,
        high=1e-3,
        only_samples=True,
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
        return self.feed_per_revolution or self.feed_speed * self.delay

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

    def _repr_html_(self) -> str:
        """As a notebook shows it."""
        from lathe_chatter.model.parameter_table import html_of

        return html_of(self)


def paper_initial_state(cut: Cut) -> Array:
    """The paper's history at t = 0: both bodies displaced by f/1000 and moving with v (4,)."""
    speed = cut.feed / cut.delay if cut.feed_per_revolution else cut.feed_speed
    return np.array([cut.feed / 1000.0, speed, cut.feed / 1000.0, speed])
