"""ROS domains of tests: nobody else has them, and nobody had them a moment ago."""

from __future__ import annotations

import itertools
import os
import random
from collections.abc import Iterator
from contextlib import contextmanager

import domain_coordinator

# In another order in each process, and each in its turn: who was killed in a domain is heard of
# there for 20 s more, and would be taken for somebody of the next test.
_numbers = itertools.cycle(random.Random(os.getpid()).sample(range(1, 101), 100))


@contextmanager
def own_domain() -> Iterator[int]:
    """A domain for as long as it lasts."""
    with domain_coordinator.domain_id(_numbers.__next__) as number:
        yield int(number)
