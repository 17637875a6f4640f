"""The parameters of a lathe by their names, as scenarios, options and records have them.

The names are those of the node `lathe`: `depth_of_cut`, `tool.mass`, and so on. The node itself
declares them in nodes/parameters.py; this is the same without ROS.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from difflib import get_close_matches
from typing import Any

from lathe_chatter.errors import ParameterError
from lathe_chatter.lathe import SAMPLE_RATE, SEED, SPINDLE_ACCELERATION, VirtualLathe
from lathe_chatter.model import Cut, Machine, Mode
from lathe_chatter.quantities import Quantity, quantity_of

_MODES = ('tool', 'workpiece')
_LATHE: dict[str, Quantity] = {
    'sample_rate': SAMPLE_RATE,
    'spindle_acceleration': SPINDLE_ACCELERATION,
    'seed': SEED,
}
"""Numbers of the lathe that are neither of its machine nor of its cut."""


@dataclass(frozen=True)
class Setup:
    """A machine and what it cuts, as a lathe is started with them.

    Attributes:
        machine: Tool, workpiece, bearing and material.
        cut: What is cut at the start.
        tool_leaves_cut: The force law, see `VirtualLathe`.
        spindle_acceleration: rev/min per s; 0 for a step.
        sample_rate: Hz.
        seed: Of every random number.
    """

    machine: Machine = field(default_factory=Machine)
    cut: Cut = field(default_factory=Cut)
    tool_leaves_cut: bool = True
    spindle_acceleration: float = 0.0
    sample_rate: float = 1e4
    seed: int = 0

    def lathe(self) -> VirtualLathe:
        """A lathe that is set up like this.

        Raises:
            ParameterError: If a value is not allowed.
        """
        return VirtualLathe(
            self.machine,
            self.cut,
            sample_rate=self.sample_rate,
            tool_leaves_cut=self.tool_leaves_cut,
            spindle_acceleration=self.spindle_acceleration,
            seed=self.seed,
        )

    def parameters(self) -> dict[str, Any]:
        """Every parameter by its name, as `setup_from` takes them."""
        found: dict[str, Any] = {}
        for entry in fields(Cut):
            value = getattr(self.cut, entry.name)
            found[entry.name] = getattr(value, 'value', value)
        for mode in _MODES:
            part = getattr(self.machine, mode)
            found |= {f'{mode}.{e.name}': getattr(part, e.name) for e in fields(Mode)}
        found |= {
            e.name: getattr(self.machine, e.name) for e in fields(Machine) if e.name not in _MODES
        }
        return found | {e.name: getattr(self, e.name) for e in fields(self) if e.name in _OWN}


_OWN = ('tool_leaves_cut', *_LATHE)


def parameter_names() -> Iterator[tuple[str, Quantity | None]]:
    """Every name that a setup knows, with its unit and limits where it is a number."""
    for entry in fields(Cut):
        yield entry.name, quantity_of(entry)
    for mode in _MODES:
        for entry in fields(Mode):
            yield f'{mode}.{entry.name}', quantity_of(entry)
    for entry in fields(Machine):
        if not is_dataclass(getattr(Machine(), entry.name)):
            yield entry.name, quantity_of(entry)
    yield 'tool_leaves_cut', None
    yield from _LATHE.items()


def setup_from(values: Mapping[str, Any]) -> Setup:
    """The setup with some parameters given by name and the usual values for the rest.

    Raises:
        ParameterError: If a name is unknown or a value not allowed.
    """
    known = [name for name, _ in parameter_names()]
    for name in values:
        if name not in known:
            near = get_close_matches(name, known, n=1)
            hint = f'one of the parameters of a lathe{(near and f", perhaps {near[0]}") or ""}'
            raise ParameterError('the name of a parameter', name, '', hint)
    return Setup(
        machine_from(values),
        Cut(**{e.name: values[e.name] for e in fields(Cut) if e.name in values}),
        **{name: _own(name, values[name]) for name in _OWN if name in values},
    )


def machine_from(values: Mapping[str, Any]) -> Machine:
    """The machine among parameters by name; other names are passed over.

    Raises:
        ParameterError: If a value is not allowed.
    """
    usual = Machine()

    def mode(part: str) -> Mode:
        own = getattr(usual, part)
        names = [entry.name for entry in fields(Mode)]
        try:
            return Mode(**{n: values.get(f'{part}.{n}', getattr(own, n)) for n in names})
        except ParameterError as error:
            raise ParameterError(
                f'{part}.{error.name}', error.value, error.unit, error.allowed
            ) from None

    plain = ('bearing_stiffness', 'cutting_coefficient')
    return Machine(
        tool=mode('tool'),
        workpiece=mode('workpiece'),
        **{name: values[name] for name in plain if name in values},
    )


def _own(name: str, value: Any) -> Any:
    """A parameter of the lathe itself, checked."""
    if name == 'tool_leaves_cut':
        if not isinstance(value, bool):
            raise ParameterError(name, value, '', 'true or false')
        return value
    number = _LATHE[name].check(name, value)
    if name == 'seed':
        if number != int(number):
            raise ParameterError(name, value, '', 'a whole number')
        return int(number)
    return number
