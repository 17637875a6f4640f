"""The parameters of the nodes: one table each, from which everything about them is made.

Names, defaults, units, limits and meanings of the machine and the cut stand once, beside the
fields of the model; what only a node has is added here. Descriptors, declarations, validation,
the sentence of a refusal and the tables of the README come from these rows.
"""

from __future__ import annotations

import math
from enum import Enum

from lathe_chatter.errors import ParameterError
from lathe_chatter.lathe.parameters import machine_from
from lathe_chatter.lathe.setup import SEED, LatheSetup
from lathe_chatter.model import Cut, Machine
from lathe_chatter.model.quantities import Quantity, limits_of
from lathe_chatter.nodes.parameter_table import ParameterTable, Row, Values, rows_of


def _derived_machine(given: Values) -> Values:
    """Without a stiffness of its own the bearing has the paper's, k_bc = 0.5 k_wp."""
    return {'bearing_stiffness': machine_from(given).bearing_stiffness}


def _derived_lathe(given: Values) -> Values:
    """The machine's derived values, once the two rates are known to agree."""
    rates = {name: float(given.get(name, LATHE[name].default)) for name in _RATES}  # type: ignore[arg-type]  # checked numbers
    samples_per_tick(rates['sample_rate'], rates['tick_rate'])
    return _derived_machine(given)


def _derived_monitor(given: Values) -> Values:
    """The machine's derived values, once the range of speeds is one."""
    slowest, fastest = (float(given.get(n, MONITOR[n].default)) for n in _SPEED_RANGE)  # type: ignore[arg-type]  # checked numbers
    if slowest >= fastest:
        allowed = f'above slowest_speed, which is {slowest:g} rev/min'
        raise ParameterError('fastest_speed', fastest, 'rev/min', allowed)
    return _derived_machine(given)


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


def _setup_row(name: str) -> Row:
    """A number that a lathe is given at the start."""
    limits = limits_of(LatheSetup, name)
    return Row(name, getattr(LatheSetup(), name), limits.meaning, limits)


_RATES = ('sample_rate', 'tick_rate')
_SPEED_RANGE = ('slowest_speed', 'fastest_speed')
_ADVISED = limits_of(Cut, 'spindle_speed_rpm')

MACHINE_ROWS = tuple(rows_of(Machine()))
CUT_ROWS = tuple(rows_of(Cut(), run_time=True))

LATHE = ParameterTable(
    (
        *CUT_ROWS,
        Row(
            'real_time_factor',
            1.0,
            'simulated seconds per second; 0 is as fast as possible',
            Quantity('', low=0.01, high=100.0, or_zero=True),
            run_time=True,
        ),
        Row(
            'tool_leaves_cut',
            default=True,
            meaning='total chip force that vanishes out of the cut; false: the linear force (2)',
        ),
        *MACHINE_ROWS,
        _setup_row('spindle_acceleration'),
        Row('tick_rate', 500.0, 'rate of publication', Quantity('', 'Hz', low=1.0, high=5e3)),
        _setup_row('sample_rate'),
        Row('seed', 0, SEED.meaning, SEED),
        Row('publish_clock', default=False, meaning='whether this node drives /clock'),
        Row(
            'realtime_priority',
            1,
            'priority (SCHED_RR) to ask for, where permitted, while it keeps real time; 0: none',
            Quantity('', high=99.0),
        ),
        Row(
            'await_readers',
            0,
            'readers of ~/samples that the first tick waits for, unless ~/pause says otherwise',
            Quantity('', high=1000.0),
        ),
        Row('record', '', 'folder of a run that this node records by itself; empty: none'),
    ),
    _derived_lathe,
)
"""Node `lathe`."""


class ModelSource(str, Enum):
    """Where the monitor gets the machine from: its own parameters, the lathe's, or nowhere."""

    PARAMETERS = 'parameters'
    LATHE = 'lathe'
    NONE = 'none'


MONITOR = ParameterTable(
    (
        Row(
            'model',
            ModelSource.PARAMETERS.value,
            (ModelSource.__doc__ or '').rstrip('.'),
            choices=ModelSource,
        ),
        *MACHINE_ROWS,
        Row('slowest_speed', 60.0, 'slowest spindle speed to recommend', _ADVISED),
        Row('fastest_speed', 30000.0, 'fastest spindle speed to recommend', _ADVISED),
    ),
    _derived_monitor,
)
"""Node `chatter_monitor`: the machine as an impact test would tell it, never the cut."""

RECORDED_TOPICS = [
    'lathe/samples',
    *(
        f'chatter_monitor/{name}'
        for name in (
            'chatter',
            'state',
            'growth_rate',
            'frequency',
            'amplitude',
            'recommended_speed_rpm',
        )
    ),
    '/parameter_events',
    '/rosout',
    '/diagnostics',
]

RECORDER = ParameterTable(
    (
        Row('output', '', 'folder of the run to make; empty: runs/<date-time>'),
        Row('topics', RECORDED_TOPICS, 'topics to record, whenever they appear'),
        Row('attachments', [], 'files to keep in the run as they are, its scenario for instance'),
        Row('autostart', default=True, meaning='whether to record from the start'),
        Row(
            'split_duration',
            300.0,
            'recording in one file before the next is begun',
            Quantity('', 's', low=1.0, high=86400.0),
        ),
        Row(
            'min_free_space',
            50_000_000,
            'bytes that the disk must keep; with less the recording ends, complete',
            Quantity('', 'byte', high=2.0**53),
        ),
    )
)
"""Node `run_recorder`."""
