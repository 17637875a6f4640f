"""`LatheConfig`: a lathe as it is started, from its parameters by name and back to them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import TYPE_CHECKING, Any

from lathe_chatter.errors import ParameterError
from lathe_chatter.model import Cut, Machine
from lathe_chatter.model.lathe_parameter_table import (
    LATHE,
    MACHINE_FILE,
    cut_from,
    described_by,
    parameters_of,
    setup_from,
)
from lathe_chatter.model.machine_and_sampling import LatheSetup
from lathe_chatter.model.machine_file import MachineDescription

if TYPE_CHECKING:
    from lathe_chatter.lathe.virtual_lathe import VirtualLathe


@dataclass(frozen=True)
class LatheConfig:
    """A lathe as it is started: what it keeps, and what it cuts first.

    Attributes:
        setup: Machine, force law and sampling.
        cut: What is cut at the start.
        described: The machine file that was given: it says more than a lathe needs.
    """

    setup: LatheSetup = field(default_factory=LatheSetup)
    cut: Cut = field(default_factory=Cut)
    described: MachineDescription | None = field(default=None, compare=False)

    @property
    def machine(self) -> Machine:
        """Tool, workpiece, bearing and material."""
        return self.setup.machine

    @property
    def description(self) -> MachineDescription:
        """The machine as a machine file has it."""
        return replace(self.described or MachineDescription(), machine=self.machine)

    def lathe(self) -> VirtualLathe:
        """A lathe that is started like this."""
        from lathe_chatter.lathe.virtual_lathe import VirtualLathe  # loads Numba, wanted only here

        values = {entry.name: getattr(self.setup, entry.name) for entry in fields(LatheSetup)}
        return VirtualLathe(cut=self.cut, **values)

    def parameters(self) -> dict[str, Any]:
        """Every parameter by its name, as `config_from` takes them."""
        found = parameters_of(self)
        if self.described is not None:
            found[MACHINE_FILE.name] = self.description.text()
        return found


def config_from(values: Mapping[str, Any]) -> LatheConfig:
    """A lathe with some parameters given by name and the usual values for the rest.

    What means something to a node alone (`tick_rate`) is passed over.

    Raises:
        ParameterError: If a name is unknown or a value not allowed.
    """
    for name in values:
        if name not in LATHE:
            near = LATHE.nearest(name)
            allowed = f'one of the parameters of a lathe{f", perhaps {near}" if near else ""}'
            raise ParameterError('the name of a parameter', name, '', allowed)
    return recorded_config(values)


def recorded_config(values: Mapping[str, Any]) -> LatheConfig:
    """The same from what a node said of itself, whatever else it has.

    Raises:
        ParameterError: If a value is not allowed.
    """
    return LatheConfig(setup_from(values), cut_from(values), described_by(values))
