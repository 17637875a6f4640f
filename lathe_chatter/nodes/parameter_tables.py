"""The parameters of the nodes: one table each, from which everything about them is made.

The lathe's stand in model/lathe_parameter_table.py, for they are also those of scenarios, options
and records; the monitor has the machine's, and the recorder its own.
"""

from __future__ import annotations

from enum import Enum

from lathe_chatter.detection.speed_adviser import SPEEDS
from lathe_chatter.errors import ParameterError
from lathe_chatter.model import Cut
from lathe_chatter.model.lathe_parameter_table import (
    LATHE,
    MACHINE_FILE,
    MACHINE_ROWS,
    derived_machine,
    described_by,
)
from lathe_chatter.model.parameter_table import ParameterTable, Resolved, Row, Values, rows_of
from lathe_chatter.model.quantity_fields import Quantity, limits_of
from lathe_chatter.nodes.recorder_parameters import RECORDER
from lathe_chatter.supervisor import Limits, Mode

__all__ = ['LATHE', 'MONITOR', 'PAGE', 'RECORDER', 'SUPERVISOR', 'ModelSource']

_SPEED_RANGE = ('slowest_speed', 'fastest_speed')
_BAND = ('lowest_frequency', 'highest_frequency')
_ADVISED = limits_of(Cut, 'spindle_speed_rpm')
_NOMINAL = Quantity('', 'rev/min', low=_ADVISED.low, high=_ADVISED.high, or_zero=True)
_HEARD = Quantity('', 'Hz', high=50_000.0)


def _derived_monitor(given: Values) -> Resolved:
    """The machine's derived values, once the range of speeds is one."""
    described = described_by(given)
    usual = {name: getattr(described, name, MONITOR[name].default) for name in _SPEED_RANGE}
    spindle = {name: float(given.get(name, usual[name])) for name in _SPEED_RANGE}  # type: ignore[arg-type]  # checked numbers
    slowest, fastest = spindle.values()
    if slowest >= fastest:
        allowed = f'above slowest_speed, which is {slowest:g} rev/min'
        raise ParameterError('fastest_speed', fastest, 'rev/min', allowed)
    lowest, highest = (float(given.get(name, 0.0)) for name in _BAND)  # type: ignore[arg-type]  # checked numbers
    if highest > 0.0 and lowest >= highest:
        raise ParameterError(_BAND[1], highest, 'Hz', f'0, or above {_BAND[0]}, {lowest:g} Hz')
    source = given.get('model', MONITOR['model'].default)
    if source == ModelSource.AUTO.value:
        own = {MACHINE_FILE.name, *(row.name for row in MACHINE_ROWS)} & given.keys()
        source = ModelSource.PARAMETERS.value if own else ModelSource.LATHE.value
    return {**derived_machine(given), **spindle, 'model': source}


class ModelSource(str, Enum):
    """Where the monitor gets the machine from."""

    AUTO = 'auto'
    PARAMETERS = 'parameters'
    LATHE = 'lathe'
    NONE = 'none'


MONITOR = ParameterTable(
    (
        Row(
            'model',
            ModelSource.AUTO.value,
            "where the machine comes from: the node's own parameters, the lathe's, or nowhere; "
            'auto becomes parameters where any of them is given, else lathe, if one is there',
            choices=ModelSource,
        ),
        MACHINE_FILE,
        *MACHINE_ROWS,
        Row('slowest_speed', SPEEDS[0], 'slowest spindle speed to recommend', _ADVISED),
        Row('fastest_speed', SPEEDS[1], 'fastest spindle speed to recommend', _ADVISED),
        Row(
            'lowest_frequency',
            0.0,
            'lowest frequency at which chatter is looked for where no machine is known; 0: 20 Hz',
            _HEARD,
        ),
        Row(
            'highest_frequency',
            0.0,
            'the highest; 0: 5 kHz, or as far as the sample rate allows',
            _HEARD,
        ),
        Row(
            'spindle_speed_rpm',
            0.0,
            'nominal spindle speed, for samples without an angle or a pulse a turn; 0: unknown',
            _NOMINAL,
        ),
    ),
    _derived_monitor,
)
"""Node `chatter_monitor`: the machine as an impact test would tell it, never the cut."""


def _checked_limits(given: Values) -> Resolved:
    """Nothing follows from them, but they have to agree."""
    Limits(**{name: given[name] for name in Limits.__dataclass_fields__ if name in given})  # type: ignore[arg-type]  # checked numbers
    return {}


SUPERVISOR = ParameterTable(
    (
        Row(
            'mode', Mode.SHADOW.value, (Mode.__doc__ or '').rstrip('.'), None, Mode, run_time=True
        ),
        *rows_of(Limits(), run_time=True),
        Row(
            'machine_error',
            0.03,
            'relative standard error of the figures of the machine, with which moves reckon',
            Quantity('', high=0.3),
            run_time=True,
        ),
        Row(
            'hands_off',
            2.0,
            'seconds without any action after somebody else has changed something',
            Quantity('', 's', high=3600.0),
            run_time=True,
        ),
        Row(
            'margin_limit',
            0.1,
            'margin of the depth of cut below which it warns',
            Quantity('', low=-1.0, high=10.0),
            run_time=True,
        ),
        Row(
            'move_early',
            default=False,
            meaning='whether, in the mode `act`, it moves then too, before there is chatter',
            run_time=True,
        ),
    ),
    _checked_limits,
)
"""Node `chatter_supervisor`."""

PAGE = ParameterTable(
    (
        Row('host', '127.0.0.1', 'address to serve the page on; others than this machine need a '
            'token'),
        Row('port', 8080, 'port to serve the page on; 0: any that is free',
            Quantity('', high=65535.0)),
        Row('token', '', 'what viewers who act must know, 16 characters or more; it is not shown '
            'again'),
    )
)  # fmt: skip
"""Node `operator_page`."""
