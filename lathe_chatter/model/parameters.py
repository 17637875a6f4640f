"""THE table of a lathe's parameters: everything that gives or shows one takes it from here.

`tool.mass` is the mass of the machine's tool, `depth_of_cut` a field of the cut: the names are
those of the node `lathe`, whether there is one or not. Units, limits and meanings stand once,
beside the fields of the model; the node's declarations, the options of the command line,
scenarios, recorded runs and the README are made from these rows.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import MISSING, fields, is_dataclass
from enum import Enum
from typing import Any, Protocol, TypeVar

from lathe_chatter.errors import ParameterError
from lathe_chatter.model.cut import Cut
from lathe_chatter.model.lathe_setup import SEED, LatheSetup
from lathe_chatter.model.machine import Machine
from lathe_chatter.model.parameter_table import ParameterTable, Row, Values, rows_of
from lathe_chatter.model.quantities import Quantity, limits_of

T = TypeVar('T')


def cut_from(values: Mapping[str, Any]) -> Cut:
    """The cut that parameters describe; what they leave out has its default.

    Raises:
        ParameterError: If a value is not allowed.
    """
    return _made_like(Cut(), values)


def machine_from(values: Mapping[str, Any]) -> Machine:
    """The machine that parameters describe; what they leave out has its default.

    Raises:
        ParameterError: If a value is not allowed.
    """
    return _made_like(Machine(), values)


def setup_from(values: Mapping[str, Any]) -> LatheSetup:
    """Machine, force law and sampling that parameters describe, defaults for the rest.

    Raises:
        ParameterError: If a value is not allowed.
    """
    own = {row.name: values[row.name] for row in SETUP_ROWS if row.name in values}
    return LatheSetup(machine_from(values), **own)


class HasParameters(Protocol):
    """A lathe, or how one is started."""

    @property
    def setup(self) -> LatheSetup:
        """What it keeps."""

    @property
    def cut(self) -> Cut:
        """What may change."""


def parameters_of(lathe: HasParameters) -> dict[str, Any]:
    """The parameters of a lathe as it stands, by name, with plain values."""
    setup, found = lathe.setup, dict[str, Any]()
    for owner, rows in ((lathe.cut, CUT_ROWS), (setup.machine, MACHINE_ROWS), (setup, SETUP_ROWS)):
        for row in rows:
            value: Any = owner
            for part in row.name.split('.'):
                value = getattr(value, part)
            found[row.name] = value.value if isinstance(value, Enum) else value
    return found


def samples_per_tick(sample_rate: float, tick_rate: float) -> int:
    """How many samples each tick has.

    Raises:
        ParameterError: If it is no whole number.
    """
    ratio = sample_rate / tick_rate
    count = round(ratio)
    if count < 1 or not math.isclose(ratio, count, rel_tol=1e-12):
        raise ParameterError(
            'sample_rate',
            sample_rate,
            'Hz',
            f'a whole multiple of tick_rate, which is {tick_rate:g} Hz',
        )
    return count


def derived_machine(given: Values) -> Values:
    """Without a stiffness of its own the bearing has the paper's, k_bc = 0.5 k_wp."""
    return {'bearing_stiffness': machine_from(given).bearing_stiffness}


def _derived_lathe(given: Values) -> Values:
    """The machine's derived values, once the two rates are known to agree."""
    rates = [float(given.get(name, LATHE[name].default)) for name in ('sample_rate', 'tick_rate')]  # type: ignore[arg-type]  # checked numbers
    samples_per_tick(*rates)
    return derived_machine(given)


def _made_like(usual: T, values: Mapping[str, Any], prefix: str = '') -> T:
    """A value of the model with the fields that are named, and defaults for the others."""
    given: dict[str, Any] = {}
    for entry in fields(usual):  # type: ignore[arg-type]  # a dataclass
        name, default = prefix + entry.name, getattr(usual, entry.name)
        if is_dataclass(default):
            given[entry.name] = _made_like(default, values, f'{name}.')
        elif name in values:
            given[entry.name] = values[name]
        elif entry.default is MISSING and entry.default_factory is MISSING:
            given[entry.name] = default
    try:
        return type(usual)(**given)
    except ParameterError as error:
        name = prefix + error.name
        raise ParameterError(name, error.value, error.unit, error.allowed) from None


def _setup_row(name: str) -> Row:
    """A number that a lathe is given at the start."""
    limits = limits_of(LatheSetup, name)
    return Row(name, getattr(LatheSetup(), name), limits.meaning, limits)


CUT_ROWS = tuple(rows_of(Cut(), run_time=True))
"""Of the cut: what may change at run time."""
MACHINE_ROWS = tuple(rows_of(Machine()))
"""Of the machine: a monitor has them too."""
SETUP_ROWS = (
    Row(
        'tool_leaves_cut',
        default=True,
        meaning='total chip force that vanishes out of the cut; false: the linear force (2)',
    ),
    _setup_row('spindle_acceleration'),
    _setup_row('sample_rate'),
    Row('seed', 0, SEED.meaning, SEED),
)
"""Of the force law and the sampling."""
_LEAVES_CUT, _ACCELERATION, _SAMPLE_RATE, _SEED = SETUP_ROWS

LATHE = ParameterTable(
    (
        *CUT_ROWS,
        Row(
            'real_time_factor',
            1.0,
            'simulated seconds per second; 0 is as fast as possible',
            Quantity('', low=0.01, high=100.0, or_zero=True),
            run_time=True,
            node_only=True,
        ),
        _LEAVES_CUT,
        *MACHINE_ROWS,
        _ACCELERATION,
        Row(
            'tick_rate',
            500.0,
            'rate of publication',
            Quantity('', 'Hz', low=1.0, high=5e3),
            node_only=True,
        ),
        _SAMPLE_RATE,
        _SEED,
        Row(
            'publish_clock',
            default=False,
            meaning='whether this node drives /clock',
            node_only=True,
        ),
        Row(
            'realtime_priority',
            1,
            'priority (SCHED_RR) to ask for, where permitted, while it keeps real time; 0: none',
            Quantity('', high=99.0),
            node_only=True,
        ),
        Row(
            'await_readers',
            0,
            'readers of ~/samples that the first tick waits for, unless ~/pause says otherwise',
            Quantity('', high=1000.0),
            node_only=True,
        ),
        Row(
            'record',
            '',
            'folder of a run that this node records by itself; empty: none',
            node_only=True,
        ),
    ),
    _derived_lathe,
)
"""Of a lathe, in the order in which they are shown."""
