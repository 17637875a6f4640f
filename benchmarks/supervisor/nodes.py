"""The real nodes: a lathe is made to chatter over DDS, and a supervisor ends it, or does not."""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import fields
from pathlib import Path
from typing import NamedTuple

os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')

import domain_coordinator
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.srv import GetParameters
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import parameter_value_to_python
from std_msgs.msg import Bool, String
from support.node_bench import LATCHED, Bench
from support.node_processes import NodeProcesses
from trials import Trial, true_growth

from lathe_chatter.lathe.config import LatheConfig
from lathe_chatter.model.machine_and_sampling import LatheSetup
from lathe_chatter.nodes.operator_node import parameter_arguments
from lathe_chatter.nodes.parameter_tables import MONITOR
from lathe_chatter.supervisor import Limits

_PATIENCE, _ALARM, _AFTER = 120.0, 8.0, 10.0
"""s for nodes to start, for an alarm, and for the supervisor."""
_SUPERVISOR, _LATHE = '/chatter_supervisor', '/lathe'


class Played(NamedTuple):
    """What came of it.

    Attributes:
        alarmed: Whether there was an alarm.
        ended: Whether the flag is down and the cut stable.
        time: From the flag to the sentence that the chatter has ended, s.
        said: All sentences.
    """

    alarmed: bool
    ended: bool = False
    time: float = float('nan')
    said: tuple[str, ...] = ()


@contextmanager
def _bench(folder: Path) -> Iterator[tuple[Bench, NodeProcesses]]:
    """A client in a domain of its own, and nodes as processes."""
    with domain_coordinator.domain_id() as number:
        os.environ['ROS_DOMAIN_ID'] = str(number)
        context = Context()
        rclpy.init(context=context, domain_id=number)
        executor = SingleThreadedExecutor(context=context)

        def spin_until(predicate: Callable[[], object], what: str = '') -> None:
            end = time.monotonic() + _PATIENCE
            while not predicate():
                if time.monotonic() > end:
                    raise RuntimeError(f'{what} did not come within {_PATIENCE:.0f} s')
                executor.spin_once(timeout_sec=0.02)

        nodes = NodeProcesses(folder)
        bench = Bench(context, executor, spin_until)
        try:
            yield bench, nodes
        finally:
            nodes.end()
            time.sleep(0.3)  # else Fast DDS may wait for itself where a participant goes
            executor.shutdown()
            bench.node.destroy_node()
            context.try_shutdown()


def _words(parameters: dict[str, object]) -> list[str]:
    return parameter_arguments(parameters)[1::2]


def play_nodes(trial: Trial) -> Played:
    """Start a cell, deepen the cut, and see."""
    calm = trial.cut.with_changes(depth_of_cut=0.45 * trial.cut.depth_of_cut)
    given = LatheConfig(LatheSetup(trial.machine, seed=trial.seed), calm).parameters()
    given.pop('machine')
    limits = {entry.name: getattr(trial.limits, entry.name) for entry in fields(Limits)}
    told = {name: value for name, value in given.items() if name in MONITOR}
    with tempfile.TemporaryDirectory() as folder, _bench(Path(folder)) as (bench, nodes):
        nodes.start('chatter_monitor', *_words(told))
        nodes.start('chatter_supervisor', *_words({'mode': 'act', 'hands_off': 0.0, **limits}))
        flags = bench.listen(Bool, '/chatter_monitor/chatter', LATCHED)
        said = bench.listen(String, f'{_SUPERVISOR}/action', LATCHED)
        reports = bench.listen_first(DiagnosticArray, '/diagnostics')
        nodes.start('lathe', 'await_readers:=1', *_words(given))

        def ready() -> bool:
            statuses = [s for m in reports for s in m.status if s.name.startswith(_SUPERVISOR)]
            return bool(statuses) and statuses[-1].message == 'ready'

        bench.spin_until(ready, 'a supervisor that is ready')
        until = time.monotonic() + 2.0
        bench.spin_until(lambda: time.monotonic() > until)
        bench.set_together(_LATHE, depth_of_cut=trial.cut.depth_of_cut)
        until = time.monotonic() + _ALARM
        bench.spin_until(lambda: flags[-1].data or time.monotonic() > until)
        if not flags[-1].data:
            return Played(alarmed=False)
        begun = time.monotonic()
        bench.spin_until(
            lambda: any('has ended' in m.data for m in said) or time.monotonic() > begun + _AFTER
        )
        lasted = time.monotonic() - begun
        names = [*trial.cut.__dataclass_fields__]
        answer = bench.call(
            GetParameters, f'{_LATHE}/get_parameters', GetParameters.Request(names=names)
        )
        values = map(parameter_value_to_python, answer.values)
        final = trial.cut.with_changes(**dict(zip(names, values, strict=True)))
        stable = true_growth(trial.machine, final) < 0.0 and not flags[-1].data
        return Played(alarmed=True, ended=stable, time=lasted, said=tuple(m.data for m in said))
