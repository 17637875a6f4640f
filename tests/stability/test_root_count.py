from __future__ import annotations

import itertools

import numpy as np
import pytest
from support.machines import random_machine

from lathe_chatter.model import Machine
from lathe_chatter.stability import count_roots_right_of, critical_depth, leading_roots
from lathe_chatter.stability.characteristic import Cuts
from lathe_chatter.stability.root_count import UNDECIDED, count_right_of


@pytest.mark.parametrize('rpm', [60.0, 300.0, 1000.0, 3000.0, 12000.0])
def test_the_count_steps_at_every_root(rpm: float) -> None:
    depth = 9e-4
    roots = leading_roots(Machine(), rpm, depth, seated=False, count=10)
    expected = 0
    for root, after in itertools.pairwise(roots):
        expected += 2 if root.imag > 0.0 else 1
        between = 0.5 * (root.real + after.real)
        assert count_roots_right_of(Machine(), rpm, depth, between, seated=False) == expected


def test_without_delay_the_count_is_that_of_a_polynomial() -> None:
    # e^(-s tau) without a cut: only the zeros of a(s) are left, at -32.5 and -38.75.
    for line, expected in [(-30.0, 0), (-35.0, 2), (-40.0, 4), (-1000.0, 4)]:
        assert count_roots_right_of(Machine(), 3000.0, 0.0, line, seated=False) == expected


def test_a_line_through_a_root_is_undecided() -> None:
    machine = Machine()
    cut = Cuts.of(machine, 3000.0, 1e-3, seated=False)
    root = leading_roots(machine, 3000.0, 1e-3, seated=False, count=1)[0]
    exactly = count_right_of(cut, np.array([root.real]))[0]
    assert exactly in (UNDECIDED, 0, 2)
    for offset, expected in [(1e-9, 0), (-1e-9, 2)]:
        assert count_right_of(cut, np.array([root.real + offset]))[0] == expected


@pytest.mark.parametrize('damping', [0.05, 0.001])
def test_a_pair_crosses_the_axis_at_the_critical_depth(damping: float) -> None:
    rng = np.random.default_rng(7)
    for _ in range(40):
        machine = random_machine(rng, damping=damping)
        rpm, seated = np.exp(rng.uniform(np.log(60.0), np.log(30000.0))), bool(rng.integers(2))
        critical = critical_depth(machine, rpm, seated=seated)
        depths = critical * np.array([0.3, 0.9, 1.0 - 1e-8, 1.0 + 1e-8])
        counts = count_right_of(Cuts.of(machine, rpm, depths, seated=seated), np.zeros(4))
        assert counts.tolist() == [0, 0, 0, 2]
