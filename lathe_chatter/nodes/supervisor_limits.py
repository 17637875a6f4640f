"""The limits of a supervisor, and whether they suit the machine that it meets."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from lathe_chatter.model import Cut
from lathe_chatter.model.quantity_fields import limits_of
from lathe_chatter.supervisor import Limits


def limits_from(values: Mapping[str, Any]) -> Limits:
    """The limits among parameters.

    Raises:
        ParameterError: If they contradict each other.
    """
    return Limits(**{name: values[name] for name in Limits.__dataclass_fields__})


def unsuited(limits: Limits, cut: Cut, spindle: tuple[float, float] | None) -> Iterator[str]:
    """A sentence for each limit that the machine is beyond already.

    Args:
        limits: Of the supervisor.
        cut: As the lathe has it.
        spindle: Slowest and fastest speed by the machine file, rev/min; None where it tells none.
    """
    speeds = (*(spindle or ()), cut.spindle_speed_rpm)
    has = {
        'smallest_depth': cut.depth_of_cut,
        'smallest_feed': cut.feed,
        'slowest_speed': min(speeds),
        'fastest_speed': max(speeds),
    }
    for name, value in has.items():
        limit, unit = getattr(limits, name), limits_of(Limits, name).unit
        if value > limit if name == 'fastest_speed' else 0.0 < value < limit:
            yield (
                f'No move passes {name}, {limit:g} {unit}, though the lathe has {value:g} {unit}.'
            )
