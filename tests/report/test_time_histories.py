"""What the picture of a run joins by lines, and what not."""

from __future__ import annotations

import numpy as np

from lathe_chatter.report.time_histories import apart


def test_figures_are_not_joined_over_a_silence() -> None:
    series = np.array([[0.0, 0.05, 0.1, 1.0, 1.05, 3.0], [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]])
    times, values = apart(series, 0.2)
    assert np.array_equal(values, [1.0, 2.0, 3.0, np.nan, 4.0, 5.0, np.nan, 6.0], equal_nan=True)
    assert np.array_equal(np.isnan(times), np.isnan(values))


def test_a_series_without_a_silence_is_left_as_it_is() -> None:
    for count in (0, 1, 5):
        series = np.vstack([0.05 * np.arange(count), np.arange(count)])
        assert np.array_equal(apart(series, 0.2), series)
