"""The samples of a run in the hands of other libraries; none of them is needed for the rest."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from importlib import import_module
from typing import TYPE_CHECKING, Any

from lathe_chatter.errors import LatheChatterError
from lathe_chatter.samples import SAMPLE_COLUMNS

if TYPE_CHECKING:
    from lathe_chatter.recording.run import Run
    from lathe_chatter.recording.sample_series import Samples

UNITS: Mapping[str, str] = dict(
    zip(SAMPLE_COLUMNS, ('s', 'rev', 'm', 'm/s', 'm', 'm/s', 'm', 'N'), strict=True)
)
"""SI, and revolutions."""
_TIME = 'time'


class MissingPackageError(LatheChatterError):
    """A library that is not installed; the text says how to have it."""

    def __init__(self, name: str, use: str) -> None:
        """Name the library and what for."""
        super().__init__(f'{use} needs {name}, which is not installed: `pip install {name}`.')


def optional(name: str, use: str) -> Any:
    """A library that not everybody has.

    Raises:
        MissingPackageError: If it is not installed.
    """
    try:
        return import_module(name)
    except ImportError:
        raise MissingPackageError(name, use) from None


def to_pandas(run: Run, **chosen: Any) -> Any:
    """The samples as a DataFrame by simulated time, s.

    Args:
        run: The run.
        chosen: Topic, columns, start and end, as for `Run.samples`.

    Returns:
        A DataFrame; `attrs` holds the units, and the gaps and restarts, which it joins.

    Raises:
        MissingPackageError: If pandas is not installed.
        RunReadError: As `Run.samples`.
    """
    pandas = optional('pandas', 'A DataFrame')
    samples = run.samples(**_with_time(chosen))
    frame = pandas.DataFrame(samples.columns).set_index(_TIME)
    frame.attrs = _facts(samples)
    return frame


def to_xarray(run: Run, **chosen: Any) -> Any:
    """The samples as a Dataset over simulated time, s; otherwise as `to_pandas`.

    Raises:
        MissingPackageError: If xarray is not installed.
        RunReadError: As `Run.samples`.
    """
    xarray = optional('xarray', 'A Dataset')
    samples = run.samples(**_with_time(chosen))
    signals = {
        name: (_TIME, values, {'units': UNITS.get(name, '')})
        for name, values in samples.columns.items()
        if name != _TIME
    }
    time = (_TIME, samples.columns[_TIME], {'units': UNITS[_TIME]})
    return xarray.Dataset(signals, coords={_TIME: time}, attrs=_facts(samples))


def _with_time(chosen: Mapping[str, Any]) -> dict[str, Any]:
    columns: Iterable[str] | None = chosen.get('columns')
    return {**chosen, 'columns': None if columns is None else [_TIME, *columns]}


def _facts(samples: Samples) -> dict[str, Any]:
    return {
        'units': {name: UNITS.get(name, '') for name in samples.columns},
        'gaps': samples.gaps,
        'restarts': samples.restarts,
    }
