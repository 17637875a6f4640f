"""THE table of a lathe's parameters: everything that gives or shows one takes it from here.

`tool.mass` is the mass of the machine's tool, `depth_of_cut` a field of the cut: the names are
those of the node `lathe`, whether there is one or not. Units, limits and meanings stand once,
beside the fields of the model; the node's declarations, the options of the command line,
scenarios, recorded runs and the documentation are made from these rows.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import MISSING, fields, is_dataclass, replace
from enum import Enum
from typing import Any, Protocol, TypeVar

from lathe_chatter.errors import ParameterError
from lathe_chatter.model.cut import BearingContact, Cut
from lathe_chatter.model.machine import Body, Machine, Structure
from lathe_chatter.model.machine_and_sampling import SEED, LatheSetup
from lathe_chatter.model.machine_file import MachineDescription, load_machine
from lathe_chatter.model.parameter_table import ParameterTable, Resolved, Row, Values, rows_of
from lathe_chatter.model.quantity_fields import Quantity, limits_of

T = TypeVar('T')

_SAMPLES_A_PERIOD = 10.0
"""Of the highest mode of a machine file, at least."""


def cut_from(values: Mapping[str, Any]) -> Cut:
    """The cut that parameters describe; what they leave out is the machine file's, or default.

    Raises:
        ParameterError: If a value is not allowed.
        MachineFileError: If the parameter `machine` is no machine.
    """
    described = described_by(values)
    usual = described.cut if described else Cut()
    if 'feed_speed' in values:  # given beside a file whose feed is per revolution, it rules
        usual = usual.with_changes(feed_per_revolution=0.0)
    return _made_like(usual, values, complete=bool(described))


def machine_from(values: Mapping[str, Any]) -> Machine:
    """The machine that parameters describe; what they leave out is the machine file's, or default.

    Raises:
        ParameterError: If a value is not allowed, or names the one mode of a body that has more.
        MachineFileError: If the parameter `machine` is no machine.
    """
    described = described_by(values)
    if described is None:
        return _made_like(Machine(), values)
    for row in MACHINE_ROWS:
        part = row.name.rpartition('.')[0]
        if part and row.name in values and len(getattr(described.machine, part).modes) > 1:
            allowed = f'left to the machine file, in which the {part} has several modes'
            raise ParameterError(row.name, values[row.name], row.unit, allowed)
    return _made_like(described.machine, values, complete=True)


def machine_in_cut(values: Mapping[str, Any]) -> Machine:
    """The same as a detector may identify it: without the bearing that a machine file has not.

    Raises:
        ParameterError: As `machine_from`.
        MachineFileError: As `machine_from`.
    """
    machine, described = machine_from(values), described_by(values)
    if described is None or described.cut.bearing_contact is not BearingContact.NONE:
        return machine
    contact = values.get('bearing_contact', BearingContact.NONE)
    return machine if contact != BearingContact.NONE else replace(machine, bearing_stiffness=0.0)


def setup_from(values: Mapping[str, Any]) -> LatheSetup:
    """Machine, force law and sampling that parameters describe, defaults for the rest.

    Raises:
        ParameterError: If a value is not allowed.
        MachineFileError: If the parameter `machine` is no machine.
    """
    own = {row.name: values[row.name] for row in SETUP_ROWS if row.name in values}
    described = described_by(values)
    machine = machine_from(values)
    if described is not None:
        own.setdefault('spindle_acceleration', described.spindle_acceleration)
        own.setdefault('sample_rate', _rate_for(machine))
    return LatheSetup(machine, **own)


def _rate_for(machine: Machine) -> float:
    """The usual sample rate, or what the highest mode of a machine needs, Hz."""
    modes = (*machine.tool.modes, *machine.workpiece.modes)
    highest = max(mode.natural_frequency for mode in modes) / (2.0 * math.pi)
    limits = limits_of(LatheSetup, 'sample_rate')
    needed = 1e3 * math.ceil(_SAMPLES_A_PERIOD * highest / 1e3)
    return min(max(LatheSetup().sample_rate, needed), limits.high)


def described_by(values: Mapping[str, Any]) -> MachineDescription | None:
    """What the machine file among some parameters holds, None where there is none.

    Raises:
        MachineFileError: If the parameter `machine` is no machine.
    """
    source = values.get(MACHINE_FILE.name)
    return load_machine(source) if source else None


def checked_parameters(values: Mapping[str, Any]) -> dict[str, Any]:
    """Those of some values that are parameters of a lathe, as it can have them.

    Raises:
        ParameterError: If it cannot.
    """
    return {name: LATHE[name].check(value) for name, value in values.items() if name in LATHE}


def feed_refusal(given: Mapping[str, Any], present: Mapping[str, Any]) -> str:
    """Why a change of the feed would have no effect, a sentence; empty where it has one.

    Args:
        given: What changes together.
        present: What holds until then, `feed_speed` and `feed_per_revolution` at least.
    """
    feed, speed = present['feed_per_revolution'], given.get('feed_speed')
    if not feed or speed in {None, present['feed_speed']} or 'feed_per_revolution' in given:
        return ''
    return (
        f'feed_speed is {speed:g} m/s, and feed_per_revolution, {feed:g} m/rev, rules: give '
        'feed_per_revolution 0 with it, or another one.'
    )


def pace_refusal(given: Mapping[str, Any], present: Mapping[str, Any]) -> str:
    """Why a lathe that follows /clock takes no other pace, or nothing; as `feed_refusal`."""
    if given.get('real_time_factor') in {None, present['real_time_factor']}:
        return ''
    return 'real_time_factor has no effect under use_sim_time: the pace is that of /clock.'


class HasParameters(Protocol):
    """A lathe, or how one is started."""

    @property
    def setup(self) -> LatheSetup:
        """What it keeps."""

    @property
    def cut(self) -> Cut:
        """What may change."""


def parameters_of(lathe: HasParameters) -> dict[str, Any]:
    """The parameters of a lathe as it stands, by name, with plain values.

    A machine that takes more than these names to tell is there as the text of its file, under
    `machine`, without the names that it has no single value for.
    """
    setup = lathe.setup
    bodies = (setup.machine.tool, setup.machine.workpiece)
    described = any(_needs_file(body) for body in bodies)
    text = MachineDescription(setup.machine, lathe.cut).text() if described else ''
    return {
        MACHINE_FILE.name: text,
        **_values(CUT_ROWS, lathe.cut),
        **_values(MACHINE_ROWS, setup.machine),
        **_values(SETUP_ROWS, setup),
    }


def _values(rows: Iterable[Row], owner: Any) -> dict[str, Any]:
    """What parameters have in a value of the model, without those of a body with several modes."""
    found = dict[str, Any]()
    for row in rows:
        value = owner
        *parts, name = row.name.split('.')
        for part in parts:
            value = getattr(value, part)
        if not isinstance(value, Structure):
            value = getattr(value, name)
            found[row.name] = value.value if isinstance(value, Enum) else value
    return found


def _needs_file(body: Body) -> bool:
    mode = body.modes[0]
    return len(body.modes) > 1 or (mode.chip, mode.force, mode.bearing) != (1.0, 1.0, 1.0)


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


def derived_machine(given: Values) -> Resolved:
    """What follows from the parameters of a machine that were given.

    Without a stiffness of its own the bearing has the paper's, k_bc = 0.5 k_wp. With a machine
    file its text, so that a record and a monitor have it too, and all that it says; the names
    that it has no single value for are None.
    """
    machine = machine_from(given)
    described = described_by(given)
    if described is None:
        return {'bearing_stiffness': machine.bearing_stiffness}
    found: dict[str, Any] = dict.fromkeys(row.name for row in MACHINE_ROWS)
    text = replace(described, machine=machine).text()
    return {**found, **_values(MACHINE_ROWS, machine), MACHINE_FILE.name: text}


def _derived_lathe(given: Values) -> Resolved:
    """The machine's and the cut's derived values, once the two rates are known to agree."""
    setup = setup_from(given)
    samples_per_tick(setup.sample_rate, float(given.get('tick_rate', LATHE['tick_rate'].default)))  # type: ignore[arg-type]  # checked numbers
    if not given.get(MACHINE_FILE.name):
        return derived_machine(given)
    found = _values(CUT_ROWS, cut_from(given)) | _values(SETUP_ROWS, setup)
    return {**derived_machine(given), **{name: found[name] for name in OF_A_MACHINE_FILE}}


def _made_like(
    usual: T, values: Mapping[str, Any], prefix: str = '', *, complete: bool = False
) -> T:
    """A value of the model with the fields that are named.

    Args:
        usual: Where the others come from.
        values: By name.
        prefix: Of the names.
        complete: Whether the others are as in `usual`, and not as by default.
    """
    given: dict[str, Any] = {}
    for entry in fields(usual):  # type: ignore[arg-type]  # a dataclass
        name, default = prefix + entry.name, getattr(usual, entry.name)
        if is_dataclass(default):
            given[entry.name] = _made_like(default, values, f'{name}.', complete=complete)
        elif name in values:
            given[entry.name] = values[name]
        elif complete or (entry.default is MISSING and entry.default_factory is MISSING):
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


MACHINE_FILE = Row(
    'machine',
    '',
    'machine file: its path, the name of one that is shipped, or its text; parameters given '
    'beside it win',
)
"""For machines that take more than one mode to tell, and for all others."""
CUT_ROWS = tuple(rows_of(Cut(), run_time=True))
"""Of the cut: what may change at run time."""
OF_A_MACHINE_FILE = (*(row.name for row in CUT_ROWS), 'spindle_acceleration', 'sample_rate')
"""Parameters besides those of the machine that a machine file may decide."""
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
    Row(
        'accelerometers',
        default=False,
        meaning='whether the samples have the accelerations of tool and workpiece too',
        of_samples=True,
    ),
)
"""Of the force law and the sampling."""
_LEAVES_CUT, _ACCELERATION, _SAMPLE_RATE, _SEED, _ACCELEROMETERS = SETUP_ROWS

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
        MACHINE_FILE,
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
        _ACCELEROMETERS,
        Row(
            'publish_clock',
            default=False,
            meaning='whether this node drives /clock',
            node_only=True,
        ),
        Row(
            'clock_catch_up',
            5.0,
            'under use_sim_time: how late behind /clock is made up; beyond it time is not cut',
            Quantity('', 's', low=0.1, high=3600.0),
            run_time=True,
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
