"""The stability chart of a lathe as a page draws it, from the lathe's own parameters."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from lathe_chatter.model import Cut, Machine
from lathe_chatter.model.lathe_parameter_table import LATHE, cut_from, described_by, machine_from
from lathe_chatter.model.machine_file import MachineDescription
from lathe_chatter.page.versioned_values import finite
from lathe_chatter.report.probability_chart import interpolation_speeds
from lathe_chatter.report.stability_chart import (
    chart_limits,
    chart_speeds,
    speeds_of_lobes,
    top_of_chart,
    usual_speeds,
    with_room_for,
)
from lathe_chatter.stability.probability import stability_probability

LIMITS = ('depth_of_cut', 'open_limit', 'seated_limit', 'seating_line')
_PROBABILITIES = (0.95, 0.5, 0.05)
_OF_ITS_POINT = (
    'spindle_speed_rpm', 'depth_of_cut', 'speed_variation_amplitude', 'speed_variation_frequency',
)  # fmt: skip
_MATTERS = [
    row.name
    for row in LATHE
    if not row.only_samples and not row.node_only and row.name not in _OF_ITS_POINT
]
_MACHINES = 400
_TOO_WIDE = 1.1
"""Ratio of an end of a chart to where it may be, from which it is drawn anew."""


def chart_key(values: Mapping[str, Any]) -> dict[str, Any]:
    """What of a lathe's parameters its chart depends on."""
    return {name: values[name] for name in _MATTERS if name in values}


def fits(chart: Any, speeds: Iterable[float | None]) -> bool:
    """Whether a chart shows some speeds, rev/min, and is not wide for others that are gone.

    None is no speed; no chart, and one that could not be drawn, fit.
    """
    if not chart or 'speed' not in chart:
        return True
    known = [speed for speed in speeds if speed is not None]
    first, last = chart['speed'][0], chart['speed'][-1]
    low, high = with_room_for(chart['usual'], known)
    shown = all(first <= speed <= last for speed in known)
    return shown and last <= high * _TOO_WIDE and low <= first * _TOO_WIDE


def stability_chart(
    values: Mapping[str, Any], speeds: Iterable[float | None] = ()
) -> dict[str, Any]:
    """The chart of a lathe from its parameters, see `draw_chart`.

    Raises:
        LatheChatterError: If the parameters describe no machine.
    """
    known = {name: value for name, value in values.items() if value is not None}
    leaves = bool(known.get('tool_leaves_cut', True))
    described = described_by(known)
    return draw_chart(
        machine_from(known), cut_from(known), described, speeds, tool_leaves_cut=leaves
    )


def draw_chart(
    machine: Machine,
    cut: Cut,
    described: MachineDescription | None,
    more_speeds: Iterable[float | None] = (),
    *,
    tool_leaves_cut: bool,
) -> dict[str, Any]:
    """The limits over the speeds of a spindle, SI and rev/min; no limit is null.

    Where the machine is known with errors, the depths that are stable with some probabilities
    too.

    Args:
        machine: Tool, workpiece, bearing and material.
        cut: That is judged.
        described: The file of the machine, None where it has none.
        more_speeds: That have to be on it, rev/min, as one that is recommended; None is none.
        tool_leaves_cut: The force law, see `VirtualLathe`.
    """
    spindle = described.speed_range if described else None
    first, last = spindle or usual_speeds(machine, cut)
    beyond = [n for n in more_speeds if n is not None and not first <= n <= last]
    low, high = with_room_for((first, last), beyond)
    speeds = chart_speeds(low, high)
    limits = chart_limits(machine, cut, speeds, tool_leaves_cut=tool_leaves_cut)
    found: dict[str, Any] = {name: finite(getattr(limits, name)) for name in LIMITS}
    found['speed'] = limits.spindle_speed_rpm.tolist()
    found['usual'] = list(spindle or speeds_of_lobes(machine))
    found['contact'] = cut.bearing_contact.value
    found['top'] = top_of_chart(cut, limits)
    if described is not None and described.uncertainty:
        speeds = interpolation_speeds(limits)
        probable = stability_probability(
            machine, described.uncertainty, cut, speeds,
            machines=_MACHINES, tool_leaves_cut=tool_leaves_cut,
        )  # fmt: skip
        for share in _PROBABILITIES:
            depth = np.interp(found['speed'], speeds, probable.safe_depth(share))
            found[f'stable_{share:.0%}'] = finite(depth)
    return found
