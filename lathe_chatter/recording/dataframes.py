"""The samples of a run in the hands of other libraries; none of them is needed for the rest."""

from __future__ import annotations

from typing import Any

from lathe_chatter.errors import optional
from lathe_chatter.recording.sample_blocks import TIME
from lathe_chatter.recording.sample_series import Samples
from lathe_chatter.samples.columns import UNITS


def to_pandas(samples: Samples) -> Any:
    """Samples, with their time, as a DataFrame by simulated time, s.

    Returns:
        A DataFrame; `attrs` holds the units, and the gaps and restarts, which it joins.

    Raises:
        MissingPackageError: If pandas is not installed.
    """
    pandas = optional('pandas', 'A DataFrame')
    frame = pandas.DataFrame(samples.columns).set_index(TIME)
    frame.attrs = _facts(samples)
    return frame


def to_xarray(samples: Samples) -> Any:
    """Samples, with their time, as a Dataset over simulated time, s; otherwise as `to_pandas`.

    Raises:
        MissingPackageError: If xarray is not installed.
    """
    xarray = optional('xarray', 'A Dataset')
    signals = {
        name: (TIME, values, {'units': UNITS.get(name, '')})
        for name, values in samples.columns.items()
        if name != TIME
    }
    time = (TIME, samples.columns[TIME], {'units': UNITS[TIME]})
    return xarray.Dataset(signals, coords={TIME: time}, attrs=_facts(samples))


def _facts(samples: Samples) -> dict[str, Any]:
    return {
        'units': {name: UNITS.get(name, '') for name in samples.columns},
        'gaps': samples.gaps,
        'restarts': samples.restarts,
    }
