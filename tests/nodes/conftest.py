"""A domain, a context and an executor of its own for each test of a node: no mocks, real DDS."""

from __future__ import annotations

import gc
import os
import resource
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

# Before rclpy is imported anywhere: the tests of one machine must not meet those of another.
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'

import pytest
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from support.browser import Browser
from support.domains import own_domain
from support.node_bench import Bench
from support.node_processes import NodeProcesses
from support.page_cell import Page, looking_at

from lathe_chatter.precompile import DETECTOR_LOOP, LATHE_LOOP, MOVE_LOOPS, precompile

PATIENCE = 120.0
"""s: the start of a node takes 20 s where others keep the machine busy."""
SETTLING = 0.3
"""s in which DDS hears that processes have ended, on an idle core: Fast DDS may crash, or wait for
itself for ever, where the participant of a test goes meanwhile (`node_main.exit_within`)."""
SpinUntil = Callable[..., None]


@pytest.fixture(scope='module')
def domain() -> Iterator[int]:
    """A ROS domain that no other test process on this machine uses."""
    with own_domain() as number:
        os.environ['ROS_DOMAIN_ID'] = str(number)
        yield number


@pytest.fixture
def context(domain: int) -> Iterator[Context]:
    context = Context()
    rclpy.init(context=context, domain_id=domain)
    yield context
    context.try_shutdown()


@pytest.fixture
def executor(context: Context) -> Iterator[SingleThreadedExecutor]:
    """Spun by the test itself, so that an exception in a callback fails the test."""
    executor = SingleThreadedExecutor(context=context)
    processes = _time_of_processes()
    yield executor
    if _time_of_processes() != processes:
        time.sleep(SETTLING * max(1.0, os.getloadavg()[0] / (os.cpu_count() or 1)))
    for node in executor.get_nodes():
        executor.remove_node(node)
        node.destroy_node()
    executor.shutdown()


def _time_of_processes() -> float:
    """Processor time of the processes that this one has started and seen end, s."""
    return sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2])


@pytest.fixture
def spin_until(executor: SingleThreadedExecutor) -> SpinUntil:
    """Spin until a predicate holds; fail with `what` if it does not within a generous limit."""

    def spin(predicate: Callable[[], object], what: str = 'the expected') -> None:
        end = time.monotonic() + PATIENCE
        while not predicate():
            assert time.monotonic() < end, f'{what} did not come within {PATIENCE} s'
            executor.spin_once(timeout_sec=0.05)

    return spin


@pytest.fixture
def bench(context: Context, executor: SingleThreadedExecutor, spin_until: SpinUntil) -> Bench:
    """A client of the nodes under test."""
    return Bench(context, executor, spin_until)


@pytest.fixture
def start(context: Context, executor: SingleThreadedExecutor) -> Iterator[Callable[..., Any]]:
    """Start a node of a class with parameters given as for `-p`, spun by the test.

    A node that was refused goes with its test: collected later, it would take the log of the next
    one of its name off /rosout.
    """
    refused = False

    def make(kind: Callable[..., Any], namespace: str = '', **values: Any) -> Any:
        nonlocal refused
        overrides = [Parameter(name, value=value) for name, value in values.items()]
        try:
            node = kind(context=context, namespace=namespace, parameter_overrides=overrides)
        except Exception:
            refused = True
            raise
        executor.add_node(node)
        node.begin()
        return node

    yield make
    if refused:
        gc.collect()


@pytest.fixture(scope='session')
def compiled() -> None:
    """The inner loops are compiled, or else each process would do it for itself."""
    precompile(LATHE_LOOP, DETECTOR_LOOP, MOVE_LOOPS)


@pytest.fixture
def nodes(domain: int, compiled: None, tmp_path: Path) -> Iterator[NodeProcesses]:  # noqa: ARG001
    """Nodes as processes; what they said is shown where a test fails."""
    started = NodeProcesses(tmp_path)
    yield started
    started.end()
    sys.stdout.write(started.said())


@pytest.fixture(scope='module')
def browser(page: Page, tmp_path_factory: Any) -> Iterator[Browser]:
    """One that has the page of the module's cell open."""
    with looking_at(page.url(), tmp_path_factory.mktemp('profile')) as browser:
        yield browser
