"""What the detector says: the state of the cut and the figures that explain it."""

from __future__ import annotations

import math
from dataclasses import dataclass

IDLE, STABLE, WATCH, CHATTER, FORCED, UNKNOWN = (
    'idle',
    'stable',
    'watch',
    'chatter',
    'forced',
    'unknown',
)
STATES = (IDLE, STABLE, WATCH, CHATTER, FORCED, UNKNOWN)


@dataclass(frozen=True)
class Estimate:
    """The detector's knowledge after a sample; nan or None where something is not known.

    Attributes:
        time: Of the newest sample taken into account, s.
        state: `idle` (the spindle stands or nothing is cut), `stable`, `watch` (chatter is
            suspected), `chatter`, `forced` (vibration, but the spindle's own), or `unknown`
            (too little data, a ramp, a gap).
        chatter: The alarm; it stays until the chatter has died out.
        growth_rate: Real part of the rightmost root of the identified cut, 1/s.
        growth_rate_error: Its standard error, 1/s.
        frequency: Of the chatter, or of the least damped vibration, Hz.
        amplitude: Of the tool's vibration in the band that is not the spindle's own, m.
        cutting_stiffness: C w, N/m.
        workpiece_stiffness: What carries the workpiece: k_wp, up to k_wp + k_bc, N/m.
        bearing_engaged: Whether the workpiece rests on its bearing, at least in part.
        recommended_speed_rpm: A spindle speed at which the cut would be stable, rev/min.
    """

    time: float = math.nan
    state: str = UNKNOWN
    chatter: bool = False
    growth_rate: float = math.nan
    growth_rate_error: float = math.nan
    frequency: float = math.nan
    amplitude: float = math.nan
    cutting_stiffness: float = math.nan
    workpiece_stiffness: float = math.nan
    bearing_engaged: bool | None = None
    recommended_speed_rpm: float = math.nan
