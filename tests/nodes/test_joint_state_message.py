"""Times and samples as messages."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from lathe_chatter.array_types import Array
from lathe_chatter.nodes.joint_state_message import joint_states, nanoseconds, time_message


def block(rows: int, width: int, seed: int = 0) -> Array:
    return np.random.default_rng(seed).standard_normal((rows, width))


@pytest.mark.parametrize('rate', [1e4, 12_345.678, 3.0, 44_100.0])
@pytest.mark.parametrize('count', [0, 1, 7, 10**6 + 1, 3 * 10**12 + 1])
def test_simulated_time_is_the_nearest_whole_nanosecond(count: int, rate: float) -> None:
    exact = Fraction(count) * 10**9 / Fraction(rate)
    assert abs(nanoseconds(count, rate) - exact) <= Fraction(1, 2)


def test_a_stamp_splits_at_the_second() -> None:
    stamp = time_message(12_000_000_003)
    assert (stamp.sec, stamp.nanosec) == (12, 3)


def test_the_joints_carry_opposite_forces() -> None:
    sample = np.arange(8.0)
    message = joint_states(sample, 1_500_000_000)
    assert message.name == ['tool', 'workpiece']
    assert message.position.tolist() == [2.0, 4.0]
    assert message.velocity.tolist() == [3.0, 5.0]
    assert message.effort.tolist() == [-7.0, 7.0]
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (1, 500_000_000)
