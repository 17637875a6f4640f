"""The parameters of a lathe by their names, as scenarios, options and records have them.

The names are those of the node `lathe`: `depth_of_cut`, `tool.mass`, and so on. The node itself
declares them in nodes/parameters.py; this is the same without ROS.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields
from difflib import get_close_matches
from typing import Any

from lathe_chatter.errors import ParameterError
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.lathe.parameters import cut_from, machine_from, parameters_of
from lathe_chatter.lathe.setup import SEED, LatheSetup
from lathe_chatter.model import Cut, Machine, Mode
from lathe_chatter.model.quantities import Quantity, quantity_of

_MODES = ('tool', 'workpiece')
_MACHINE = ('bearing_stiffness', 'cutting_coefficient')
_OWN = ('sample_rate', 'tool_leaves_cut', 'spindle_acceleration', 'seed')
"""Parameters of the lathe that are neither of its machine nor of its cut."""


@dataclass(frozen=True)
class Start:
    """A lathe as it is started: what it keeps, and what it cuts first.

    Attributes:
        setup: Machine, force law and sampling.
        cut: What is cut at the start.
    """

    setup: LatheSetup = field(default_factory=LatheSetup)
    cut: Cut = field(default_factory=Cut)

    @property
    def machine(self) -> Machine:
        """Tool, workpiece, bearing and material."""
        return self.setup.machine

    def lathe(self) -> VirtualLathe:
        """A lathe that is started like this."""
        values = {entry.name: getattr(self.setup, entry.name) for entry in fields(LatheSetup)}
        return VirtualLathe(cut=self.cut, **values)

    def parameters(self) -> dict[str, Any]:
        """Every parameter by its name, as `start_from` takes them."""
        return parameters_of(self.lathe())


def parameter_names() -> Iterator[tuple[str, Quantity | None]]:
    """Every name that a setup knows, with its unit and limits where it is a number."""
    for entry in fields(Cut):
        yield entry.name, quantity_of(entry)
    for mode in _MODES:
        for entry in fields(Mode):
            yield f'{mode}.{entry.name}', quantity_of(entry)
    for owner, names in ((Machine, _MACHINE), (LatheSetup, _OWN)):
        for name in names:
            limits = SEED if name == 'seed' else quantity_of(owner.__dataclass_fields__[name])
            yield name, limits


def start_from(values: Mapping[str, Any]) -> Start:
    """A start with some parameters given by name and the usual values for the rest.

    Raises:
        ParameterError: If a name is unknown or a value not allowed.
    """
    known = [name for name, _ in parameter_names()]
    for name in values:
        if name not in known:
            near = get_close_matches(name, known, n=1)
            hint = f', perhaps {near[0]}' if near else ''
            allowed = f'one of the parameters of a lathe{hint}'
            raise ParameterError('the name of a parameter', name, '', allowed)
    own = {name: values[name] for name in _OWN if name in values}
    seed = own.get('seed')
    if isinstance(seed, float) and seed.is_integer():
        own['seed'] = int(seed)
    return Start(LatheSetup(machine_from(values), **own), cut_from(values))
