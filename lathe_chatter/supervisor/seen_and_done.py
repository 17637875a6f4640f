"""What a supervisor sees, what it does, and how far it goes: `Seen`, `Action` and `Mode`."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum

from lathe_chatter.model import Cut
from lathe_chatter.supervisor.vibration import SETTLING

ASKS = '~/accept does it'
"""In the sentence of a supervisor that asks."""
NO_MACHINE = 'no machine is known, or the monitor works without it'
"""Why nothing can be done, as the end of a sentence."""


class Mode(str, Enum):
    """Whether it only says what it would do, waits for `~/accept`, or acts."""

    SHADOW = 'shadow'
    ASK = 'ask'
    ACT = 'act'


@dataclass(frozen=True)
class Seen:
    """What is known at a time; nan where something is not.

    Attributes:
        time: Of a clock that nobody sets, s.
        cut: As the lathe has it.
        chatter: The monitor's flag.
        growth_rate: 1/s.
        frequency: Hz.
        amplitude: Of the tool, m.
        margin: By what fraction the depth may grow.
        cutting_stiffness: C w as the monitor identified it, N/m.
        tool_frequency: That the monitor has put in the place of the told one, Hz.
        spindle_acceleration: At which the spindle follows a change, rev/min per s; 0: at once.
        lasted: s that the newest change of the cut has been in force at least, by the wall's clock
            and by the lathe's.
        hindrance: Why nothing may be done, as the end of a sentence; empty where it may.
        judged: Whether the monitor knows what the cut does; else a flag that falls tells nothing.
        flag_stays: Whether the flag is as it was, asked once a move has been found: to look for
            one takes up to a second.
    """

    time: float
    cut: Cut
    chatter: bool = False
    growth_rate: float = math.nan
    frequency: float = math.nan
    amplitude: float = math.nan
    margin: float = math.nan
    cutting_stiffness: float = math.nan
    tool_frequency: float = math.nan
    spindle_acceleration: float = 0.0
    lasted: float = math.inf
    hindrance: str = ''
    judged: bool = True
    flag_stays: Callable[[], bool] = field(default=lambda: True, compare=False)


@dataclass(frozen=True)
class Action:
    """What is said, and what is done.

    Attributes:
        sentence: For people; empty for a step of a ramp.
        changes: Parameters of the lathe to set together.
        stop: Whether the lathe is to be paused.
        settling: s after which it can be judged.
    """

    sentence: str = ''
    changes: Mapping[str, float] = field(default_factory=dict)
    stop: bool = False
    settling: float = SETTLING
