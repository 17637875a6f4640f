"""The samples of a run in the hands of other libraries; none of them is needed for the rest."""

from __future__ import annotations

from typing import Any

import numpy as np

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
    frame.attrs = {
        'units': {name: UNITS.get(name, '') for name in samples.columns},
        'gaps': samples.gaps,
        'restarts': samples.restarts,
    }
    return frame


def to_xarray(samples: Samples) -> Any:
    """Samples, with their time, as a Dataset over simulated time, s, which netCDF can hold.

    Returns:
        A Dataset; each variable has its `units`, and `attrs` the gaps and restarts, which it
        joins, as (2n,): before and after of one, of the next, ...

    Raises:
        MissingPackageError: If xarray is not installed.
    """
    xarray = optional('xarray', 'A Dataset')
    signals = {
        name: (TIME, values, {'units': UNITS.get(name, '')})
        for name, values in samples.columns.items()
        if name != TIME
    }
    joined = {'gaps': np.ravel(samples.gaps), 'restarts': np.ravel(samples.restarts)}
    time = (TIME, samples.columns[TIME], {'units': UNITS[TIME]})
    return xarray.Dataset(signals, coords={TIME: time}, attrs=joined)
