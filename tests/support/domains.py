"""ROS domains of tests: nobody else has them, and nobody had them a moment ago."""

from __future__ import annotations

import itertools
import os
import random
from collections.abc import Iterator
from contextlib import contextmanager

import domain_coordinator

# Each in its turn, in another order in each process, and to each worker its own: who was killed in
# a domain is heard of there for 20 s more, and would be taken for somebody of the next test.
_worker = int(os.environ.get('PYTEST_XDIST_WORKER', 'gw0')[2:])
_workers = int(os.environ.get('PYTEST_XDIST_WORKER_COUNT', '1'))
_mine = range(1 + _worker, 101, _workers)
_numbers = itertools.cycle(random.Random(os.getpid()).sample(_mine, len(_mine)))


@contextmanager
def own_domain() -> Iterator[int]:
    """A domain for as long as it lasts."""
    with domain_coordinator.domain_id(_numbers.__next__) as number:
        yield int(number)
