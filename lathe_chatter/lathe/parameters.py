"""A lathe by the names of its parameters, as nodes, scenarios and recorded runs have them.

`tool.mass` is the mass of the tool, `depth_of_cut` a field of the cut: the names are those of
the node `lathe`, whether there is one or not.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from enum import Enum
from typing import Any

from lathe_chatter.errors import ParameterError
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.model import Cut, Machine, Mode

_MODES = ('tool', 'workpiece')
_PLAIN = ('bearing_stiffness', 'cutting_coefficient')
_OF_THE_LATHE = ('sample_rate', 'tool_leaves_cut', 'spindle_acceleration', 'seed')


def cut_from(values: Mapping[str, Any]) -> Cut:
    """The cut that parameters describe; what they leave out has its default.

    Raises:
        ParameterError: If a value is not allowed.
    """
    return Cut(**{n: values[n] for n in Cut.__dataclass_fields__ if n in values})


def machine_from(values: Mapping[str, Any]) -> Machine:
    """The machine that parameters describe; what they leave out has its default.

    Raises:
        ParameterError: If a value is not allowed.
    """
    usual = Machine()

    def mode(part: str) -> Mode:
        default = getattr(usual, part)
        names = [entry.name for entry in fields(Mode)]
        try:
            return Mode(**{n: values.get(f'{part}.{n}', getattr(default, n)) for n in names})
        except ParameterError as error:
            name = f'{part}.{error.name}'
            raise ParameterError(name, error.value, error.unit, error.allowed) from None

    given = {name: values[name] for name in _PLAIN if name in values}
    return Machine(tool=mode('tool'), workpiece=mode('workpiece'), **given)


def lathe_from(values: Mapping[str, Any]) -> VirtualLathe:
    """The lathe that parameters describe, at time zero; what they leave out has its default.

    Raises:
        ParameterError: If a value is not allowed.
    """
    given = {name: values[name] for name in _OF_THE_LATHE if name in values}
    return VirtualLathe(machine_from(values), cut_from(values), **given)


def parameters_of(lathe: VirtualLathe) -> dict[str, Any]:
    """The parameters of a lathe as it stands, by name, with plain values."""
    machine = lathe.machine
    return {
        **{name: _plain(getattr(lathe.cut, name)) for name in Cut.__dataclass_fields__},
        **{
            f'{part}.{entry.name}': getattr(getattr(machine, part), entry.name)
            for part in _MODES
            for entry in fields(Mode)
        },
        **{name: getattr(machine, name) for name in _PLAIN},
        **{name: getattr(lathe.setup, name) for name in _OF_THE_LATHE},
    }


def _plain(value: Any) -> Any:
    return value.value if isinstance(value, Enum) else value
