"""The advice that the table of a run lists, beside what was set."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from lathe_chatter.cli.report import _advice


def test_the_speed_that_was_set_is_among_the_advice() -> None:
    times_and_speeds = np.array([[5.0, 5.5, 6.0, 9.0], [3635.2, 3634.4, 3633.1, 3632.0]])
    history: Any = SimpleNamespace(
        estimates={'recommended_speed_rpm': times_and_speeds},
        flags=[SimpleNamespace(time=4.9, chatter=True)],
        changes=[SimpleNamespace(time=7.0, new={'spindle_speed_rpm': 3633.0})],
    )
    assert [f'{speed:.0f}' for _, speed in _advice(history)] == ['3635', '3633']
