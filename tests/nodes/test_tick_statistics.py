from __future__ import annotations

from lathe_chatter.nodes.tick_statistics import Durations


def test_quantiles_are_those_of_the_latest() -> None:
    durations = Durations()
    assert durations.quantiles(0.5, 1.0) == (0.0, 0.0)
    for value in range(10_000):
        durations.add(value)
    assert durations.quantiles(0.0, 1.0) == (10_000 - 4096, 9999)
    durations.clear()
    durations.add(3.0)
    assert durations.quantiles(0.5) == (3.0,)
